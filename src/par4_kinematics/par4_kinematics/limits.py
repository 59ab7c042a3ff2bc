"""The limits of `robot.yaml`, held against motions, reference points and torques.

Joint position, joint speed and the workspace are in the file; `joint_acceleration_limit` follows
from them and only keeps absurd numbers out.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numba
import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.position import forward_kinematics, forward_sample, mid_height_home
from par4_kinematics.robot import PAGE, Robot

TOLERANCE = 1e-6
"""By how much a limit may be exceeded, rad, rad/s, m: rounding, no more."""
OVERSHOOT_ANGLE, OVERSHOOT_PLACE, OVERSHOOT_SPEED = 0.05, 0.005, 0.1
"""By how much a machine may overshoot what its references keep: joint positions and theta, rad; the
place of D, m; the joint speed, as a part of it. Good drives need a tenth of that."""
QUICKEST_RISE = 1e-3
"""Seconds in which no robot of this kind goes from rest to its full joint speed."""


@dataclass(frozen=True)
class Breach:
    """The first sample that breaks a limit.

    Attributes:
        row: of the sample.
        found: the limit's name and the worst value of any sample, with its unit.
        allowed: the range that holds, with its unit.
    """

    row: int
    found: str
    allowed: str


def limits_not_given(robot: Robot) -> tuple[str, ...]:
    """Return a line on the limits that the robot's file leaves to their defaults; none if none.

    Whoever holds a motion or a torque against them tells it: the defaults are limits of the
    reference robot.
    """
    limits, space = robot.limits, robot.limits.workspace
    missing = [f'{above}{name} {_in_yaml(getattr(part, name))}' for above, part, names in (
        ('drives.', robot.drives, ('torque_limit',)),
        ('limits.', limits, ('joint_position', 'joint_speed')),
        ('limits.workspace.', space, ('radius', 'z', 'theta')))
        for name in names if name not in part.model_fields_set]
    if not missing:
        return ()
    return (f'limits that the file of robot {robot.name} leaves out are those of the reference '
            f'robot: {", ".join(missing)}; write your own into it, see {PAGE}',)


def _in_yaml(value: float | tuple[float, ...]) -> str:
    return (f'[{", ".join(f"{part:g}" for part in value)}]' if isinstance(value, tuple) else
            f'{value:.4g}')


def joint_acceleration_limit(robot: Robot) -> float:
    """Return the acceleration that no reference needs, rad/s2: full speed within a millisecond."""
    return robot.limits.joint_speed / QUICKEST_RISE


def joint_breach(robot: Robot, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray | None = None
                 ) -> Breach | None:
    """Return where joint samples (n, 4) first break a limit of the joints, None if nowhere."""
    limits = robot.limits
    fastest = joint_acceleration_limit(robot)
    checks = [('joint position', q, *limits.joint_position, 'rad'),
              ('joint speed', qd, -limits.joint_speed, limits.joint_speed, 'rad/s')]
    if qdd is not None:
        checks.append(('joint acceleration', qdd, -fastest, fastest, 'rad/s2'))
    return _first(checks)


def platform_breach(robot: Robot, x: np.ndarray) -> Breach | None:
    """Return where poses (n, 4) first leave the robot's workspace, None if nowhere."""
    space = robot.limits.workspace
    return _first((
        ('radius of D', np.hypot(x[:, 0], x[:, 1]), 0.0, space.radius, 'm'),
        ('z of D', x[:, 2], *space.z, 'm'),
        ('theta', x[:, 3], -space.theta, space.theta, 'rad')))


class EndSwitches:
    """What stops a machine that is beyond the limits of its robot, whatever it was told.

    References keep the limits; a machine may leave them where its drives have no more torque, or
    where they are told a feedforward torque that the motion does not need.

    Args:
        robot: whose limits hold, with some room for overshoot.
    """

    def __init__(self, robot: Robot) -> None:
        limits, space = robot.limits, robot.limits.workspace
        speed = (1.0 + OVERSHOOT_SPEED) * limits.joint_speed
        low, high = limits.joint_position
        self._robot = robot
        self._low = np.repeat((low - OVERSHOOT_ANGLE, -speed, -np.inf,
                               space.z[0] - OVERSHOOT_PLACE, -space.theta - OVERSHOOT_ANGLE),
                              (4, 4, 1, 1, 1))
        self._high = np.repeat((high + OVERSHOOT_ANGLE, speed, space.radius + OVERSHOOT_PLACE,
                                space.z[1] + OVERSHOOT_PLACE, space.theta + OVERSHOOT_ANGLE),
                               (4, 4, 1, 1, 1))

    def breach(self, q: np.ndarray, qd: np.ndarray, x: np.ndarray) -> Breach | None:
        """Return which limit joints (4,) or a pose (4,) of the machine are beyond, if any."""
        values = np.concatenate((q, qd, (math.hypot(x[0], x[1]), x[2], x[3])))
        if ((values >= self._low) & (values <= self._high)).all():
            return None
        # what is no number is beyond every limit
        return joint_breach(self._robot, q[None], qd[None]) or platform_breach(
            self._robot, x[None]) or Breach(0, 'a reading that is no number', 'all limits')


def first_breach(robot: Robot, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray | None = None
                 ) -> Breach | None:
    """Return where joint samples (n, 4) break a limit of the joints or, if none, the workspace.

    Raises:
        UnreachableError: joint positions within their range with which the mechanism does not
            close.
    """
    # of one row or one column numba would compile once more: these are always of one kind
    q, qd, qdd = (np.ascontiguousarray(part) for part in (
        q, qd, np.zeros_like(q) if qdd is None else qdd))
    if _within(robot.geometry.packed, _bounds(robot), mid_height_home(robot.geometry), q, qd, qdd):
        return None
    return joint_breach(robot, q, qd, qdd) or platform_breach(
        robot, forward_kinematics(robot.geometry, q))


def asked_breach(qdd: np.ndarray, period: float, acceleration: float, jerk: float
                 ) -> Breach | None:
    """Return where joint samples (n, 4) first exceed what is asked of a motion, None if nowhere.

    Args:
        qdd: every `period` seconds, rad/s2; the jerk is its change from one to the next.
        period: s.
        acceleration, jerk: of every joint, rad/s2, rad/s3.
    """
    rates = np.diff(qdd, axis=0, append=qdd[-1:]) / period
    return _first([('joint acceleration', qdd, -acceleration, acceleration, 'rad/s2'),
                   ('joint jerk', rates, -jerk, jerk, 'rad/s3')])


def first_of(*breaches: Breach | None) -> Breach | None:
    """Return the breach of the earliest sample, the first named of equals; None without any."""
    return min((breach for breach in breaches if breach), key=lambda breach: breach.row,
               default=None)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _within(packed, bounds, home, q, qd, qdd):
    """Return whether points (n, 4) keep the bounds (8,) of joints and workspace, to the letter."""
    low, high, speed, acceleration, radius, bottom, top, theta = bounds
    for row in range(q.shape[0]):
        for joint in range(4):
            if not (low <= q[row, joint] <= high and abs(qd[row, joint]) <= speed
                    and abs(qdd[row, joint]) <= acceleration):
                return False
    cosines, sines = np.cos(q), np.sin(q)
    x = np.empty_like(q)
    for row in range(q.shape[0]):
        x[row] = home if row == 0 else x[row - 1]
        if forward_sample(packed, cosines, sines, row, x) < 0:
            return False
        if not (math.hypot(x[row, 0], x[row, 1]) <= radius and bottom <= x[row, 2] <= top
                and abs(x[row, 3]) <= theta):
            return False
    return True


def _bounds(robot: Robot) -> np.ndarray:
    limits, space = robot.limits, robot.limits.workspace
    return np.array((*limits.joint_position, limits.joint_speed, joint_acceleration_limit(robot),
                     space.radius, *space.z, space.theta))


def check_points(robot: Robot, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> None:
    """Refuse reference points (n, 4) beyond the limits of the joints or the workspace.

    Raises:
        InputError: names the limit that is broken first, by which point and how far in the end.
        UnreachableError: joint positions within their range with which the mechanism does not
            close.
    """
    breach = first_breach(robot, q, qd, qdd)
    if breach:
        raise InputError(
            f'point {breach.row}: {breach.found} is outside {breach.allowed} of robot '
            f'{robot.name}; send a reference within its limits')


def check_torque(robot: Robot, tau: np.ndarray, limit: float) -> None:
    """Refuse torques (n, 4), N m, above the limit of the drives or not finite.

    Raises:
        InputError: names the first point and joint, and the largest torque of all.
    """
    with np.errstate(invalid='ignore'):
        beyond = ~(np.abs(tau) <= limit + TOLERANCE)
    if beyond.any():
        row, joint = np.argwhere(beyond)[0]
        largest = np.abs(tau).max()
        found = f'{largest:.4g} N m' if np.isfinite(largest) else 'no finite torque'
        raise InputError(
            f'point {row}: torque of {robot.joint_names[joint]} is beyond the limit of {limit:g} '
            f'N m of robot {robot.name} ({found} at the worst); send a slower reference')


def _first(checks: Iterable[tuple[str, np.ndarray, float, float, str]]) -> Breach | None:
    breaches = []
    for name, values, lowest, highest, unit in checks:
        outside = np.maximum(values - highest, lowest - values).reshape(len(values), -1)
        first = np.flatnonzero((outside > TOLERANCE).any(axis=1))
        if len(first):
            worst = values.reshape(outside.shape)[np.unravel_index(np.argmax(outside),
                                                                   outside.shape)]
            breaches.append(Breach(int(first[0]), f'{name} {worst:.4g} {unit}',
                                   f'{lowest:g} to {highest:g} {unit}'))
    return first_of(*breaches)
