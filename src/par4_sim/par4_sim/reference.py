"""The drive's queue of reference points, followed by time."""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.geometry import LEGS

MATCH = 1e-4
"""Effort belongs to the reference point within this time, s."""
COLUMNS = 16
"""q, qd, qdd, feedforward torque of four joints; the torque is NaN until it arrives."""
TARGET = 20
"""What a drive follows at one time: q_ref, qd_ref, feedforward torque and qdd_ref of four joints at
that time, and the feedforward torque at the time at which the command acts."""
NO_TORQUE = math.inf
"""In place of the torque of a point for which none will come."""


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
    for joint in range(4):
        p0, p1 = points[before, joint], points[after, joint]
        v0, v1 = points[before, 4 + joint] * span, points[after, 4 + joint] * span
        a0, a1 = points[before, 8 + joint] * span ** 2, points[after, 8 + joint] * span ** 2
        # p(u) = p0 + v0 u + a0 u^2/2 + u^3 (c3 + c4 u + c5 u^2)
        gap = p1 - p0 - v0 - 0.5 * a0
        slope = v1 - v0 - a0
        bend = a1 - a0
        c3 = 10.0 * gap - 4.0 * slope + 0.5 * bend
        c4 = -15.0 * gap + 7.0 * slope - bend
        c5 = 6.0 * gap - 3.0 * slope + 0.5 * bend
        target[joint] = p0 + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))))
        target[4 + joint] = (v0 + u * (a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / span
        target[12 + joint] = (a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / span ** 2


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


def _slots(times: np.ndarray) -> np.ndarray:
    """Return times (n,), s, in whole units of MATCH."""
    return np.rint(np.asarray(times) / MATCH).astype(np.int64)


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

    Attributes:
        late_points: points dropped because their time had passed.
        missing_effort: points used without a feedforward torque.
    """

    def __init__(self, q: np.ndarray) -> None:
        """Hold at joint positions q (4,) from time 0."""
        self.late_points = 0
        self.missing_effort = 0
        self.restart(q)

    def restart(self, q: np.ndarray) -> None:
        """Forget every queued point and hold at q (4,) from time 0; the counts stay."""
        self.times = np.zeros(1)
        self.points = _standing(q)
        # torques that no point has taken yet, by time in units of MATCH, ascending
        self._slots = np.empty(0, dtype=np.int64)
        self._efforts = np.empty((0, LEGS))
        self._used = 1

    def queue(self, now: float, times: np.ndarray, q: np.ndarray, qd: np.ndarray,
              qdd: np.ndarray) -> None:
        """Replace every point from times[0] on by the points (n, 4) at `times` (n,), s.

        Points before `now` are dropped and counted. A resting drive leaves its place smoothly
        from `now` to the first point.
        """
        late = int(np.searchsorted(times, now))
        self.late_points += late
        if late == len(times):
            return
        if late > 0:
            times, q, qd, qdd = times[late:], q[late:], qd[late:], qdd[late:]
        added = np.full((len(times), COLUMNS), np.nan)
        added[:, :4], added[:, 4:8], added[:, 8:12] = q, qd, qdd
        keep = int(np.searchsorted(self.times, times[0] - 1e-9))
        kept_times, kept = self.times[:keep], self.points[:keep]
        self._used = min(self._used, keep)
        if keep == 0 or kept_times[-1] < now:
            hold = _standing(self.points[max(keep - 1, 0), :4])
            if times[0] > now:
                kept_times, kept = np.array([now]), hold
                self._used = 1
            else:
                kept_times, kept = np.empty(0), np.empty((0, COLUMNS))
                self._used = 0
        self.times = np.concatenate((kept_times, times))
        self.points = np.concatenate((kept, added))
        self._match()

    def queue_effort(self, times: np.ndarray, tau: np.ndarray) -> None:
        """Fill the torque tau (n, 4), N m, of the points at `times` (n,), now or when they come."""
        # reversed, so that the newest of one time is the one that `unique` keeps
        slots = np.concatenate((_slots(times)[::-1], self._slots))
        self._slots, newest = np.unique(slots, return_index=True)
        self._efforts = np.concatenate((np.asarray(tau)[::-1], self._efforts))[newest]
        self._match()

    def _match(self) -> None:
        """Give the torques that wait to points without; each serves one point, the exact first."""
        for shift in (0, -1, 1):
            if len(self._slots) == 0:
                return
            rows = np.flatnonzero(np.isnan(self.points[:, 12]))
            wanted = _slots(self.times[rows]) + shift
            place = np.minimum(np.searchsorted(self._slots, wanted), len(self._slots) - 1)
            fits = self._slots[place] == wanted
            taken, first = np.unique(place[fits], return_index=True)
            self.points[rows[fits][first], 12:] = self._efforts[taken]
            self._slots = np.delete(self._slots, taken)
            self._efforts = np.delete(self._efforts, taken, axis=0)

    def use_until(self, now: float) -> None:
        """Count the points passed by `now` without torque and forget what lies behind."""
        passed, missing = _pass(self.times, self.points, self._used, now + 1e-9)
        self.missing_effort += missing
        self._used = passed
        if passed > 2000:
            # one point more than the current segment needs: rounding may put now just before it
            self.times, self.points = self.times[passed - 2:], self.points[passed - 2:]
            self._used = 2
            recent = self._slots > round((now - 1.0) / MATCH)
            self._slots, self._efforts = self._slots[recent], self._efforts[recent]

    def uncovered(self, until: float) -> bool:
        """Return whether a point that will be used by `until` still lacks its torque."""
        stop = int(np.searchsorted(self.times, until)) + 1
        return bool(np.isnan(self.points[self._used:stop, 12]).any())

    @property
    def end(self) -> float:
        """Time of the last queued point, s."""
        return float(self.times[-1])
