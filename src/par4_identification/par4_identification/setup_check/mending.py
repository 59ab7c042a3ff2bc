"""Logs without the samples that are faults: filled where little is missing, cut where much is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_identification.logs.accounts import SHORTEST_SEGMENT
from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches
from par4_identification.logs.stretches import SHORTEST
from par4_identification.setup_check.held_readings import Held

LONGEST_FILLED = 0.06
"""s; longer stretches are cut out: the log goes on as another segment."""
STRAIGHT = 0.2
"""Ways of a sample by which positions that are filled in may be off a straight line, of a single
joint, to be taken for measured ones: at a steady speed they can hardly have been others."""
SLOPE_SAMPLES = 5
"""From which the speed at either end of a stretch is taken."""


def filled(log: Log, held: Sequence[Held]) -> Log:
    """Return the log with what was held filled in and marked as doubtful, or cut out if long."""
    if not held:
        return log
    q, tau = log.q.copy(), log.tau.copy()
    doubtful = _doubts(log)
    cut = np.zeros(len(log.t), dtype=bool)
    for item in held:
        rows = slice(item.start + 1, item.end)
        if (item.end - item.start) * log.period > LONGEST_FILLED or item.end >= len(log.t):
            cut[rows] = True
            continue
        bends = [_bridge(q[:, joint], item.start, item.end) for joint in item.joints]
        doubtful[rows] |= q.shape[1] > 1 or max(bends, default=0.0) > STRAIGHT
        if item.torque:
            inside = np.arange(item.start + 1, item.end)
            for joint in range(tau.shape[1]):
                tau[rows, joint] = np.interp(inside, (item.start, item.end),
                                             tau[[item.start, item.end], joint])
    return without(replace(log, q=q, tau=tau, doubtful=doubtful), cut)


def _bridge(values: np.ndarray, start: int, end: int) -> float:
    """Fill values between two rows by the cubic that goes on from both sides with their slopes.

    Returns how far it is from a straight line, over the way of a sample.
    """
    first, last = max(start - SLOPE_SAMPLES, 0), min(end + SLOPE_SAMPLES, len(values) - 1)
    before = (values[start] - values[first]) / max(start - first, 1)
    after = (values[last] - values[end]) / max(last - end, 1)
    length = end - start
    share = np.arange(1, length) / length
    rest = 1.0 - share
    values[start + 1:end] = (
        rest ** 2 * (1.0 + 2.0 * share) * values[start] + share ** 2 * (3.0 - 2.0 * share)
        * values[end] + length * share * rest * (rest * before - share * after))
    straight = rest * values[start] + share * values[end]
    way = abs(values[end] - values[start]) / length
    return float(np.max(np.abs(values[start + 1:end] - straight), initial=0.0)) / max(way, 1e-30)


def without(log: Log, cut: np.ndarray) -> Log:
    """Return the log without some samples (n,); what is left of a segment is cut there."""
    if not cut.any():
        return log
    rows, segments, end = [], [], 0
    for segment in log.segments:
        for first, last in stretches(~cut[segment]):
            if last - first >= SHORTEST_SEGMENT:
                rows.append(np.arange(segment.start + first, segment.start + last))
                segments.append(slice(end, end + last - first))
                end += last - first
    kept = np.concatenate(rows) if rows else np.zeros(0, dtype=int)
    return replace(log, t=log.t[kept], q=log.q[kept], tau=log.tau[kept], segments=tuple(segments),
                   doubtful=None if log.doubtful is None else log.doubtful[kept])


def despiked(log: Log, column: str, spikes: np.ndarray) -> Log:
    """Return the log with single wrong samples (n, J) of a column interpolated."""
    values = getattr(log, column).copy()
    rows = np.arange(len(values))
    for joint in range(values.shape[1]):
        wrong = spikes[:, joint]
        values[wrong, joint] = np.interp(rows[wrong], rows[~wrong], values[~wrong, joint])
    return replace(log, **{column: values})


def unslipped(log: Log, slips: Sequence[tuple[int, int, float]]) -> Log:
    """Return the log with the steps of slipped readings taken off, the first part being right."""
    q = log.q.copy()
    for row, joint, step in slips:
        q[row:, joint] -= step
    return replace(log, q=q)


def slowed(log: Log, factor: float) -> Log:
    """Return the log with all its times longer by a factor."""
    reference = log.reference and replace(log.reference, t=factor * log.reference.t)
    return replace(log, t=factor * log.t, period=factor * log.period, reference=reference)


def doubted(log: Log, mask: np.ndarray) -> Log:
    """Return the log in which more samples (n, J) are doubtful."""
    return replace(log, doubtful=_doubts(log) | mask)


def _doubts(log: Log) -> np.ndarray:
    return np.zeros(log.q.shape, dtype=bool) if log.doubtful is None else log.doubtful.copy()


def sound_time(log: Log) -> float:
    """Return the time, s, of the segments that are long enough for the filters."""
    lengths = [(segment.stop - segment.start) * log.period for segment in log.segments]
    return float(sum(length for length in lengths if length >= SHORTEST))
