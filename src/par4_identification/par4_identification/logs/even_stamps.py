"""Readings that were taken evenly though their stamps jitter.

A loop of a drive reads its encoders every millisecond; the computer that stamps the message may be
late by a tenth of that, each time by another. At 5 rad/s this moves a reading by half a milliradian
in time, which a model takes for acceleration. The readings tell which of the two is uneven: a
joint moves smoothly, so that each of them lies near the straight line between its neighbours, if
the times are the right ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_identification.logs.neighbours import off_the_line
from par4_identification.logs.stamps import EVEN, by_line, in_a_row, numbered, spacing_counts
from par4_identification.logs.topic_signal import FILLED, Signal

SMOOTHER = 0.5
"""Mean square by which readings are off the line between their neighbours at even times, over that
at their stamps, below which the stamps are wrong."""
FEWEST = 100
"""Readings with a neighbour on either side that can tell."""
LONG, DRIFTS = 50, 0.5
"""Readings over which jitter averages out, and the share of a period by which their mean may be off
the even times: beyond, a reading that is missing was counted wrongly."""
TOGETHER = 0.5
"""Least share of the torques with the stamp of a position from which both were read at once."""
CLIPPED = 0.99
"""Quantile of these squares beyond which one counts no more: a wrong reading is off both lines."""


def evened(position: Signal, torque: Signal) -> tuple[Signal, Signal, float]:
    """Return positions and torques at the even times at which they were read.

    Torques of the same stamps were read at the same times; those that have others, as beside
    positions that are held, keep theirs. With them goes by how much the stamps jitter, s rms; zero,
    and the same signals, where they do not or where they are right. What is missing is told by the
    spacings, or by long stretches alone if readings are smoother so.
    """
    stamp = position.stamp.astype(float)
    if len(stamp) < FEWEST:
        return position, torque, 0.0
    gaps = np.diff(stamp) > (FILLED + 1.5) * position.period
    parts = np.split(np.arange(len(stamp)), np.flatnonzero(gaps) + 1)
    beside = ~(gaps[:-1] | gaps[1:])
    if np.count_nonzero(beside) < FEWEST:
        return position, torque, 0.0
    way = position.values - position.values[:1]  # exactly zero at rest
    at_stamps = off_the_line(stamp, way)[beside] ** 2
    most = np.quantile(at_stamps, CLIPPED, axis=0)
    best, roughness = stamp, np.sum(np.minimum(at_stamps, most))
    for numbers_of in (by_line, in_a_row):
        line = numbered(stamp, parts, position.period, numbers_of)
        even = np.concatenate(line.times)
        if line.off <= EVEN * line.period or np.diff(even).min() <= 0.0 or (
                _drift(stamp - even, parts) > DRIFTS * line.period):
            continue
        at_even = np.sum(np.minimum(off_the_line(even, way)[beside] ** 2, most))
        if at_even < SMOOTHER * roughness:
            best, roughness = even, at_even
    if best is stamp:
        return position, torque, 0.0
    jitter = float(np.sqrt(np.mean((stamp - best) ** 2)))
    moved = np.round(best).astype(position.stamp.dtype)
    if np.mean(np.isin(torque.stamp, position.stamp)) < TOGETHER:
        return _at(position, moved), torque, 1e-9 * jitter
    # of a torque between two positions the time goes with theirs, so that the order stays
    move = np.interp(torque.stamp.astype(float), stamp, moved - stamp)
    return (_at(position, moved), _at(torque, torque.stamp + np.round(move).astype(moved.dtype)),
            1e-9 * jitter)


def _drift(off: np.ndarray, parts: Sequence[np.ndarray]) -> float:
    """Return the largest mean by which readings of one of the parts are off, `LONG` at a time."""
    return max(float(np.abs(np.convolve(off[part], np.full(LONG, 1.0 / LONG), 'valid')).max())
               if len(part) >= LONG else 0.0 for part in parts)


def _at(signal: Signal, stamp: np.ndarray) -> Signal:
    """Return a signal at other stamps; what is missing between these is counted anew."""
    return replace(signal, stamp=stamp, counts=replace(
        signal.counts, **vars(spacing_counts(stamp))))
