"""A joint reference whose target changes on the way, limited in speed, acceleration and jerk.

Whenever a target comes, ruckig computes from the position, speed and acceleration that the
reference has then the quickest way to rest at the target under the limits of every joint; all
joints arrive together (Berscheid and Kroeger 2021). Nothing of the future is used, so that the
targets may come from anywhere while the robot moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from ruckig import InputParameter, Result, Ruckig, Trajectory

from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS, POSE_NAMES
from par4_kinematics.motion import Motion, motion_of_joints, sample_times
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import require_positive


class OnlineReference:
    """Where the joints are to be, from rest, as targets come.

    Args:
        robot: its geometry, and its joint speed where none is given.
        start: pose (4,) at which it rests until the first target comes.
        joint_speed: limit, rad/s; None for that of the robot.
        joint_acceleration, joint_jerk: limits, rad/s2, rad/s3.

    Attributes:
        arrival: time at which the last target is reached, s.

    Raises:
        InputError: a limit that is not positive, or a speed above the robot's.
        UnreachableError: a start that a leg cannot reach.
    """

    def __init__(self, robot: Robot, start: ArrayLike, joint_speed: float | None,
                 joint_acceleration: float, joint_jerk: float) -> None:
        fastest = robot.limits.joint_speed
        speed = fastest if joint_speed is None else joint_speed
        require_positive({'joint_speed': speed, 'joint_acceleration': joint_acceleration,
                          'joint_jerk': joint_jerk}, 'online motion')
        if speed > fastest:
            raise InputError(f'online motion: joint_speed {speed:g} rad/s is above the '
                             f'{fastest:g} rad/s of robot {robot.name}; give at most that')
        self._geometry = robot.geometry
        self._planner = Ruckig(LEGS)
        self._asked = InputParameter(LEGS)
        self._asked.max_velocity = [speed] * LEGS
        self._asked.max_acceleration = [joint_acceleration] * LEGS
        self._asked.max_jerk = [joint_jerk] * LEGS
        self._rest = inverse_kinematics(robot.geometry, start).tolist()
        self._begins: list[float] = []
        self._ways: list[Trajectory] = []
        self.arrival = 0.0

    def aim(self, t: float, pose: ArrayLike) -> None:
        """Go to rest at a pose (4,) from time t on, s, not before the last target came.

        Raises:
            InputError: a time before that of the last target.
            UnreachableError: a pose that a leg cannot reach.
        """
        if self._begins and t < self._begins[-1]:
            raise InputError(f'online motion: a target at {t:g} s after one at '
                             f'{self._begins[-1]:g} s; give them in order of time')
        asked, way = self._asked, Trajectory(LEGS)
        asked.target_position = inverse_kinematics(self._geometry, pose).tolist()
        asked.current_position, asked.current_velocity, asked.current_acceleration = self.at(t)
        result = self._planner.calculate(asked, way)
        if result not in (Result.Working, Result.Finished):
            raise InputError(f'online motion: no way to the target of {t:g} s is found '
                             f'({result.name}); raise its limits')
        self._begins.append(t)
        self._ways.append(way)
        self.arrival = t + way.duration

    def at(self, t: float) -> tuple[list[float], list[float], list[float]]:
        """Return q, qd, qdd (4,) at time t, s, by the targets that have come so far."""
        row = int(np.searchsorted(self._begins, t, side='right')) - 1
        if row < 0:
            return self._rest, [0.0] * LEGS, [0.0] * LEGS
        after = t - self._begins[row]
        q, qd, qdd = self._ways[row].at_time(after)
        return (q, qd, qdd) if after < self._ways[row].duration else (q, [0.0] * LEGS,
                                                                      [0.0] * LEGS)


def online_motion(robot: Robot, start: Sequence[float], targets: Sequence[Sequence[float]], *,
                  joint_speed: float | None = None, joint_acceleration: float = 100.0,
                  joint_jerk: float = 5000.0, period: float = 1e-3) -> Motion:
    """Return the motion of a reference whose target changes on the way.

    Args:
        robot: the machine.
        start: pose (x, y, z, theta) at rest, m and rad.
        targets: time at which each comes, s, and its pose, (n, 5), in order of time.
        joint_speed: limit, rad/s; None for that of the robot.
        joint_acceleration, joint_jerk: limits of every joint, rad/s2, rad/s3.
        period: seconds between samples.

    Raises:
        InputError: targets of another shape, not in order of time or none, or bad limits.
        UnreachableError: a pose that a leg cannot reach, or a way on which the legs do not close.
    """
    widths = {len(target) for target in targets}
    if widths != {1 + len(POSE_NAMES)} or len(start) != len(POSE_NAMES):
        raise InputError(f'online motion: expected a start ({", ".join(POSE_NAMES)}) and at least '
                         f'one target (t, {", ".join(POSE_NAMES)}), found {len(start)} numbers and '
                         f'targets of {" or ".join(map(str, sorted(widths))) or "no"} numbers')
    if not 0.0 <= targets[0][0] < math.inf:
        raise InputError(f'online motion: the first target comes at {targets[0][0]:g} s; '
                         f'give a time from 0 on')
    reference = OnlineReference(robot, start, joint_speed, joint_acceleration, joint_jerk)
    for moment, *pose in targets:
        reference.aim(moment, pose)
    if reference.arrival == 0.0:
        raise InputError('online motion: its targets are its start; give one elsewhere')
    t = sample_times(reference.arrival, period)
    q, qd, qdd = np.array([reference.at(instant) for instant in t]).transpose(1, 0, 2)
    return motion_of_joints('online', robot.geometry, t, q, qd, qdd)
