"""A motion: evenly spaced samples of the four joints, with the platform motion behind it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.acceleration import joint_motion, platform_motion
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import POSE_NAMES, Geometry
from par4_kinematics.limits import asked_breach, first_of, joint_breach, platform_breach
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import SCurve, require_positive

MAX_SAMPLES = 2_000_000
"""Most samples of one motion: half an hour at 1 kHz, 400 MB."""


@dataclass(frozen=True)
class Motion:
    """A sampled motion of joints and platform; SI units, radians, frame `base`.

    Attributes:
        name: of the motion, for messages.
        t: times from 0, evenly spaced, (n,) s.
        q, qd, qdd: positions, speeds and accelerations of the joints, (n, 4) rad.
        x, xd, xdd: the same of the platform: x, y, z of D in `base`, m, and theta, rad, (n, 4).
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


def sample_times(duration: float, period: float) -> np.ndarray:
    """Return times (n,) from 0, `period` seconds apart, the last at or just after `duration`.

    Raises:
        InputError: a duration or period that is not positive, or more than `MAX_SAMPLES`.
    """
    if not (0 < period < math.inf and 0 < duration < math.inf):
        raise InputError(f'a motion of {duration:g} s every {period:g} s: both must be positive '
                         f'and finite')
    ratio = duration / period  # of numbers such as 1e-212 it is infinite
    if ratio > MAX_SAMPLES - 1:
        raise InputError(f'a motion of {duration:g} s every {period:g} s: {ratio + 1:.7g} samples, '
                         f'at most {MAX_SAMPLES} are possible; make it shorter or the period '
                         f'longer')
    steps = max(1, math.ceil(ratio - 1e-9))
    return np.arange(steps + 1) * period


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
    return Motion(name, np.asarray(t, float), np.asarray(q, float), np.asarray(qd, float),
                  np.asarray(qdd, float), platform.x, platform.xd, platform.xdd)


def waypoints_motion(robot: Robot, poses: Sequence[Sequence[float]], *, speed: float = 1.0,
                     acceleration: float = 10.0, jerk: float = 500.0, theta_speed: float = 3.0,
                     theta_acceleration: float = 30.0, theta_jerk: float = 1500.0,
                     dwell: float = 0.0, blend: float = 0.0, period: float = 1e-3) -> Motion:
    """Return straight jerk-limited moves from pose to pose, at rest in each or past them.

    Args:
        robot: the machine.
        poses: at least two poses (x, y, z, theta), (n, 4) m and rad.
        speed, acceleration, jerk: limits of D, m/s, m/s2, m/s3.
        theta_speed, theta_acceleration, theta_jerk: limits of theta, rad/s, rad/s2, rad/s3.
        dwell: rest in each pose but the first, s.
        blend: how far a move begins before the one before it has ended, from 0, at rest in every
            pose, to 1, by half of the shorter of both; the path then cuts the corner, where speed
            and acceleration add up to at most twice, at right angles sqrt(2) of, their limits.
        period: seconds between samples.

    Raises:
        InputError: poses of another shape or all the same, limits that are not positive, or a
            blend outside 0 to 1 or beside a dwell.
        UnreachableError: a sample that a leg cannot reach.
    """
    widths = {len(pose) for pose in poses}
    if len(poses) < 2 or widths != {len(POSE_NAMES)}:
        raise InputError(f'waypoints: expected at least two poses ({", ".join(POSE_NAMES)}), found '
                         f'{len(poses)} of {" or ".join(map(str, sorted(widths)))} numbers')
    steps = np.diff(np.asarray(poses, dtype=float), axis=0)
    of_d, of_theta = (speed, acceleration, jerk), (theta_speed, theta_acceleration, theta_jerk)
    for limits, what in ((of_d, 'waypoints, D'), (of_theta, 'waypoints, theta')):
        require_positive(dict(zip(('speed', 'acceleration', 'jerk'), limits, strict=True)), what)
    if not 0.0 <= dwell < math.inf:
        raise InputError(f'waypoints: dwell must be 0 s or more, found {dwell}')
    if not 0.0 <= blend <= 1.0 or (blend > 0.0 and dwell > 0.0):
        raise InputError(f'waypoints: blend must be 0 to 1, and 0 beside a dwell, found {blend:g} '
                         f'with a dwell of {dwell:g} s')
    moves, end, before = [], 0.0, 0.0
    for step in steps:
        law = _move_law(step, of_d, of_theta)
        duration = law.duration if law else 0.0
        start = end - 0.5 * blend * min(before, duration)
        moves.append((start, step, law))
        end, before = start + duration + dwell, duration
    t = sample_times(end, period)
    x = np.zeros((3, len(t), 4))
    x[0] = poses[0]
    for start, step, law in moves:
        if law:
            x += np.stack(law.sample(t - start))[..., None] * step
    return motion_of_platform('waypoints', robot.geometry, t, *x)


def _move_law(step: np.ndarray, of_d: Sequence[float], of_theta: Sequence[float]) -> SCurve | None:
    """Return the law from 0 to 1 of a move under the limits of D and of theta; None to stay."""
    distance, angle = float(np.linalg.norm(step[:3])), abs(float(step[3]))
    if distance == 0.0 and angle == 0.0:
        return None
    return SCurve(1.0, *(
        min(along / distance if distance else math.inf, turning / angle if angle else math.inf)
        for along, turning in zip(of_d, of_theta, strict=True)))


def check_limits(motion: Motion, robot: Robot, acceleration: float = math.inf,
                 jerk: float = math.inf) -> None:
    """Refuse a motion that leaves the robot's joint range, joint speed or workspace.

    Args:
        motion: what is asked.
        robot: its limits.
        acceleration, jerk: further limits of the joints that were asked for, rad/s2, rad/s3.

    Raises:
        InputError: names the limit that is broken first, when, where, and how far in the end.
    """
    asked = asked_breach(motion.qdd, motion.period, acceleration, jerk)
    breach = first_of(joint_breach(robot, motion.q, motion.qd), platform_breach(robot, motion.x),
                      asked)
    if breach:
        whose = ' as asked' if breach is asked else f' of robot {robot.name}'
        place = ', '.join(f'{value:.3f}' for value in motion.x[breach.row])
        raise InputError(
            f'motion {motion.name}: {breach.found} is outside {breach.allowed}{whose}, from '
            f'{motion.t[breach.row]:.3f} s on, at the pose ({place}); '
            f'make the motion smaller or slower, or widen the limits')


PLATFORM_COLUMNS = tuple(f'{name}{suffix}' for suffix in ('', 'd', 'dd') for name in POSE_NAMES)
JOINT_COLUMNS = tuple(f'q{suffix}{joint}' for suffix in ('', 'd', 'dd') for joint in range(4))
