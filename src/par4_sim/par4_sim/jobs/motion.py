"""The motion that a command was asked for."""

from __future__ import annotations

from typing import Any

from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion, check_limits
from par4_kinematics.motion_file import named_motion
from par4_kinematics.robot import Robot


def motion_asked(name: str, robot: Robot, duration: float | None, motion_seed: int,
                 period: float = 1e-3, **adept: float | None) -> Motion:
    """Return the motion that a command was asked for, within the robot's limits.

    Args:
        name: adept, excitation, circle or the path of a motion.yaml.
        robot: the machine.
        duration, motion_seed, period: as `named_motion`.
        adept: arguments of `adept_motion`, None where not given.

    Raises:
        InputError: options of another motion, or limits of the robot not kept.
        UnreachableError: a sample that the mechanism cannot take.
    """
    given: dict[str, Any] = {key: value for key, value in adept.items() if value is not None}
    if not given:
        return named_motion(name, robot, duration, motion_seed, period)
    if name != 'adept' or duration is not None:
        options = ', '.join(f'--{key.replace("_", "-")}' for key in given)
        raise InputError(f'{options}: for the motion adept without --duration, found motion '
                         f'{name}; leave them away or write a motion.yaml')
    if given.get('round_trip') == 0.0:
        given['round_trip'] = None
    played = adept_motion(robot, period=period, **given)
    check_limits(played, robot)
    return played
