"""Positions on an even grid, cut at long gaps and where they jump."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from par4_identification.logs.accounts import SHORTEST_SEGMENT
from par4_identification.logs.jumps import joints_of_recordings
from par4_identification.logs.series import FILLED, Series

EVEN = 1e-3
"""Largest deviation from an even grid, in periods, at which samples are taken as they are."""


@dataclass(frozen=True)
class Grid:
    """Segments of (time (n,) ns, q (n, J)) every `period` ns, and what making them took.

    `jumps` are the times, ns, at which several positions jump, so that the log is cut.
    """

    pieces: list[tuple[np.ndarray, np.ndarray]]
    period: float
    resampled: bool
    filled: int
    short: int
    jumps: tuple[float, ...] = ()


def grid_of(position: Series) -> Grid:
    """Return the positions on an even grid, cut at long gaps and where several of them jump.

    The period is the slope of a line through all stamps: with jitter, the median spacing is off by
    its chance. Evenly stamped samples stand as they are, with holes filled; otherwise a new grid
    starts at each segment's first sample.
    """
    stamp, values = position.stamp.astype(float), position.values
    missing = np.round(np.diff(stamp) / position.period) - 1
    gaps = np.flatnonzero(missing > FILLED) + 1
    jumps = [start + row for start, end in pairwise([0, *gaps, len(stamp)])
             for row in joints_of_recordings(values[start:end], np.diff(stamp[start:end])
                                             / position.period)]
    cuts = np.union1d(gaps, np.array(jumps, dtype=int))
    parts = [part for part in np.split(np.arange(len(stamp)), cuts)
             if len(part) >= SHORTEST_SEGMENT]
    short = len(stamp) - sum(map(len, parts))
    times = tuple(stamp[jumps].tolist())
    if not parts:
        return Grid([], position.period, False, 0, short, times)

    # Number of each sample on the grid.
    numbers = [np.r_[0, np.cumsum(missing[part[:-1]] + 1)] for part in parts]
    centred = [(number - number.mean(), stamp[part] - stamp[part].mean())
               for number, part in zip(numbers, parts, strict=True)]
    period = float(sum(number @ time for number, time in centred)
                   / sum(number @ number for number, _ in centred))
    uneven = any((np.abs(time - period * number) > EVEN * period).any()
                 for number, time in centred)
    pieces, filled = [], 0
    for number, part in zip(numbers, parts, strict=True):
        filled += int(missing[part[:-1]].clip(0).sum())
        if uneven:
            steps = np.arange(np.floor((stamp[part[-1]] - stamp[part[0]]) / period + EVEN) + 1)
            time = stamp[part[0]] + period * steps
        else:
            time = (stamp[part] - period * number).mean() + period * np.arange(number[-1] + 1)
        if not uneven and len(time) == len(part):
            q = values[part[0]:part[-1] + 1]
        else:
            from scipy.interpolate import CubicSpline  # slow to load, and not always needed
            q = CubicSpline(stamp[part] / period, values[part])(time / period)
            if not uneven:
                q[number.astype(int)] = values[part]
        pieces.append((time, q))
    return Grid(pieces, period, uneven, filled, short, times)
