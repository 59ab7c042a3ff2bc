"""Positions on an even grid, cut at long gaps and where they jump."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from par4_identification.logs.accounts import SHORTEST_SEGMENT
from par4_identification.logs.jumps import joints_of_recordings
from par4_identification.logs.stamps import EVEN, numbered
from par4_identification.logs.topic_signal import FILLED, Signal


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


def grid_of(position: Signal) -> Grid:
    """Return the positions on an even grid, cut at long gaps and where several of them jump.

    Evenly stamped samples stand as they are, with holes filled; otherwise a new grid
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

    even = numbered(stamp, parts, position.period)
    uneven, period = even.off > EVEN * even.period, even.period
    pieces, filled = [], 0
    for number, part in zip(even.numbers, parts, strict=True):
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
