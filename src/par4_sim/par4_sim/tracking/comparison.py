"""A comparison in words, as a table, and as `tracking.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.choices import TORQUE_LAW
from par4_sim.drives.laws import KNOWING
from par4_sim.report.outcome import Outcome, Remark, note
from par4_sim.report.results import plain
from par4_sim.report.words import capital, in_words, number, percent
from par4_sim.tracking.case import Case
from par4_sim.tracking.metrics import ATTAINED, first_limited_torque
from par4_sim.tracking.run import SETTLING

MILLI = 1e3


def outcome_of_tracking(cases: Sequence[Case], motion: Motion, machine: str, robot: Robot,
                        band: float) -> Outcome:
    """Return what a comparison found, in words.

    Args:
        cases: at least one, all of one motion.
        motion: asked of the machine.
        machine: its name.
        robot: that was moved.
        band: half width of the limit band, m.
    """
    best, worst = (choose(cases, key=lambda case: case.tracking.rms) for choose in (min, max))
    sentence = (f'{capital(best.label)} follows {motion.name} on {machine} with '
                f'{_millimetres(best.tracking.rms)} rms and {_millimetres(best.tracking.peak)} '
                f'peak error')
    if best is not worst:
        sentence += (f'; {worst.label} with {_millimetres(worst.tracking.rms)} rms, '
                     f'{number(worst.tracking.rms / best.tracking.rms, 2)} times as much')
    limited = [case for case in cases if case.tracking.saturated > 0.0]
    lost = [case for case in cases if case.tracking.missing_effort > 0]
    restless = [case for case in cases if not case.tracking.settled]
    remarks = [
        *(Remark(False, f'{capital(case.label)}: not settled, D leaves the limit band of '
                        f'± {MILLI * band:.3g} mm within the last {ATTAINED:g} s of the '
                        f'{SETTLING:g} s after the motion.',
                 'Give a wider --band, or see why the machine does not come to rest.')
          for case in restless),
        *(Remark(False, f'{capital(case.label)}: torque or speed was limited in '
                        f'{percent(case.tracking.saturated)} of all samples'
                        f'{_first_limited(case)}.',
                 'Slow the motion down, or raise the limits of the robot file.')
          for case in limited),
        *(Remark(False, f'{capital(case.label)}: {case.tracking.missing_effort} reference points '
                        f'came without feedforward torque.') for case in lost),
        *(Remark(False, f'{capital(case.label)}: {case.run.counts["unsolved_programs"]} looks '
                        f'ahead found no correction; it went on as computed torque.')
          for case in cases if case.run.counts['unsolved_programs']),
        *([] if limited else [Remark(True, 'No torque and no speed was limited.')]),
        note(f'The largest torque was '
             f'{number(max(case.tracking.peak_torque for case in cases))} N m.'),
        *_margins_in_words(cases),
        *(_learning_in_words(case, robot) for case in cases if case.learned)]
    return Outcome(f'{sentence}.', 'fair' if limited or lost or restless else 'good',
                   tuple(remarks))


def tracking_json(cases: Sequence[Case], motion: Motion, robot: Robot, cycles: int, band: float,
                  provenance: Mapping[str, Any]) -> dict[str, Any]:
    """Return `tracking.json`."""
    return plain({
        'schema': 'par4/tracking/1', 'robot': robot.name,
        'motion': {'name': motion.name, 'duration': motion.duration, 'cycles': cycles},
        'band': band,
        'runs': [{'controller': case.controller, 'feedforward': case.feedforward}
                 | asdict(case.tracking)
             | {'margin': case.margin and asdict(case.margin),
                'learned': [asdict(cycle) for cycle in case.learned]} for case in cases],
        'provenance': provenance})


LEAST_MODULUS = 0.2
"""Distance from -1 below which a loop is nearly unstable: errors are amplified five times."""


def _margins_in_words(cases: Sequence[Case]) -> list[Remark]:
    """Return a remark for each feedback that the cases have, once."""
    if any(case.margin is None and case.controller != TORQUE_LAW for case in cases):
        return [note('How far the loops are from instability is not told: the transmissions have '
                     'springs or gaps.')]
    margins = {case.controller if case.controller in KNOWING else 'loops': case.margin
               for case in cases if case.margin}
    return [Remark(margin.modulus >= LEAST_MODULUS, (
        f'Over the workspace the open loop of {in_words(name)} stays {number(margin.modulus, 2)} '
        f'from -1; all gains may rise {number(margin.gain, 2)} times, and a further delay of '
        f'{number(MILLI * margin.delay, 2)} ms is borne.' if margin.modulus > 0.0 else
        f'The workspace has poses at which {in_words(name)} would be unstable without friction.'),
        '' if margin.modulus >= LEAST_MODULUS else 'Lower the gains of the drives, or keep to a '
                                                   'smaller workspace.')
        for name, margin in margins.items()]


def _learning_in_words(case: Case, robot: Robot) -> Remark:
    counts = robot.drives.encoder_counts
    first, last = case.learned[0], min(case.learned, key=lambda cycle: cycle.joint_rms)
    size = (f'{number(last.joint_rms * counts / (2.0 * math.pi), 2)} encoder counts' if counts else
            f'{number(last.joint_rms, 2)} rad')
    label, before, after = capital(case.label), _millimetres(first.rms), _millimetres(last.rms)
    if len(case.learned) == 1:
        return note(f'{label}: one cycle shows no learning; the error of D was {before} rms, that '
                    f'of the joints {size} rms.', 'Give more --learning-cycles.')
    if last.rms >= first.rms or before == after:
        return Remark(False, f'{label}: within {len(case.learned)} cycles the error of D did not '
                             f'fall from {before} rms; that of the joints came to {size} rms.')
    return Remark(True, f'{label}: within {len(case.learned)} cycles the error of D fell from '
                        f'{before} to {after} rms, that of the joints to {size} rms.')


def _first_limited(case: Case) -> str:
    """Return where and when a torque was limited first, empty where only speeds were."""
    first = first_limited_torque(case.run)
    return f', first the {first[1]}' if first else ''


def _millimetres(value: float) -> str:
    return f'{number(MILLI * value)} mm'


COLUMNS: tuple[tuple[str, str, float], ...] = (
    ('rms error, mm', 'rms', MILLI), ('peak error, mm', 'peak', MILLI),
    ('beyond the ends, mm', 'excursion', MILLI), ('overshoot, mm', 'overshoot', MILLI),
    ('settling time, ms', 'settling_time', MILLI), ('arrival, ms', 'arrival', MILLI),
    ('peak torque, N m', 'peak_torque', 1.0), ('rms torque, N m', 'rms_torque', 1.0),
    ('energy a cycle, J', 'energy', 1.0), ('driving, J', 'driving_energy', 1.0),
    ('peak speed, rad/s', 'peak_speed', 1.0),
    ('outside the workspace, mm', 'outside', MILLI))
"""Heading, field of `Tracking` and factor of the columns of the table."""
FIELDS = tuple(field for _, field, _ in COLUMNS)
OF_A_STOP = ('settling_time', 'arrival')
"""Fields that are not finite where D does not settle."""
BRIEF = ('rms', 'peak', 'settling_time', 'peak_torque', 'energy')
"""Fields whose columns fit a terminal."""


def headings_of(fields: Sequence[str]) -> list[str]:
    """Return the headings of the columns of these fields."""
    return [heading for heading, field, _ in COLUMNS if field in fields]


def cells_of(case: Case, fields: Sequence[str]) -> list[str]:
    """Return the cells of a case in the columns of these fields."""
    return ['not settled' if field in OF_A_STOP and not case.tracking.settled
            else number(factor * getattr(case.tracking, field))
            for _, field, factor in COLUMNS if field in fields]
