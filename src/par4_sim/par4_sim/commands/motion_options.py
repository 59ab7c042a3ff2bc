"""The options with which a command takes its motion."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion, check_limits
from par4_kinematics.motion_file import named_motion
from par4_kinematics.robot import Robot

_OPTIONS = (
    click.option('--duration', default=None, type=click.FloatRange(min=0.1),
                 help='seconds, of excitation or circle'),
    click.option('--motion-seed', default=0, show_default=True, type=int,
                 help='seed of the excitation'),
    click.option('--cycles', default=None, type=click.IntRange(min=1),
                 help='adept: round trips  [default: 1]'),
    click.option('--speed', default=None, type=float, help='adept: limit, m/s  [default: 5]'),
    click.option('--acceleration', default=None, type=float,
                 help='adept: limit, m/s2  [default: 150]'),
    click.option('--jerk', default=None, type=float,
                 help='adept: limit, m/s3  [default: none, trapezoids of speed]'),
    click.option('--round-trip', default=None, type=click.FloatRange(min=0.0),
                 help='adept: seconds, 0 for corners without blend  [default: 0.25]'),
    click.option('--theta-swing', default=None, type=float,
                 help='adept: range of theta, rad  [default: 0]'))


def motion_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of its motion."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def motion_asked(name: str, robot: Robot, duration: float | None, motion_seed: int,
                 **adept: float | None) -> Motion:
    """Return the motion that a command was asked for, within the robot's limits.

    Args:
        name: adept, excitation, circle or the path of a motion.yaml.
        robot: the machine.
        duration, motion_seed: as `named_motion`.
        adept: arguments of `adept_motion`, None where not given.

    Raises:
        InputError: options of another motion, or limits of the robot not kept.
        UnreachableError: a sample that the mechanism cannot take.
    """
    given: dict[str, Any] = {key: value for key, value in adept.items() if value is not None}
    if not given:
        return named_motion(name, robot, duration, motion_seed)
    if name != 'adept' or duration is not None:
        options = ', '.join(f'--{key.replace("_", "-")}' for key in given)
        raise InputError(f'{options}: for the motion adept without --duration, found motion '
                         f'{name}; leave them away or write a motion.yaml')
    if given.get('round_trip') == 0.0:
        given['round_trip'] = None
    played = adept_motion(robot, **given)
    check_limits(played, robot)
    return played
