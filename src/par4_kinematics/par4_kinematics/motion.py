"""A motion: evenly spaced samples of the four joints, with the platform motion behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.acceleration import joint_motion, platform_motion
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import POSE_NAMES, Geometry
from par4_kinematics.robot import Robot


@dataclass(frozen=True)
class Motion:
    """A sampled motion; SI, radians.

    Attributes:
        name: what it is.
        t: from 0, evenly spaced, (n,).
        q, qd, qdd: joints, (n, 4).
        x, xd, xdd: pose of D and theta, (n, 4).
    """

    name: str
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    x: np.ndarray
    xd: np.ndarray
    xdd: np.ndarray

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.t[-1])

    @property
    def period(self) -> float:
        """Seconds between samples."""
        return float(self.t[1] - self.t[0])


def motion_of_platform(name: str, geometry: Geometry, t: ArrayLike, x: ArrayLike, xd: ArrayLike,
                       xdd: ArrayLike) -> Motion:
    """Return the motion of platform samples (n, 4).

    Raises:
        UnreachableError: a sample that a leg cannot reach.
    """
    joints = joint_motion(geometry, x, xd, xdd)
    return Motion(name, np.asarray(t, float), joints.q, joints.qd, joints.qdd,
                  *(np.asarray(part, float) for part in (x, xd, xdd)))


def motion_of_joints(name: str, geometry: Geometry, t: ArrayLike, q: ArrayLike, qd: ArrayLike,
                     qdd: ArrayLike) -> Motion:
    """Return the motion of joint samples (n, 4).

    Raises:
        UnreachableError: a sample with which the mechanism does not close.
    """
    platform = platform_motion(geometry, q, qd, qdd)
    return Motion(name, np.asarray(t, float), *(np.asarray(part, float) for part in (q, qd, qdd)),
                  platform.x, platform.xd, platform.xdd)


def check_limits(motion: Motion, robot: Robot) -> None:
    """Refuse a motion that leaves the robot's joint range, joint speed or workspace.

    Raises:
        InputError: names sample, quantity, value and limit.
    """
    limits = robot.limits
    space = limits.workspace
    low, high = limits.joint_position
    radius = np.hypot(motion.x[:, 0], motion.x[:, 1])
    checks = (
        ('joint position', motion.q, low, high, 'rad'),
        ('joint speed', motion.qd, -limits.joint_speed, limits.joint_speed, 'rad/s'),
        ('radius of D', radius, 0.0, space.radius, 'm'),
        ('z of D', motion.x[:, 2], space.z[0], space.z[1], 'm'),
        ('theta', motion.x[:, 3], -space.theta, space.theta, 'rad'),
    )
    for name, values, lowest, highest, unit in checks:
        outside = np.maximum(values - highest, lowest - values)
        worst = np.unravel_index(np.argmax(outside), outside.shape)
        if outside[worst] > 1e-6:
            raise InputError(
                f'motion {motion.name}: {name} {values[worst]:.4g} {unit} at '
                f'{motion.t[worst[0]]:.3f} s is outside {lowest:g} to {highest:g} {unit} of robot '
                f'{robot.name}; make the motion smaller or slower, or widen the limits')


PLATFORM_COLUMNS = tuple(f'{name}{suffix}' for suffix in ('', 'd', 'dd') for name in POSE_NAMES)
JOINT_COLUMNS = tuple(f'q{suffix}{joint}' for suffix in ('', 'd', 'dd') for joint in range(4))
