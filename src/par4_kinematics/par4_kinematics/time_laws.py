"""Scalar time laws s(t) from rest to rest along a path of given length, under limits.

All are point symmetric, s(T - t) = length - s(t), so each describes its first half only; before 0
and after T the law rests. Units follow the length: m, rad or 1.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.errors import InputError

Sample = tuple[np.ndarray, np.ndarray, np.ndarray]
"""s, sd, sdd: position, velocity and acceleration along the path."""


def require_positive(values: Mapping[str, float], what: str) -> None:
    """Refuse values that are not positive and finite; `what` says whose they are.

    Raises:
        InputError: names the first value that is not.
    """
    for name, value in values.items():
        if not (value > 0 and math.isfinite(value)):
            raise InputError(f'{what}: {name} must be positive and finite, found {value}; give '
                             f'it a value above 0')


@dataclass(frozen=True)
class TimeLaw(ABC):
    """A law that covers `length` from rest to rest."""

    length: float

    def __post_init__(self) -> None:
        require_positive(vars(self), type(self).__name__)

    @property
    @abstractmethod
    def duration(self) -> float:
        """Seconds from rest to rest."""

    @abstractmethod
    def _first_half(self, t: np.ndarray) -> Sample:
        """Return s, sd, sdd at 0 <= t <= duration / 2."""

    def sample(self, t: ArrayLike) -> Sample:
        """Return s, sd, sdd, each shaped like the times t in seconds, which may lie outside."""
        t = np.asarray(t, dtype=float)
        duration = self.duration
        late = t > 0.5 * duration
        s, sd, sdd = self._first_half(np.clip(np.where(late, duration - t, t), 0.0, None))
        moving = (t > 0.0) & (t < duration)
        return (np.where(late, self.length - s, s), np.where(moving, sd, 0.0),
                np.where(moving, np.where(late, -sdd, sdd), 0.0))


@dataclass(frozen=True)
class Trapezoid(TimeLaw):
    """Shortest law under a speed and an acceleration limit; a triangle if the path is short."""

    speed: float
    acceleration: float

    @cached_property
    def peak_speed(self) -> float:
        """The speed it reaches."""
        return min(self.speed, math.sqrt(self.length * self.acceleration))

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""
        return self.length / self.peak_speed + self.peak_speed / self.acceleration

    def _first_half(self, t: np.ndarray) -> Sample:
        peak = self.peak_speed
        rise = peak / self.acceleration
        rising = t < rise
        return (np.where(rising, 0.5 * self.acceleration * t ** 2, peak * (t - 0.5 * rise)),
                np.where(rising, self.acceleration * t, peak),
                np.where(rising, self.acceleration, 0.0))


@dataclass(frozen=True)
class SCurve(TimeLaw):
    """Shortest law under speed, acceleration and jerk limits: up to seven phases.

    On a short path, or with a low jerk limit, the phases of constant speed or of constant
    acceleration vanish.
    """

    speed: float
    acceleration: float
    jerk: float

    @cached_property
    def _phases(self) -> tuple[float, float]:
        """Seconds of one jerk phase, and of the whole rise to the peak speed."""
        length, speed, acceleration, jerk = self.length, self.speed, self.acceleration, self.jerk
        ramp = min(acceleration / jerk, math.sqrt(speed / jerk))
        rise = ramp + speed / (jerk * ramp)
        if length >= speed * rise:
            return ramp, rise
        # The peak speed jerk ramp (rise - ramp) stays below the limit; length = peak rise.
        ramp = min(acceleration / jerk, math.cbrt(0.5 * length / jerk))
        return ramp, 0.5 * ramp + math.sqrt(0.25 * ramp ** 2 + length / (jerk * ramp))

    @property
    def peak_speed(self) -> float:
        """The speed it reaches."""
        ramp, rise = self._phases
        return self.jerk * ramp * (rise - ramp)

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""
        return self._phases[1] + self.length / self.peak_speed

    def _first_half(self, t: np.ndarray) -> Sample:
        ramp, rise = self._phases
        jerk, peak = self.jerk, self.peak_speed
        top = jerk * ramp
        ending = np.clip(rise - t, 0.0, None)
        middle = t - ramp
        s = np.select(
            (t < ramp, t < rise - ramp),
            (jerk * t ** 3 / 6.0,
             jerk * ramp ** 3 / 6.0 + 0.5 * top * ramp * middle + 0.5 * top * middle ** 2),
            peak * (t - 0.5 * rise) + jerk * ending ** 3 / 6.0)
        sd = np.select((t < ramp, t < rise - ramp),
                       (0.5 * jerk * t ** 2, top * (t - 0.5 * ramp)),
                       peak - 0.5 * jerk * ending ** 2)
        sdd = np.select((t < ramp, t < rise - ramp), (jerk * t, top), jerk * ending)
        return s, sd, sdd


@dataclass(frozen=True)
class Quintic(TimeLaw):
    """s = length (10 u^3 - 15 u^4 + 6 u^5), u = t / T, in the shortest T under the limits."""

    speed: float
    acceleration: float

    @property
    def duration(self) -> float:
        """Seconds from rest to rest: peaks are 15/8 length / T and 10 / sqrt(3) length / T^2."""
        return max(1.875 * self.length / self.speed,
                   math.sqrt(10.0 / math.sqrt(3.0) * self.length / self.acceleration))

    def _first_half(self, t: np.ndarray) -> Sample:
        duration = self.duration
        u = t / duration
        return (self.length * u ** 3 * (10.0 - 15.0 * u + 6.0 * u ** 2),
                self.length / duration * 30.0 * u ** 2 * (1.0 - u) ** 2,
                self.length / duration ** 2 * 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u))
