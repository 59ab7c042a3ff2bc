"""The motion that a command was asked for."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from par4_kinematics.adept import adept_motion
from par4_kinematics.circle import TURNS
from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion, check_limits
from par4_kinematics.motion_file import NAMED_MOTIONS, named_motion, repeats_within
from par4_kinematics.robot import Robot
from par4_sim.choices import PERIOD
from par4_sim.report.words import listed

MOTIONS_OF: Mapping[str, tuple[str, ...]] = {
    'duration': ('excitation', 'circle'), 'motion_seed': ('excitation',), 'period': NAMED_MOTIONS}
"""Of which motions an option is; those that are not here are of adept alone."""


def refuse_ignored(name: str, options: Mapping[str, float | None],
                   motions_of: Mapping[str, tuple[str, ...]] = MOTIONS_OF) -> None:
    """Refuse options that are given and that a motion does not have.

    Args:
        name: of the motion, or the path of a motion.yaml.
        options: by the name of the argument, None where not given.
        motions_of: what differs from `MOTIONS_OF`.

    Raises:
        InputError: names them.
    """
    known = {**MOTIONS_OF, **motions_of}
    ignored = {key: known.get(key, ('adept',)) for key, value in options.items()
               if value is not None and name not in known.get(key, ('adept',))}
    if not ignored:
        return
    flags = ', '.join(f'--{key.replace("_", "-")}' for key in ignored)
    them = 'it' if len(ignored) == 1 else 'them'
    if name in NAMED_MOTIONS:
        motions = list(dict.fromkeys(motion for part in ignored.values() for motion in part))
        instead = ', give --cycles' if name == 'adept' and 'duration' in ignored else ''
        raise InputError(f'{flags}: for the motion{"s" if len(motions) > 1 else ""} '
                         f'{listed(motions)}, found motion {name}; leave {them} away{instead} or '
                         f'write a motion.yaml')
    if Path(name).is_file():
        raise InputError(f'{flags}: found the motion file {name}, which is played as it is; leave '
                         f'{them} away or change the file')


def motion_asked(name: str, robot: Robot, duration: float | None = None,
                 motion_seed: int | None = None, period: float | None = None,
                 **adept: float | None) -> Motion:
    """Return the motion that a command was asked for, within the robot's limits.

    Args:
        name: adept, excitation, circle or the path of a motion.yaml.
        robot: the machine.
        duration, motion_seed, period: as `named_motion`, None where not given.
        adept: arguments of `adept_motion`, None where not given.

    Raises:
        InputError: options of another motion, or limits of the robot not kept.
        UnreachableError: a sample that the mechanism cannot take.
    """
    refuse_ignored(name, {'duration': duration, 'motion_seed': motion_seed, 'period': period,
                          **adept})
    period = PERIOD if period is None else period
    given: dict[str, Any] = {key: value for key, value in adept.items() if value is not None}
    if name != 'adept':
        return named_motion(name, robot, duration, motion_seed or 0, period)
    if given.get('round_trip') == 0.0:
        given['round_trip'] = None
    played = adept_motion(robot, period=period, **given)
    check_limits(played, robot)
    return played


def cycles_asked(name: str, robot: Robot, duration: float | None = None,
                 period: float | None = None, cycles: int | None = None) -> int:
    """Return how often the motion of `motion_asked` repeats itself; a motion.yaml does not."""
    if name == 'circle':
        return TURNS if duration is None else repeats_within(
            name, robot, duration, PERIOD if period is None else period)
    return cycles or 1
