"""How a path between two rests is run through: the speed along it, as it is found or smoothed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from toppra import SplineInterpolator

LONGEST = 100.0
"""Seconds between two rests beyond which nothing is looked for, unless the motion takes longer."""


class Way(Protocol):
    """A path between two rests and its timing."""

    @property
    def path(self) -> SplineInterpolator:
        """The path of the joints over s, rad."""

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""

    def over_time(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s, sd, sdd (n,) at times t (n,), at rest before 0 and after the duration."""


def joints_over_time(way: Way, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q, qd, qdd (n, 4) at times t (n,), s."""
    s, sd, sdd = (part[:, None] for part in way.over_time(t))
    q, slope, bend = (way.path(s[:, 0], order) for order in range(3))
    return q, slope * sd, bend * sd ** 2 + slope * sdd


@dataclass(frozen=True)
class Profile:
    """Speed along a path whose acceleration is constant between the points of a grid.

    Attributes:
        path: of the joints over s, rad.
        s: grid, (n,).
        sd: speed, 1/s, (n,).
        torque: of the joints where each interval begins, all of the model, (n - 1, 4) N m.
    """

    path: SplineInterpolator
    s: np.ndarray
    sd: np.ndarray
    torque: np.ndarray

    @cached_property
    def _times(self) -> np.ndarray:
        """Time at which each point of the grid is passed, s."""
        steps = 2.0 * np.diff(self.s) / (self.sd[1:] + self.sd[:-1])
        return np.concatenate(([0.0], np.cumsum(steps)))

    @cached_property
    def _sdd(self) -> np.ndarray:
        return np.diff(self.sd ** 2) / (2.0 * np.diff(self.s))

    @cached_property
    def _sums(self) -> np.ndarray:
        """Integral of s over time up to each point of the grid."""
        dt = np.diff(self._times)
        parts = dt * (self.s[:-1] + dt * (self.sd[:-1] / 2.0 + dt * self._sdd / 6.0))
        return np.concatenate(([0.0], np.cumsum(parts)))

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""
        return float(self._times[-1])

    def over_time(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s, sd, sdd (n,) at times t (n,), at rest before 0 and after the duration."""
        row, after = self._interval(t)
        sdd = self._sdd[row]
        s = np.clip(self.s[row] + after * (self.sd[row] + 0.5 * sdd * after), 0.0, 1.0)
        moving = (t >= 0.0) & (t <= self.duration)
        return (s, np.where(moving, np.maximum(self.sd[row] + sdd * after, 0.0), 0.0),
                np.where(moving, sdd, 0.0))

    def integral(self, t: np.ndarray) -> np.ndarray:
        """Return the integral of s over time from 0 to times t (n,); s is 0 before and 1 after."""
        row, after = self._interval(t)
        within = self._sums[row] + after * (
            self.s[row] + after * (self.sd[row] / 2.0 + after * self._sdd[row] / 6.0))
        return within + np.maximum(t - self.duration, 0.0)

    def _interval(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the interval of each time and the seconds since its beginning."""
        held = np.clip(t, 0.0, self.duration)
        row = np.clip(np.searchsorted(self._times, held, side='right') - 1, 0, len(self._sdd) - 1)
        return row, held - self._times[row]


@dataclass(frozen=True)
class Averaged:
    """A profile whose s is averaged over a window of time, and done at another pace.

    The average of s over the last `window` seconds follows the same path; where sdd jumped it now
    takes the window's time, so that the jerk is limited.

    Attributes:
        profile: as it was found.
        window: s, on the clock of the profile.
        pace: at which it is done.
    """

    profile: Profile
    window: float
    pace: float

    @property
    def path(self) -> SplineInterpolator:
        """Joints over s, rad."""
        return self.profile.path

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""
        return (self.profile.duration + self.window) / self.pace

    def over_time(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return s, sd, sdd (n,) at times t (n,), at rest before 0 and after the duration."""
        now = self.pace * np.asarray(t, dtype=float)
        before = now - self.window
        (s_0, sd_0, _), (s_1, sd_1, _) = self.profile.over_time(before), self.profile.over_time(now)
        s = (self.profile.integral(now) - self.profile.integral(before)) / self.window
        return (np.clip(s, 0.0, 1.0), self.pace * (s_1 - s_0) / self.window,
                self.pace ** 2 * (sd_1 - sd_0) / self.window)

    def jerk(self, t: np.ndarray) -> np.ndarray:
        """Return the jerk of the joints (n, 4), rad/s3, at times t (n,)."""
        now = self.pace * np.asarray(t, dtype=float)
        s, sd, sdd = (part[:, None] for part in self.over_time(t))
        rise = self.profile.over_time(now)[2] - self.profile.over_time(now - self.window)[2]
        sddd = (self.pace ** 3 * rise / self.window)[:, None]
        slope, bend, twist = (self.path.cspl(s[:, 0], order) for order in (1, 2, 3))
        return slope * sddd + 3.0 * bend * sd * sdd + twist * sd ** 3
