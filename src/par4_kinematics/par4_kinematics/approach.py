"""A move from where the robot stands to where a motion begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_rows
from par4_kinematics.motion import Motion, check_limits, motion_of_joints
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import Quintic

THERE = 1e-3
"""A motion that begins this near, rad, needs no approach."""
SPEED_FRACTION = 0.1
"""Peak joint speed of the approach over the robot's joint_speed."""
RISE_TIME = 0.5
"""Seconds in which the approach would reach its peak speed at its peak acceleration."""


def approach_to(point: np.ndarray, robot: Robot, q: ArrayLike, period: float, name: str) -> Motion:
    """Return a move from rest at q (4,) to rest at a point (4,), rad, sampled every `period` s.

    Raises:
        As `with_approach`, which calls the motion at the point by this name.
    """
    still = np.zeros((2, len(point)))
    rest = motion_of_joints(name, robot.geometry, np.array((0.0, period)), np.tile(point, (2, 1)),
                            still, still)
    return with_approach(rest, robot, q)


def with_approach(motion: Motion, robot: Robot, q: ArrayLike) -> Motion:
    """Return the motion behind a straight quintic move in joint space from rest at q (4,), rad.

    A motion that begins at q is returned as it is.

    Raises:
        UnreachableError: the mechanism does not close on the way.
        InputError: the way leaves the robot's limits, or q is not four finite numbers.
    """
    start = as_rows(q, 'joint positions q')[0][0]
    way = motion.q[0] - start
    length = float(np.abs(way).max())
    if length < THERE:
        return motion
    speed = SPEED_FRACTION * robot.limits.joint_speed
    law = Quintic(length, speed, speed / RISE_TIME)
    steps = int(np.ceil(law.duration / motion.period))
    t = np.arange(steps) * motion.period
    pace = law.duration / (steps * motion.period)  # a little slower, so that it fills the samples
    s, sd, sdd = law.sample(pace * t)
    approach = motion_of_joints(
        f'approach to {motion.name}', robot.geometry, t, start + np.outer(s / length, way),
        np.outer(pace * sd / length, way), np.outer(pace ** 2 * sdd / length, way))
    check_limits(approach, robot)
    return Motion(motion.name, np.concatenate((t, steps * motion.period + motion.t)),
                  *(np.concatenate((getattr(approach, name), getattr(motion, name)))
                    for name in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd')))
