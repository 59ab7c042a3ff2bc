"""Single readings that jump: a slip jumps and stays, a spike jumps and comes back."""

from __future__ import annotations

import numpy as np
import scipy

from par4_identification.logs.jumps import (
    AROUND,
    BEYOND,
    COUNTS,
    SMALLEST,
    WIDEST,
    jumps_of,
    resolution,
)
from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches

OFTEN = 0.01
"""Share of samples from which deviations are no spikes but noise."""
PART_OF_RANGE = 0.45
"""Least spike of a torque, of its largest usual size; drives that answer single encoder counts
give pulses of a tenth, loads that rattle of a third."""
RARE = 4.0
"""Ratio of a torque's spike to what two samples in a thousand exceed: gaps and springs ring."""
AGREE = 0.3
"""Most by which the neighbours of a spike may differ, of its size."""


def slips(log: Log) -> list[tuple[int, int, float]]:
    """Return row, joint and size, rad, of readings that jump and stay."""
    found = []
    for segment in log.segments:
        q = log.q[segment]
        if len(q) < 4 * AROUND:
            continue
        for joint in range(q.shape[1]):
            off, large = jumps_of(q[:, joint])
            found += [(segment.start + int(row) + 1, joint, float(off[row]))
                      for row in np.flatnonzero(large) if AROUND <= row < len(off) - AROUND]
    return found


def spikes(log: Log, column: str) -> np.ndarray:
    """Return which samples (n, J) of 'q' or 'tau' stand out of their neighbours and come back."""
    values = getattr(log, column)
    found = np.zeros(values.shape, dtype=bool)
    for segment in log.segments:
        part = values[segment]
        if len(part) < 4 * AROUND:
            continue
        for joint in range(part.shape[1]):
            size = np.ascontiguousarray(part[:, joint])
            own = np.abs(size - scipy.ndimage.median_filter(size, 2 * WIDEST + 1, mode='mirror'))
            scatter = max(1.4826 * float(np.median(own)), float(np.quantile(own, 0.99)) / 2.6)
            least = max(BEYOND * scatter, max(SMALLEST, COUNTS * resolution(size))
                        if column == 'q' else
                        max(PART_OF_RANGE * float(np.quantile(np.abs(size), 0.999)),
                            RARE * float(np.quantile(own, 0.998))))
            mask = own > least
            if np.count_nonzero(mask) > OFTEN * len(own):
                continue
            for first, last in stretches(mask):
                # beside a spike the medians are off by what the joint travels in a sample
                high = first + np.flatnonzero(own[first:last] > 0.5 * own[first:last].max())
                start, end = int(high[0]), int(high[-1]) + 1
                # drives answer encoder counts by pulses; a spike has neighbours that agree
                beside = size[max(start - 1, 0)], size[min(end, len(size) - 1)]
                peak = own[start:end].max()
                off = np.abs(size[start:end] - 0.5 * sum(beside)).min()
                if (end - start <= WIDEST and abs(beside[1] - beside[0]) < AGREE * peak
                        and off > 0.5 * peak and _off_the_curve(size, start, end) > 0.5 * peak):
                    found[segment.start + start:segment.start + end, joint] = True
    return found


def _off_the_curve(values: np.ndarray, start: int, end: int) -> float:
    """Return by how much values between two rows are off the cubic through two on either side.

    At a low rate the quick turn of a joint stands out of the median of its neighbours, too, but
    the curve through them goes round with it.
    """
    rows = np.array([start - 2, start - 1, end, end + 1])
    rows = rows[(rows >= 0) & (rows < len(values))]
    curve = np.polynomial.Polynomial.fit(rows, values[rows], len(rows) - 1)
    return float(np.abs(values[start:end] - curve(np.arange(start, end))).min())
