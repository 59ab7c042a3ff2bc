"""The curve through reference points: quintic Hermite, its limits, and the ramp that ends it."""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.limits import check_points, first_breach
from par4_kinematics.robot import Robot

COLUMNS = 16
"""q, qd, qdd, feedforward torque of four joints; the torque is NaN until it arrives."""
NO_TORQUE = math.inf
"""In place of the torque of a point for which none will come."""
LOOKS = 8
"""Parts of a segment between which its curve is held against the limits of the joints."""
CLOSE_LOOKS = 64
"""Parts of a segment that may leave the limits, between which it is held against all of them."""
LONG_WAY = 0.02
"""Travel of a joint between two points, by position or speed, rad, beyond which the platform is
looked at between them."""
ASIDE = 2e-3
"""How far the curve of a joint may go beyond both its points, rad, before the platform is looked at
there."""
SHORTEST = 1e-3
"""Seconds that a join of two curves takes at least, whatever their times say."""
STILL = 1e-3
"""Joint speed below which a reference rests, rad/s."""
EASING, QUICKEST = 0.01, 2e-3
"""Seconds in which a ramp takes the acceleration out before it brakes, and where limits are near.
"""
GENTLEST, HARDEST = 0.1, 0.0125
"""Seconds in which a ramp brakes the full joint speed, at the mean."""
JOIN = 0.04
"""Seconds in which a way that no points describe, to the first of new ones, may gain the full joint
speed, at the mean: drives have the torque for it."""
RAMPS = (*((EASING, GENTLEST * 0.5 ** harder) for harder in range(
    round(math.log2(GENTLEST / HARDEST)) + 1)), (QUICKEST, HARDEST))
"""Both times of the ramps that are tried, the gentlest first."""


@numba.njit(cache=True, error_model='numpy')
def between(first, second, span, u, state):
    """Write q, qd, qdd (12,) at the share u of the segment between two points (12 or more,)."""
    for joint in range(4):
        p0, p1 = first[joint], second[joint]
        v0, v1 = first[4 + joint] * span, second[4 + joint] * span
        a0, a1 = first[8 + joint] * span ** 2, second[8 + joint] * span ** 2
        # p(u) = p0 + v0 u + a0 u^2/2 + u^3 (c3 + c4 u + c5 u^2)
        gap = p1 - p0 - v0 - 0.5 * a0
        slope = v1 - v0 - a0
        bend = a1 - a0
        c3 = 10.0 * gap - 4.0 * slope + 0.5 * bend
        c4 = -15.0 * gap + 7.0 * slope - bend
        c5 = 6.0 * gap - 3.0 * slope + 0.5 * bend
        state[joint] = p0 + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))))
        state[4 + joint] = (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / span
        state[8 + joint] = (a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / span ** 2


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _suspect(times, points, row, low, high, speed):
    """Return the first segment from `row` on that is to be looked at closely, or -1.

    Its curve leaves the joints' range or speed, or is so long that the platform may leave its
    workspace on it.
    """
    state = np.empty(12)
    while row < times.shape[0] - 1:
        span = times[row + 1] - times[row]
        for joint in range(4):
            if (abs(points[row + 1, joint] - points[row, joint]) > LONG_WAY
                    or abs(points[row, 4 + joint]) * span > LONG_WAY):
                return row
        for look in range(1, LOOKS):
            between(points[row], points[row + 1], span, look / LOOKS, state)
            for joint in range(4):
                if not (low <= state[joint] <= high and abs(state[4 + joint]) <= speed):
                    return row
                one, other = points[row, joint], points[row + 1, joint]
                if not min(one, other) - ASIDE <= state[joint] <= max(one, other) + ASIDE:
                    return row
        row += 1
    return -1


def _looked_at(times: np.ndarray, points: np.ndarray, row: int) -> np.ndarray:
    """Return q, qd, qdd (CLOSE_LOOKS - 1, 12) on the segment behind point `row`."""
    states = np.empty((CLOSE_LOOKS - 1, 12))
    for look in range(1, CLOSE_LOOKS):
        between(points[row], points[row + 1], times[row + 1] - times[row], look / CLOSE_LOOKS,
                states[look - 1])
    return states


class ReferenceLimits:
    """The limits of a robot, as the drives hold them against what they are to follow.

    Args:
        robot: its limits and, for the workspace, its geometry.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot

    def check(self, times: np.ndarray, points: np.ndarray) -> None:
        """Refuse points (n, 12 or more) at times (n,), s, or a curve through them, beyond limits.

        Raises:
            InputError: names the limit and the point that breaks it.
            UnreachableError: the mechanism does not close at a point.
        """
        check_points(self._robot, points[:, :4], points[:, 4:8], points[:, 8:12])
        self.check_way(times, points)
        self.check_end(points[-1])

    def check_end(self, point: np.ndarray) -> None:
        """Refuse a last point (12 or more,) from which no ramp comes to rest within the limits.

        Nothing more may come: the sender may end, or the link.

        Raises:
            InputError: names the limit beyond which even the hardest ramp ends.
            UnreachableError: the mechanism does not close there.
        """
        if not _moves(point):
            return
        q = _ramp(self._robot.limits.joint_speed, point, *RAMPS[-1])[1][-1:, :4]
        breach = first_breach(self._robot, q, np.zeros_like(q))
        if breach:
            raise InputError(
                f'ends in motion so near to a limit that braking from its last point would reach '
                f'{breach.found}, outside {breach.allowed} of robot {self._robot.name}; send '
                f'points that slow down, or with them those up to rest')

    def check_way(self, times: np.ndarray, points: np.ndarray) -> None:
        """Refuse a curve through points (n, 12 or more) that leaves the limits between them.

        Raises:
            InputError: names the limit that the first such segment breaks.
            UnreachableError: the mechanism does not close on a segment.
        """
        limits = self._robot.limits
        bounds = (*limits.joint_position, limits.joint_speed)
        row = _suspect(times, points, 0, *bounds)
        while row >= 0:
            self._refuse(times, points, row)
            row = _suspect(times, points, row + 1, *bounds)

    def check_join(self, first_time: float, first: np.ndarray, time: float, point: np.ndarray,
                   unasked: bool = False) -> None:
        """Refuse the way from where the reference is (12 or more,) to a new point, as `check_way`.

        Where points came too late, or the reference rests or brakes, nobody has described this
        way: `unasked`, it is refused, too, if it is harder than both the points at its ends and a
        quick start.
        """
        times = np.array((first_time, max(time, first_time + SHORTEST)))
        further = times[1] - time  # looked at there, a short way is as smooth as it is
        q, qd, qdd = point[:4], point[4:8], point[8:12]
        points = np.stack((first[:12], np.concatenate((
            q + further * (qd + 0.5 * further * qdd), qd + further * qdd, qdd))))
        self.check_way(times, points)
        if unasked:
            found = float(np.abs(_looked_at(times, points, 0)[:, 8:]).max())
            # the speed rises as a cubic
            most = max(1.5 * self._robot.limits.joint_speed / JOIN, np.abs(points[:, 8:]).max())
            if found > most:
                raise InputError(
                    f'would jump: the way from where the reference is now to the first point that '
                    f'is left takes {found:.4g} rad/s2 in {times[1] - times[0]:.3g} s, {most:.4g} '
                    f'are allowed; send points earlier, or begin at rest where the machine stands')

    def _refuse(self, times: np.ndarray, points: np.ndarray, row: int) -> None:
        """Refuse the segment behind point `row` if it breaks a limit."""
        states = _looked_at(times, points, row)
        breach = first_breach(self._robot, states[:, :4], states[:, 4:8])
        if breach:
            span = times[row + 1] - times[row]
            raise InputError(
                f'on the way of {span:.4g} s to the next point {breach.found} is outside '
                f'{breach.allowed} of robot {self._robot.name}; send points that go on from where '
                f'the reference is, within its limits')

    def ramp(self, time: float, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return times (k,), s, and points (k, COLUMNS) that bring a moving reference to rest.

        Straight on in joint space, all joints at rest at the same time: gently where there is
        room, in an eighth of the way where the limits are near. No point if it rests.

        Args:
            time: s.
            point: q, qd, qdd where the reference ends, (12 or more,).
        """
        if not _moves(point):
            return np.empty(0), np.empty((0, COLUMNS))
        for easing, pace in RAMPS:
            times, points = _ramp(self._robot.limits.joint_speed, point, easing, pace)
            if self._keeps(times, points):
                break
        return time + times, points

    def _keeps(self, times: np.ndarray, points: np.ndarray) -> bool:
        try:
            self.check(times, points)
        except Par4Error:
            return False
        return True


def _moves(point: np.ndarray) -> bool:
    """Return whether a reference that ends at a point (12 or more,) does not rest there."""
    return bool(np.abs(point[4:8]).max() >= STILL)


def _ramp(fastest: float, point: np.ndarray, easing: float, pace: float
          ) -> tuple[np.ndarray, np.ndarray]:
    """Return times (2,), s from the point on, and points (2, COLUMNS) of a ramp to rest.

    Args:
        fastest: speed of the joints that is allowed, rad/s.
        point: q, qd, qdd from which it goes, (12 or more,).
        easing: in which it takes the acceleration out, s.
        pace: in which it would brake the full speed, s, at the mean.
    """
    q, qd, qdd = point[:4], point[4:8], point[8:12]
    points = np.zeros((2, COLUMNS))
    points[:, 12:] = NO_TORQUE
    speed = np.clip(qd + 0.5 * easing * qdd, -fastest, fastest)
    points[0, :4], points[0, 4:8] = q + easing * (qd + easing * qdd / 3.0), speed
    # the speed falls as a cubic of time, so that the way is half of speed times duration
    duration = max(easing, pace * np.abs(speed).max() / fastest)
    points[1, :4] = points[0, :4] + 0.5 * duration * speed
    return np.array((easing, easing + duration)), points
