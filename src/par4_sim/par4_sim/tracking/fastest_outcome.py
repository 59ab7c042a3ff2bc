"""What `par4_fastest` found: in words, as a table, and as `fastest.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from par4_dynamics.state import GRAVITY
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.choices import TIMINGS
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import plain
from par4_sim.report.words import capital, in_words, listed, number, percent
from par4_sim.tracking.fastest import Reached, Unreached
from par4_sim.tracking.time_optimal import Fastest, PathLimits

NAMES = ('controller', 'feedforward', 'timing')
HEADINGS = ('time, s', 'peak, G', 'bound / time', 'error, mm', 'torque, N m')


def outcome_of_fastest(found: Sequence[Reached | Unreached], fastest: Fastest, motion: Motion,
                       robot: Robot, limits: PathLimits, peak: float) -> Outcome:
    """Return what was found, in words.

    Args:
        found: of each controller with each model.
        fastest: of the path.
        motion: at its own pace.
        robot: whose joint speed is limited.
        limits: of the motion.
        peak: limit of the error, m.
    """
    best = best_of(found)
    kept = [f'{number(limits.torque)} N m', f'{number(robot.limits.joint_speed)} rad/s']
    if math.isfinite(limits.acceleration):
        kept.append(f'{number(limits.acceleration)} rad/s2')
    longer = 'that keeps them' if math.isinf(limits.jerk) else (
        f'that keeps them and {number(limits.jerk)} rad/s3')
    bound = Remark(not fastest.effects, (
        f'Nothing that keeps {listed(kept)} follows this path in less than '
        f'{number(fastest.bound, 4)} s; a motion {longer} takes {number(fastest.duration, 4)} s, '
        f'{percent(fastest.duration / fastest.bound - 1.0)} more. '
        f'The bound knows no error: whoever tracks needs torque in reserve.'
        + (f' Nor does it know what the machine has beside bodies and friction: '
           f'{_effects(fastest.effects)}.' if fastest.effects else '')
        + (f' The motion does not know {_effects(fastest.unknown)} either.'
           if fastest.unknown else '')))
    within = f'within {number(limits.torque)} N m and a peak error of {number(1e3 * peak)} mm'
    if best is None:
        return Outcome(f'None of the controllers tried does {motion.name} {within} at '
                       f'any pace.', 'bad', (
            bound, Remark(False, 'Every run breaks the limit of the error, however slow.',
                          'Give a model as --feedforward, or allow a larger error.')))
    time = best.case.run.motion.duration
    return Outcome(
        f'{capital(motion.name)} is done in {number(time, 4)} s with '
        f'{number(best.acceleration / GRAVITY)} G by {_label(best)}, {within}; nothing is '
        f'faster than {number(fastest.bound, 4)} s.', 'good',
        (bound, *(Remark(isinstance(item, Reached), f'{_label(item)}: limited by '
                                                    f'{item.limited_by}.') for item in found)))


def best_of(found: Sequence[Reached | Unreached]) -> Reached | None:
    """Return the fastest of all; None if no controller keeps the limits at any pace."""
    reached = [item for item in found if isinstance(item, Reached)]
    return min(reached, key=lambda item: item.case.run.motion.duration, default=None)


def _names(item: Reached | Unreached) -> tuple[str, str, str]:
    """Return the cells of `NAMES`."""
    part = item if isinstance(item, Unreached) else item.case
    return in_words(part.controller), part.feedforward, TIMINGS[item.timing]


def _label(item: Reached | Unreached) -> str:
    return ', '.join(_names(item))


def rows_of_fastest(found: Sequence[Reached | Unreached], fastest: Fastest
                    ) -> list[tuple[tuple[str, ...], list[str]]]:
    """Return the cells of `NAMES` and of `HEADINGS` for each."""
    rows: list[tuple[tuple[str, ...], list[str]]] = []
    for item in found:
        cells = ['never', *[''] * (len(HEADINGS) - 1)]
        if isinstance(item, Reached):
            tracking, time = item.case.tracking, item.case.run.motion.duration
            cells = [number(time, 4), number(item.acceleration / GRAVITY),
                     percent(fastest.bound / time), number(1e3 * tracking.peak),
                     number(tracking.peak_torque)]
        rows.append((_names(item), cells))
    return rows


def fastest_json(found: Sequence[Reached | Unreached], fastest: Fastest, motion: Motion,
                 robot: Robot, limits: PathLimits, peak: float, provenance: Mapping[str, Any]
                 ) -> dict[str, Any]:
    """Return `fastest.json`; time and what follows from it are null where no pace is slow enough.
    """
    def run(item: Reached | Unreached) -> dict[str, Any]:
        part = item if isinstance(item, Unreached) else item.case
        told = {'controller': part.controller, 'feedforward': part.feedforward,
                'timing': item.timing, 'limited_by': item.limited_by}
        if isinstance(item, Unreached):
            return told | dict.fromkeys(('time', 'pace', 'acceleration', 'peak', 'peak_torque'))
        return told | {'time': item.case.run.motion.duration, 'pace': item.pace,
                       'acceleration': item.acceleration, 'peak': item.case.tracking.peak,
                       'peak_torque': item.case.tracking.peak_torque}

    return plain({
        'schema': 'par4/fastest/1', 'robot': robot.name,
        'motion': {'name': motion.name, 'duration': motion.duration},
        'limits': {'torque': limits.torque, 'peak': peak,
                   'joint_acceleration': _finite(limits.acceleration),
                   'joint_jerk': _finite(limits.jerk)},
        'bound': fastest.bound, 'time_optimal': fastest.duration,
        'runs': [run(item) for item in found], 'provenance': provenance})


def _effects(names: Sequence[str]) -> str:
    return listed([in_words(name) for name in names])


def _finite(limit: float) -> float | None:
    return limit if math.isfinite(limit) else None
