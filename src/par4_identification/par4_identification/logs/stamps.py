"""Header stamps in order: spacing, gaps, jitter, the even times beside them, and the nearest."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

SHORTEST_PERIOD = 5e-6
"""s from sample to sample up to which times are likely to count another unit: hardly a logger
records so fast. One that does is read all the same, see `units.HIGHEST_RATE_HZ`."""
GAP = 1.5
"""Spacing in periods above which samples are missing."""
CROWDED = 0.25
"""Spacing in periods below which the later of two samples is dropped: splines would swing."""

EVEN = 1e-3
"""Largest deviation from an even grid, in periods, at which samples are taken as they are."""

CLEAR = 0.25
"""Largest deviation of a spacing from whole periods, in periods, with which it is surely known."""
FIRST, PARTS = 128, 20
"""Stamps that are numbered by the period at which they are most in step, and how many such parts
tell that period."""
NEAR, TRIED = 0.05, 401
"""Part by which that may be off the median spacing, which lost samples make too large, and periods
that are tried."""


@dataclass(frozen=True)
class Spacing:
    """How evenly stamps are spaced.

    Attributes:
        gaps: spacings of more than `GAP` periods.
        longest_gap: s.
        lost: samples that the gaps would have held.
        period: median spacing, s.
        jitter_rms: of the spacing about the period, gaps left out, s.
    """

    gaps: int
    longest_gap: float
    lost: int
    period: float
    jitter_rms: float


def spacing_counts(stamp: np.ndarray, run: np.ndarray | None = None) -> Spacing:
    """Return how evenly stamps are spaced, and what is missing between them.

    Args:
        stamp: (n,) ns, increasing.
        run: (n,); the spacing between samples of different runs means nothing.
    """
    spacing = np.diff(stamp)
    if run is not None:
        spacing = spacing[np.diff(run) == 0]
    if not len(spacing):
        return Spacing(0, 0.0, 0, 0.0, 0.0)
    period = float(np.median(spacing))
    gaps = spacing[spacing > GAP * period]
    others = spacing[spacing <= GAP * period]
    return Spacing(
        gaps=len(gaps), longest_gap=1e-9 * float(gaps.max(initial=0)),
        lost=int(np.sum(np.round(gaps / period) - 1)), period=1e-9 * period,
        jitter_rms=1e-9 * float(np.sqrt(np.mean((others - period) ** 2))))


def nearest_stamp(stamp: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of the stamp, of at least two in order, that is nearest to each time."""
    right = np.searchsorted(stamp, times).clip(1, len(stamp) - 1)
    return right - (times - stamp[right - 1] < stamp[right] - times)


@dataclass(frozen=True)
class Numbered:
    """Stamps as those of an even grid, some of whose samples are missing.

    Attributes:
        numbers: of the samples of each part, from 0 on.
        times: of these numbers, ns, on the line through each part.
        period: slope of all these lines, ns: with jitter, the median spacing is off by its chance.
        off: largest deviation of a stamp from its time, ns.
    """

    numbers: tuple[np.ndarray, ...]
    times: tuple[np.ndarray, ...]
    period: float
    off: float


def by_spacings(stamp: np.ndarray, period: float) -> np.ndarray:
    """Return the numbers (n,) of stamps of one part, from 0 on, by how far each is from the next.
    """
    return np.r_[0.0, np.cumsum(np.round(np.diff(stamp) / period))]


def by_line(stamp: np.ndarray, period: float) -> np.ndarray:
    """Return the numbers (n,) of stamps of one part, from 0 on, that jitter.

    Spacings tell them, unless one may be rounded wrongly because a sample was stamped late and the
    next one early. Then the line through some stamps numbers twice as many, and so on.
    """
    steps, numbers = np.diff(stamp) / period, by_spacings(stamp, period)
    if np.abs(steps - np.round(steps)).max(initial=0.0) < CLEAR:
        return numbers
    time = stamp - stamp[0]
    slope, known = _period(time, period), min(FIRST, len(stamp))
    offset = slope * float(np.angle(np.exp(2j * np.pi * time[:known] / slope).mean())) / 2.0 / np.pi
    return _along_line(time, slope, offset)


def in_a_row(stamp: np.ndarray, period: float) -> np.ndarray:
    """Return the numbers (n,) of stamps of one part, from 0 on, whose spacings say nothing.

    Times in steps of about a period stand still or jump by two, with no sample missing. The usual
    time of many samples tells the period, and a sample is missing where many behind it are late.
    """
    if len(stamp) <= FIRST:
        return by_spacings(stamp, period)
    time = stamp - stamp[0]
    slope = float(np.median(time[FIRST:] - time[:-FIRST])) / FIRST
    return _along_line(time, slope, float(np.median(time[:FIRST] - slope * np.arange(FIRST))))


def numbered(stamp: np.ndarray, parts: Sequence[np.ndarray], period: float,
             numbers_of: Callable[[np.ndarray, float], np.ndarray] = by_spacings) -> Numbered:
    """Return stamps as those of an even grid.

    Args:
        stamp: (n,) ns, increasing.
        parts: rows of each uninterrupted part.
        period: about that of the grid, ns.
        numbers_of: stamps of a part and the period -> their numbers, which tell what is missing.
    """
    numbers = tuple(numbers_of(stamp[part], period) for part in parts)
    centred = [(number - number.mean(), stamp[part] - stamp[part].mean())
               for number, part in zip(numbers, parts, strict=True)]
    slope = float(sum(number @ time for number, time in centred)
                  / sum(number @ number for number, _ in centred))
    times = tuple((stamp[part] - slope * number).mean() + slope * number
                  for number, part in zip(numbers, parts, strict=True))
    return Numbered(numbers, times, slope, max(
        float(np.abs(stamp[part] - time).max()) for part, time in zip(parts, times, strict=True)))


def _along_line(time: np.ndarray, slope: float, offset: float) -> np.ndarray:
    """Return the numbers (n,) of times by a line through the first of them that is bent to more."""
    numbers, known = np.zeros(len(time)), min(FIRST, len(time))
    while True:
        numbers[:known] = _increasing((time[:known] - offset) / slope)
        if known == len(time):
            return numbers - numbers[0]
        slope, offset = np.polyfit(numbers[:known], time[:known], 1)
        known = min(2 * known, len(time))


def _increasing(places: np.ndarray) -> np.ndarray:
    """Return the whole numbers that places (n,) on a line are nearest to, if these increase.

    Else they are nearest to the places together: what is missing before a sample never decreases.
    """
    numbers = np.round(places)
    if np.diff(numbers).min(initial=1.0) >= 1.0:
        return numbers
    from scipy.optimize import isotonic_regression  # slow to load, and not always needed

    row = np.arange(len(places))
    return np.asarray(row + np.round(isotonic_regression(places - row).x))


def _period(time: np.ndarray, period: float) -> float:
    """Return the period near another at which times (n,), a few at a time, are most in step."""
    tried = period * np.linspace(1.0 - NEAR, 1.0 + NEAR, TRIED)
    starts = np.linspace(0, max(len(time) - FIRST, 0), PARTS).astype(int)
    together = sum(np.abs(np.exp(2j * np.pi * (time[start:start + FIRST, None] / tried)).sum(
        axis=0)) ** 2 for start in starts)
    return float(tried[int(np.argmax(together))])
