"""The drive's queue of reference points, followed by time."""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.robot import JOINT_NAMES
from par4_sim.drives.reference_curve import COLUMNS, NO_TORQUE, STILL, ReferenceLimits, between
from par4_sim.drives.reference_points import ReferencePoints
from par4_sim.drives.waiting_torque import WaitingTorque

MEMORY = 1.0
"""Seconds for which a torque waits that came after its time."""
SPENT = 2000
"""Passed points that are kept before they are forgotten."""
NEAR = 0.1
"""How far from where it stands a motion of a machine may begin that was put there, rad."""
TARGET = 20
"""What a drive follows at one time: q_ref, qd_ref, feedforward torque and qdd_ref of four joints at
that time, and the feedforward torque at the time at which the command acts."""


@numba.njit(cache=True, error_model='numpy')
def interpolate(times, points, t, lead, target):
    """Write the target (TARGET,) at time t; hold before the first and after the last point.

    Position by the quintic Hermite polynomial through position, velocity and acceleration of the
    neighbours, torque linearly. Where either neighbour lacks its torque it counts as zero: a ramp
    between a torque and none would hide from the drive that it is to hand the torque over.

    Args:
        times, points: of the ReferenceQueue.
        t: s.
        lead: from t to where the command acts, s; half a step where torque is held for a step.
        target: written.
    """
    _torque_at(times, points, t, target[8:12])
    _torque_at(times, points, t + lead, target[16:20])
    known, ahead = False, False
    for joint in range(4):
        known = known or target[8 + joint] != 0.0
        ahead = ahead or target[16 + joint] != 0.0
    if not (known and ahead):
        target[16:20] = target[8:12]
    n = times.shape[0]
    if t < times[0] or t >= times[n - 1] or n == 1:
        row = 0 if t < times[0] else n - 1
        for joint in range(4):
            target[joint] = points[row, joint]
            target[4 + joint] = target[12 + joint] = 0.0
        return
    after = np.searchsorted(times, t, side='right')
    before = after - 1
    span = times[after] - times[before]
    u = (t - times[before]) / span
    state = np.empty(12)
    between(points[before], points[after], span, u, state)
    target[:8] = state[:8]
    target[12:16] = state[8:12]


@numba.njit(cache=True, error_model='numpy')
def _torque_at(times, points, t, torque):
    """Write the feedforward torque (4,) at time t, zero where it is not known."""
    n = times.shape[0]
    if t < times[0] or t >= times[n - 1] or n == 1:
        row = 0 if t < times[0] else n - 1
        told = row == n - 1 or abs(t - times[row]) < 1e-9
        for joint in range(4):
            value = points[row, 12 + joint]
            torque[joint] = value if told and math.isfinite(value) else 0.0
        return
    after = np.searchsorted(times, t, side='right')
    before = after - 1
    u = (t - times[before]) / (times[after] - times[before])
    for joint in range(4):
        value = (1.0 - u) * points[before, 12 + joint] + u * points[after, 12 + joint]
        torque[joint] = value if math.isfinite(value) else 0.0


@numba.njit(cache=True, error_model='numpy')
def _pass(times, points, used, now):
    """Return how many points lie before `now` and how many of those from `used` on lack torque."""
    passed, missing = used, 0
    while passed < times.shape[0] and times[passed] < now:
        missing += points[passed, 12] != points[passed, 12]
        passed += 1
    return passed, missing


def _standing(q: np.ndarray) -> np.ndarray:
    """Return a point (1, COLUMNS) at rest at q (4,), which no torque is meant for."""
    point = np.zeros((1, COLUMNS))
    point[0, :4], point[0, 12:] = q, NO_TORQUE
    return point


class ReferenceQueue:
    """Reference points by time, joined with feedforward torques that come on their own.

    With limits, a reference whose last point moves ends in a ramp to rest (`foresee`), which the
    next points replace; without, the drive holds the last point at once.

    Attributes:
        late_points: points dropped because their time had passed.
        missing_effort: points used without a feedforward torque.
        interrupted: how many times a moving reference was not gone on with and the ramp began.
        starved: whether the ramp of an interrupted reference is being followed, or was the last.
        begun: whether points were queued since the last restart.
    """

    def __init__(self, q: np.ndarray, limits: ReferenceLimits | None = None) -> None:
        """Hold at joint positions q (4,) from time 0; `limits` bound what is followed."""
        self.late_points = 0
        self.missing_effort = 0
        self.interrupted = 0
        self._limits = limits
        self.restart(q)

    def restart(self, q: np.ndarray) -> None:
        """Forget every queued point and hold at q (4,) from time 0; the counts stay."""
        self._follow(ReferencePoints(np.zeros(1), _standing(q)))
        self._waiting = WaitingTorque()
        self._used = 1
        self.begun = False

    def _follow(self, points: ReferencePoints) -> None:
        """Follow these points, without a ramp so far."""
        self._points, self._ramp = points, 0
        self.starved = False

    @property
    def times(self) -> np.ndarray:
        """Of the points, ascending, (n,), s."""
        return self._points.times

    @property
    def points(self) -> np.ndarray:
        """The points (n, COLUMNS)."""
        return self._points.rows

    def check_start(self, now: float, added: ReferencePoints) -> None:
        """Refuse points that do not begin at rest near where the drives hold; late ones count not.

        Raises:
            InputError: names the joint that would move or jump.
        """
        late = int(np.searchsorted(added.times, now))
        if late == len(added):
            return
        first = added.rows[late]
        away = np.abs(first[:4] - self.target(now)[:4])
        for found, bound, words in ((np.abs(first[4:8]), STILL, 'moves at {:.3g} rad/s'),
                                    (away, NEAR, 'is {:.3g} rad from where it stands')):
            joint = int(found.argmax())
            if found[joint] > bound:
                raise InputError(
                    f'not followed: it goes on with a motion from before the restart: at its first '
                    f'point {JOINT_NAMES[joint]} {words.format(found[joint])}; begin at rest where '
                    f'the machine stands')

    def queue(self, now: float, times: np.ndarray, q: np.ndarray, qd: np.ndarray,
              qdd: np.ndarray) -> None:
        """Queue points (n, 4) at `times` (n,), s; see `queue_points`."""
        self.queue_points(now, ReferencePoints.of_motion(times, q, qd, qdd))

    def queue_points(self, now: float, added: ReferencePoints, looked_at: bool = True) -> None:
        """Replace every point from the first of these on by these, which are not to be used again.

        Points before `now` are dropped and counted. From where the reference is at `now` a drive
        that rests or brakes goes to the first point smoothly.

        Raises:
            InputError: the way there breaks a limit, or is a jolt that no points describe; or,
                unless these were `looked_at`, the ways between the points break one. The queue
                stays as it is. The points themselves are not looked at: see
                `ReferenceLimits.check`.
        """
        late = int(np.searchsorted(added.times, now))
        if late == len(added):
            self.late_points += late
            return
        added.forget_before(late)
        times, given = self.times, len(self.times) - self._ramp
        first = added.times[0]
        keep = int(np.searchsorted(times[:given], first - 1e-9))
        here = None
        if keep == 0 or times[keep - 1] < now:
            here = self._state(now)
        if self._limits is not None:
            if not looked_at:
                self._limits.check_way(added.times, added.rows)
            if here is None:
                self._limits.check_join(times[keep - 1], self.points[keep - 1], first,
                                        added.rows[0], late > 0)
            else:
                self._limits.check_join(now, here[0], first, added.rows[0], unasked=True)
        self.late_points += late
        self.begun = True
        self._waiting.serve(added.times, added.rows)
        if here is None:
            self._used = min(self._used, keep)
            self._points.forget_from(keep)
            added = self._points.followed_by(added)
        elif first > now:
            self._used = 1
            added = ReferencePoints(np.array([now]), here).followed_by(added)
        else:
            self._used = 0
        self._follow(added)

    def brake(self, now: float, q: np.ndarray, qd: np.ndarray) -> None:
        """Forget every queued point and come to rest from q, qd (4,) at time `now`."""
        self.restart(q)
        point = _standing(q)
        point[0, 4:8] = qd
        self._follow(ReferencePoints(np.array([now]), point))
        self.foresee(now)

    def end_here(self, now: float) -> None:
        """Forget every point after `now`, as if none had come: what moves there ends in a ramp."""
        self._follow(ReferencePoints(np.array([now]), self._state(now)))
        self._used = 1
        self.foresee(now)

    def foresee(self, until: float) -> None:
        """Be ready to be followed up to the time `until`, s: with a ramp where points end in time.
        """
        if self._limits is None or self._ramp or until < self.times[-1]:
            return
        times, ramp = self._limits.ramp(self.times[-1], self.points[-1])
        if len(ramp):
            self._points.append(times, ramp)
            self._ramp = len(ramp)

    def _state(self, now: float) -> np.ndarray:
        """Return the point (1, COLUMNS) at which the reference is at time `now`."""
        target = self.target(now)
        point = np.full((1, COLUMNS), NO_TORQUE)
        point[0, :8], point[0, 8:12] = target[:8], target[12:16]
        if target[8:12].any():
            point[0, 12:] = target[8:12]
        return point

    def target(self, now: float) -> np.ndarray:
        """Return what the drives follow at time `now`, (TARGET,)."""
        target = np.empty(TARGET)
        interpolate(self.times, self.points, now, 0.0, target)
        return target

    def queue_effort(self, times: np.ndarray, tau: np.ndarray) -> None:
        """Fill the torque tau (n, 4), N m, of the points at `times` (n,), now or when they come."""
        self._waiting.add(times, tau, self.times, self.points)

    @property
    def waiting(self) -> int:
        """How many torques no point has taken yet."""
        return len(self._waiting)

    def use_until(self, now: float) -> None:
        """Count the points passed by `now` without torque and forget what lies behind."""
        passed, missing = _pass(self.times, self.points, self._used, now + 1e-9)
        self.missing_effort += missing
        self._used = passed
        if self._ramp and not self.starved and now > self.times[-1 - self._ramp] + 1e-9:
            self.starved = True
            self.interrupted += 1
        self._waiting.forget_before(now - MEMORY)
        if passed > SPENT:
            # one point more than the current segment needs: rounding may put now just before it
            self._points.forget_before(passed - 2)
            self._used = 2

    def uncovered(self, until: float) -> bool:
        """Return whether a point that will be used by `until` still lacks its torque."""
        stop = int(np.searchsorted(self.times, until)) + 1
        return bool(np.isnan(self.points[self._used:stop, 12]).any())

    @property
    def end(self) -> float:
        """Time of the last queued point, s."""
        return float(self.times[-1])
