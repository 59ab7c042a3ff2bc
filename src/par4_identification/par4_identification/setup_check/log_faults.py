"""Faults of the samples as findings, and the logs without them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_identification.logs.jumps import resolution
from par4_identification.logs.log import Log
from par4_identification.setup_check.finding import Finding, SetupCheck
from par4_identification.setup_check.flat_tops import flat_tops
from par4_identification.setup_check.held_readings import Held, held_stretches
from par4_identification.setup_check.mending import (
    despiked,
    doubted,
    filled,
    sound_time,
    unslipped,
    without,
)
from par4_identification.setup_check.mute_torques import mute_torques
from par4_identification.setup_check.pulses import joints_that_answer
from par4_identification.setup_check.spikes import slips, spikes
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.words import listed, number, percent

LEAST_SOUND, LEAST_SHARE = 3.0, 0.2
"""s in stretches of at least a second, and share of the log, that must be left."""
MOST_TOLD = 3
"""Slips of a joint that are told one by one."""
AT_LIMIT = 0.98
"""Share of the torque limit from which a flat torque is that of an amplifier at its limit."""


def without_log_faults(check: SetupCheck) -> SetupCheck:
    """Return the check with faults of the samples found, filled in or cut out."""
    for number_of_log in range(len(check.logs)):
        for step in (_despiked, _unheld, _with_own_torques, _unslipped, _unclipped):
            log = check.logs[number_of_log]
            findings, mended = step(log, check.machine)
            if not findings:
                continue
            if sound_time(mended) < min(LEAST_SOUND, sound_time(log)) or (
                    sound_time(mended) < LEAST_SHARE * sound_time(log)):
                findings = [replace(
                    finding, evidence=f'{finding.evidence}; too little of the log is left',
                    certain=False, useless=True) for finding in findings]
                mended = log
            logs = list(check.logs)
            logs[number_of_log] = mended
            check = check.after(findings, logs)
    return check


def joints_in_words(joints: Sequence[int]) -> str:
    """Return 'joint 2' or 'joints 0 and 1'."""
    return f'joint{"s" if len(joints) > 1 else ""} {listed([str(joint) for joint in joints])}'


def _readings(count: int) -> str:
    """Return a number of single readings as the beginning of a sentence."""
    return 'a single reading' if count == 1 else f'{count} single readings'


def _despiked(log: Log, machine: Robot | Axis) -> tuple[list[Finding], Log]:
    found, geometry = [], machine.geometry if isinstance(machine, Robot) else None
    for column, name, unit in (
            ('q', 'positions', unit_on(machine, 'rad')),
            ('tau', 'torques', unit_on(machine, 'N m'))):
        wrong = spikes(log, column)
        if column == 'tau' and wrong.any():
            wrong[:, joints_that_answer(log, wrong, geometry)] = False
        if not wrong.any():
            continue
        joints = tuple(int(joint) for joint in np.flatnonzero(wrong.any(axis=0)))
        mended = despiked(log, column, wrong)
        size = float(np.abs(getattr(log, column) - getattr(mended, column)).max())
        rows = np.flatnonzero(wrong.any(axis=1))
        found.append(Finding(
            'spikes', joints, _span(log, rows[0], rows[-1]),
            f'{_readings(int(wrong.sum()))} of the {name} of {joints_in_words(joints)} in '
            f'{log.name}: off the neighbours by up to {number(size, 2)} {unit} and back at once; '
            'this is interpolated',
            'Look for a loose plug, a missing shield or a lost bit on the way of these readings.',
            True))
        log = mended
    return found, log


def _unheld(log: Log, _machine: Robot | Axis) -> tuple[list[Finding], Log]:
    stretches = held_stretches(log)
    if not stretches:
        return [], log
    everything = log.q.shape[1]
    frozen: dict[int, list[Held]] = {}
    held = []
    # positions of an axis that stand still are those of a logger that holds torques, too
    holds = everything == 1 and any(item.torque for item in stretches)
    for item in stretches:
        if item.torque or holds or len(item.joints) == everything > 1:
            held.append(item)
        else:
            for joint in item.joints:
                frozen.setdefault(joint, []).append(item)
    found = []
    if held:
        lost = sum(item.end - item.start - 1 for item in held) * log.period
        longest = max(item.end - item.start - 1 for item in held) * log.period
        found.append(Finding(
            'held_samples', tuple(range(everything)), _span(log, held[0].start, held[-1].end),
            f'{len(held)} times the log {log.name} repeats its readings while the machine moves '
            f'and then jumps, for up to {number(1e3 * longest, 3)} ms, {number(lost, 2)} s in all; '
            'they are filled in, or left out where that might show',
            'Record on a less busy machine or with a longer queue, and do not publish a reading '
            'twice: repeated readings look like play in the joints.', True))
    meanwhile = 'while the machine moves' if everything > 1 else 'and then makes up its way at once'
    for joint, own in sorted(frozen.items()):
        lost = sum(item.end - item.start - 1 for item in own) * log.period
        found.append(Finding(
            'frozen_encoder', (joint,), _span(log, own[0].start, own[-1].end),
            f'the position of joint {joint} in {log.name} stands still to the last count for '
            f'{number(lost, 2)} s {meanwhile}; this stretch is left out',
            f'Check plug, cable and supply of the encoder of joint {joint}.', True))
    return found, filled(log, stretches)


def _with_own_torques(log: Log, machine: Robot | Axis) -> tuple[list[Finding], Log]:
    """Return the log without the stretches in which the torque of a joint is not its own."""
    stretches = mute_torques(log, not (isinstance(machine, Axis) and machine.gravity == 'none'))
    found, cut = [], np.zeros(len(log.t), dtype=bool)
    for other in dict.fromkeys(item.copied_from for item in stretches):
        own = [item for item in stretches if item.copied_from == other]
        joints = tuple(sorted({item.joint for item in own}))
        mute = np.zeros(len(log.t), dtype=bool)
        for item in own:
            mute[item.start:item.end] = True
        cut |= mute
        found.append(Finding(
            'held_samples', joints, _span(log, own[0].start, max(item.end for item in own)),
            f'the torque of {joints_in_words(joints)} in {log.name} ' + (
                'stands still to the last bit in motion' if other is None else
                f'is that of joint {other} to the last bit')
            + f', for {number(float(mute.sum()) * log.period, 2)} s; this is left out',
            f'Check what measures torque or current of {joints_in_words(joints)}, which channel it '
            'is read from, and whether something else moves the joint.', True))
    return found, without(log, cut)


def _unslipped(log: Log, machine: Robot | Axis) -> tuple[list[Finding], Log]:
    steps = slips(log)
    if not steps:
        return [], log
    found = []
    slides = isinstance(machine, Axis) and machine.kind == 'linear'
    unit, scale = ('mm', 1e3) if slides else ('degrees', math.degrees(1.0))
    for joint in dict.fromkeys(joint for _, joint, _ in steps):
        own = [(row, scale * step) for row, other, step in steps if other == joint]
        known = f'+- {number(scale * 2.0 * resolution(log.q[:, joint]), 1)} {unit}'
        told = [(row, f'jumps by {number(step, 3)} {known} within a sample at '
                      f'{number(float(log.t[row]), 4)} s and stays there; from then on the step '
                      f'is taken off') for row, step in own]
        if len(own) > MOST_TOLD:
            sizes = [abs(step) for _, step in own]
            told = [(own[0][0], f'jumps {len(own)} times within a sample and stays there, by '
                                f'{number(min(sizes), 3)} to {number(max(sizes), 3)} {known}, '
                                f'first at {number(float(log.t[own[0][0]]), 4)} s; each step is '
                                f'taken off')]
        found += [Finding(
            'encoder_slip', (joint,), _span(log, row, len(log.t) - 1),
            f'the position of joint {joint} in {log.name} {words}',
            f'Tighten the coupling of the encoder of joint {joint} and set its zero anew.', True)
            for row, words in told]
    return found, unslipped(log, steps)


def _unclipped(log: Log, machine: Robot | Axis) -> tuple[list[Finding], Log]:
    flat = flat_tops(log)
    if isinstance(machine, Robot):
        top = np.abs(log.tau).max(axis=0)
        flat &= top < AT_LIMIT * machine.drives.torque_limit
    if not flat.any():
        return [], log
    joints = tuple(int(joint) for joint in np.flatnonzero(flat.any(axis=0)))
    level = [number(end, 3) for joint in joints
             for end in np.unique(np.abs(log.tau[flat[:, joint], joint])).tolist()]
    rows = np.flatnonzero(flat.any(axis=1))
    return [Finding(
        'clipped', joints, _span(log, rows[0], rows[-1]),
        f'the torque of {joints_in_words(joints)} in {log.name} stands at exactly '
        f'{listed(list(dict.fromkeys(level)))} {unit_on(machine, "N m")} for '
        f'{percent(float(flat.any(axis=1).mean()))} of the time, as at the end of a converter or '
        f'at the limit of a drive; these samples are left out',
        'Widen the range of the converter, of the drive or of the message that carries the torque, '
        'or move more gently.', True)], doubted(log, flat)


def _span(log: Log, first: int, last: int) -> tuple[float, float]:
    last = min(int(last), len(log.t) - 1)
    return round(float(log.t[int(first)]), 3), round(float(log.t[last]), 3)
