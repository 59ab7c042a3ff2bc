"""The list of scenarios of a study, and one of them from its seed to recordings with their truth.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from hidden.hider import Values
from hidden.hiders import HIDERS
from hidden.kept import Kept, generator_hash
from hidden.outside import OUTSIDE
from hidden.physics import OutOfReach
from hidden.recording import Recording
from hidden.scenario import (
    DRAWS,
    KINDS,
    LARGE,
    UNREAL,
    Scenario,
    Task,
    draw_scenario,
    record_scenario,
    truth_of,
)
from hidden.scoring import diagnosed
from hidden.truth import CHAOTIC, VISIBLE, Truth, true_noise
from par4_identification.diagnosis.diagnosis import Diagnosis
from par4_kinematics.errors import UnreachableError

COUNTS = {'single': 420, 'pair': 115, 'removed': 110, 'clean': 400, 'below': 50, 'rods': 55,
          'triple': 125, 'company': 165, 'outside': 75, 'realistic': 105, 'wander': 100,
          'lines': 60, 'bursts': 60, 'coarse': 145, 'large': 60}
"""At scale 1: somewhat more than asked where some will not be visible; rods are 5 % of the first
six kinds."""
EVERY_BULLET, EVERY_BAG = 20, 20
"""One single in so many runs in pybullet, another through bags."""
STRIDE = 100_000
"""Between the seeds of two kinds."""
ALWAYS = {'rods': 'distributed_rods'}
NOTHING = ('clean', 'outside', 'realistic', 'wander', 'lines', 'bursts')
"""Kinds for which no effect is given."""
RATTLES = ('single', 'removed')
"""Kinds that hide rattling gaps, too."""
RECORDED = {'lines': 'hum', 'bursts': 'bursts'}


def tasks_of_study(scale: float, first_seed: int, kinds: Sequence[str] = KINDS,
                   number: int | None = None) -> list[Task]:
    """Return the tasks of a study; the same for the same arguments.

    Effects of the library, and causes outside it, come in turn, each turn in an order of its own
    that the first seed draws: a small study is a sample of all of them, and another one of others.
    The kinds are mixed, so that what is done of a study is a sample of the whole.

    Args:
        scale: of the counts.
        first_seed: seeds of a kind begin here or a multiple of `STRIDE` above.
        kinds: to make.
        number: of each kind, in place of the counts.
    """
    tasks = []
    for row, kind in enumerate(KINDS):
        wanted = number or max(1, round(scale * COUNTS[kind]))
        effects = _in_turn(_effects(kind), wanted, (first_seed, row, 0))
        outside = _in_turn(_outside(kind), wanted, (first_seed, row, 1))
        for index in range(wanted if kind in kinds else 0):
            tasks.append((index / wanted, Task(
                kind, first_seed + STRIDE * row + index, effects[index],
                coloured=kind == 'realistic' or index % 2 == 1,
                fidelity='fast' if kind == 'single' and index % EVERY_BULLET == 3 else 'exact',
                through_bag=kind == 'single' and index % EVERY_BAG == 13,
                outside=outside[index])))
    return [task for _, task in sorted(tasks, key=lambda item: item[0])]


def _effects(kind: str) -> list[str]:
    """Return the effects that tasks of a kind hide first; none: nothing is given."""
    if kind in NOTHING:
        return []
    if kind in ALWAYS:
        return [ALWAYS[kind]]
    if kind == 'large':
        return list(LARGE)
    left_out = () if kind in RATTLES else UNREAL if kind == 'company' else CHAOTIC
    return [name for name in HIDERS if name not in left_out]


def _outside(kind: str) -> list[str]:
    """Return the causes outside the library that tasks of a kind hide."""
    if kind in ('company', 'outside'):
        return list(OUTSIDE)
    return [RECORDED[kind]] if kind in RECORDED else []


def _in_turn(names: Sequence[str], number: int, seed: tuple[int, ...]) -> list[str | None]:
    """Return so many of the names, each as often as another to within one, in a drawn order."""
    if not names:
        return [None] * number
    random, drawn = np.random.default_rng(seed), list[str | None]()
    while len(drawn) < number:
        drawn += map(str, random.permutation(list(names)))
    return drawn[:number]


def made(task: Task, again: int = 0) -> Kept:
    """Return the recordings of a task and the truth behind them.

    Another machine is drawn where the true one leaves its reach, or the known one cannot move as it
    does.
    """
    started = time.perf_counter()
    scenario = draw_scenario(task, again)
    try:
        return _recorded(task, scenario, started)
    except (OutOfReach, UnreachableError):
        if again >= DRAWS:
            raise
        return made(task, again + 1)


def _recorded(task: Task, scenario: Scenario, started: float) -> Kept:
    fit, heldout = record_scenario(scenario)
    recorded = time.perf_counter()
    truth = truth_of(scenario, fit) if scenario.hidden or scenario.outside else None
    hidden = [_judged(truth, name, values) for name, values in scenario.hidden]
    if task.kind == 'realistic':
        carried = truth_of(scenario, heldout).carried()
        for item in hidden:
            item['carried'] = round(carried[item['effect']], 4)
    content = {
        **asdict(task), 'robot': scenario.known.name, 'geometry': scenario.known.robot.name,
        'motion': scenario.shape, 'feedforward': scenario.feedforward,
        'encoder_counts': scenario.known.robot.drives.encoder_counts,
        'rate': round(1.0 / fit.log.period),
        'noise': {'level': scenario.noise.torque_noise, 'memory': scenario.noise.correlation_time,
                  'wander': scenario.wander.level.tolist() if scenario.wander else None,
                  'wander_memory': scenario.wander.memory if scenario.wander else None},
        'hidden': hidden, 'strange': _strange(scenario, truth),
        'missing': _missing(task, hidden)}
    judged = time.perf_counter()
    content['seconds'] = {'record': round(recorded - started, 2),
                          'truth': round(judged - recorded, 2)}
    return Kept(content, scenario.known.robot, fit.log, heldout.log,
                true_noise(heldout, scenario.known), generator_hash())


def diagnosis_of(scenario: Scenario, fit: Recording, heldout: Recording,
                 missing: Sequence[str] = ()) -> Diagnosis:
    """Return the diagnosis of two recordings by a library that lacks some names."""
    return diagnosed(fit.log, heldout.log, scenario.known.robot, missing)


def _plain(values: Values) -> dict[str, Any]:
    return {key: np.asarray(value).round(9).tolist() for key, value in values.items()}


def _judged(truth: Truth, name: str, values: Values) -> dict[str, Any]:
    """Return what the truth says of a hidden effect."""
    strength = truth.strength(name)
    visible = bool(strength > VISIBLE)
    return {'effect': name, 'values': _plain(values), 'strength': round(strength, 1),
            'visible': visible, 'twins': truth.twins(name) if visible else [],
            'joint_sets': truth.joint_sets(name) if visible else None}


def _strange(scenario: Scenario, truth: Truth | None) -> dict[str, Any] | None:
    """Return what the truth says of a cause outside the library."""
    if scenario.outside is None:
        return None
    cause, values = scenario.outside
    strength = truth.strangeness
    visible = bool(strength > VISIBLE)
    return {'name': cause.name, 'values': _plain(values), 'strength': round(strength, 1),
            'visible': visible, 'acts_like': list(cause.acts_like),
            'twins': truth.impostors() if visible and cause.acts_like else []}


def _missing(task: Task, hidden: list[dict[str, Any]]) -> list[str]:
    """Return the names that the library of a scenario lacks."""
    return [hidden[0]['effect'], *hidden[0]['twins']] if task.kind == 'removed' else []
