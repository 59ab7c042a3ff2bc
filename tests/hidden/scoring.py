"""What the diagnosis makes of a kept scenario, as plain data: the one place that calls it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import par4_dynamics.effects
import par4_identification.diagnosis
from hidden.kept import Kept, hash_of
from par4_identification.diagnosis.diagnosis import LIBRARY, Diagnosis, diagnose
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.logs.log import Log
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.finding import Amount, SetupCheck
from par4_identification.setup_check.total import totals
from par4_identification.setup_check.unusable import diagnosed_if_sound
from par4_kinematics.robot import Robot

RATTLING = ('backlash',)
"""Effects of which the true machine itself would not do the same a second time."""
SETUP_FIRST = ('large',)
"""Kinds that are mistakes of the setup, which are looked for before a diagnosis."""
BESIDE = ('noise.py', 'rows.py', 'filtering.py', 'smoothing.py')
"""Sources of par4_identification.signals that the diagnosis decides with, beside its own."""


def decisions() -> str:
    """Return the hash of the sources that decide what is named."""
    core = Path(par4_identification.diagnosis.__file__).parent
    looks = core.parent / 'setup_check'
    return hash_of([*core.rglob('*.py'), *looks.glob('*.py'),
                    *Path(par4_dynamics.effects.__file__).parent.glob('*.py'),
                    *(core.parent / 'signals' / name for name in BESIDE)])


def outcome_of(kept: Kept, rules: Rules | None = None) -> dict[str, Any]:
    """Return what is hidden in a scenario and what the diagnosis says of it."""
    started = time.process_time()
    check = SetupCheck((), (kept.fit, kept.heldout), kept.robot)
    if kept.truth['kind'] in SETUP_FIRST:  # as par4_diagnose does with every log
        check = check_setup(check.logs, kept.robot)
    diagnosis = diagnosed_if_sound(check, lambda sound: diagnosed(
        *sound.logs, sound.machine, kept.truth['missing'], rules))
    spent = round(time.process_time() - started, 2)
    plain = told(diagnosis)
    mended = totals(check, getattr(diagnosis, 'causes', ()))
    plain['causes'] = [cause for cause in plain['causes'] if cause['effect'] not in {
        amount.effect for amount in mended}] + [_told_total(amount) for amount in mended]
    return {**kept.truth, 'generator': kept.generator, **plain,
            'setup': [finding.to_json() for finding in check.findings],
            'gain': None if check.findings else gain_of_truth(kept, diagnosis),
            'seconds': {**kept.truth['seconds'], 'diagnose': spent}}


def diagnosed(fit: Log, heldout: Log, robot: Robot, missing: Sequence[str] = (),
              rules: Rules | None = None) -> Diagnosis:
    """Return the diagnosis of two logs by a library that lacks some names."""
    library = {name: effect for name, effect in LIBRARY.items() if name not in missing}
    return diagnose([fit], robot, holdout_logs=[heldout], library=library, rules=rules)


def told(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a diagnosis as plain data; what a version of it does not tell is None or empty."""
    remaining = getattr(diagnosis, 'remaining', None)
    unrelated = getattr(remaining, 'unrelated', None)
    return {
        'verdict': getattr(diagnosis, 'verdict', 'unusable_data'),
        'causes': [{
            'effect': cause.effect.name, 'twins': list(cause.twins), 'joints': list(cause.joints),
            'values': {name: _numbers(parameter.value)
                       for name, parameter in cause.parameters.items()},
            'stds': {name: _numbers(parameter.std)
                     for name, parameter in cause.parameters.items()},
            'margin': _numbers(getattr(cause, 'margin', None)),
            'rival': getattr(cause, 'rival', None)}
            for cause in getattr(diagnosis, 'causes', ())],
        'unnamed': [{
            'kind': item.kind, 'phrase': item.phrase, 'joints': list(item.joints),
            'torque_rms': _numbers(item.torque_rms), 'share': _numbers(item.share)}
            for item in getattr(diagnosis, 'unnamed', ())],
        'wandering': None if unrelated is None or not unrelated.wanders else {
            'rms': _numbers(unrelated.wandering_rms), 'time': unrelated.correlation_time},
        'reasons': list(getattr(diagnosis, 'reasons', ())),
        'rejected': [[getattr(item, 'label', str(item)), getattr(item, 'reason', '')]
                     for item in getattr(diagnosis, 'rejected', ())],
        'looks_like': getattr(remaining, 'looks_like', None),
        'floor_excess': getattr(remaining, 'floor_excess', None)}


def _told_total(amount: Amount) -> dict[str, Any]:
    """Return a mistake of the setup as a cause with the value that it has in all."""
    return {'effect': amount.effect, 'twins': [],
            'joints': list(amount.joints or range(4)),
            'values': {name: _numbers(own.value) for name, own in amount.parameters.items()},
            'stds': {name: _numbers(own.std) for name, own in amount.parameters.items()},
            'margin': None, 'rival': None}


def _numbers(value: Any) -> Any:
    """Return a number, some numbers or nothing as JSON takes them."""
    return None if value is None else np.asarray(value, dtype=float).round(9).tolist()


def gain_of_truth(kept: Kept, diagnosis: Diagnosis) -> dict[str, float] | None:
    """Return how far the held-out error fell and would fall with the true model.

    Both over the true noise, in mean squares summed over the joints; what the true model leaves is
    the true noise itself, on the rows that the diagnosis judged. None for what rattles, and where
    a cause outside the library is part of the truth.
    """
    heldout = getattr(diagnosis, 'holdout', None)
    hidden = [item['effect'] for item in kept.truth['hidden']]
    if (heldout is None or not hidden or set(hidden) & set(RATTLING)
            or kept.truth['strange'] is not None):
        return None
    before = after = left = 0.0
    start = 0
    for run, old, new in zip(heldout.runs, heldout.baseline, heldout.extended):
        own = run.rows(kept.noise[start:start + len(run.state.t)])
        start += len(run.state.t)
        for joint in range(4):
            rows = run.valid[:, joint]
            level = max(float(np.mean(own[rows, joint] ** 2)), 1e-12) if rows.any() else 1.0
            before += float(np.sum(old[rows, joint] ** 2)) / level
            after += float(np.sum(new[rows, joint] ** 2)) / level
            left += float(np.sum(own[rows, joint] ** 2)) / level
    return {'found': before - after, 'possible': before - left, 'left': left}
