"""One time axis for all topics of a bag, also where the clock was set back."""

from __future__ import annotations

import numpy as np

from par4_identification.logs.masks import count, stretches
from par4_identification.logs.stamped_rows import SET_BACK, StampedRows
from par4_identification.logs.stamps import CROWDED, nearest_stamp

CLOCKS_APART_NS = 250_000_000
"""By how much receipt minus stamp differs, at the least, of messages whose stamps are of different
clocks; transport does not delay a message so long."""


class Clock:
    """One time axis for all topics of a bag, also when the clock was set back in between.

    Its zero is the first position; its unit ns, so that times are small and exact as floats. Every
    run between two resets is shifted so that it follows on its predecessor. Which run a message of
    another topic belongs to follows from when it was received.

    Attributes:
        origin: stamp of time zero, ns.
        joins: times between the runs.
    """

    def __init__(self, received: np.ndarray, stamp: np.ndarray, values: np.ndarray) -> None:
        """Find the runs of positions (n, J) in the order in which they were received, (n,) ns."""
        spacing = np.diff(stamp)
        period = float(np.median(spacing[spacing > 0])) if (spacing > 0).any() else 1.0
        starts = [0]
        while (reset := _first_reset(stamp[starts[-1]:], values[starts[-1]:], period)) is not None:
            starts.append(starts[-1] + reset)
        ends = [*starts[1:], len(stamp)]
        self.origin = int(stamp[:ends[0]].min())
        shifts, joins = [-self.origin], []
        for run, start in enumerate(starts[1:]):
            last = int(stamp[starts[run]:start].max()) + shifts[run]
            # Wide enough to cut the log, and narrower than a set-back that matters.
            joins.append(last + round(5 * period))
            shifts.append(last + round(10 * period) - int(stamp[start]))
        self.joins = np.array(joins, dtype=np.int64)
        self._shifts = np.array(shifts, dtype=np.int64)
        self._received = np.maximum.accumulate(received)
        self._time = stamp + np.repeat(self._shifts, np.subtract(ends, starts))

    def at_receipt(self, received: np.ndarray) -> np.ndarray:
        """Return the time at which something was received, (n,) ns."""
        first = self._received[0]
        return np.rint(np.interp(received - first, self._received - first, self._time)).astype(
            np.int64)

    def time(self, received: np.ndarray, stamp: np.ndarray) -> np.ndarray:
        """Return the time of stamps, (n,) ns."""
        if not len(self.joins):
            return stamp + self._shifts[0]
        candidates = stamp[:, None] + self._shifts
        distance = np.abs(candidates - self.at_receipt(received)[:, None])
        return candidates[np.arange(len(stamp)), np.argmin(distance, axis=1)]

    def offset(self, rows: StampedRows) -> int:
        """Return by how much, ns, stamps of another clock must be moved to be on this one.

        Both clocks are compared with the one that told when messages were received; zero where
        they agree to `CLOCKS_APART_NS`, or where a clock was set back as well.
        """
        if len(self.joins):
            return 0
        own = float(np.median(self._received - (self._time - self._shifts[0])))
        other = float(np.median(rows.received - rows.stamp))
        return 0 if abs(other - own) < CLOCKS_APART_NS else round(other - own)

    def run(self, time: np.ndarray) -> np.ndarray:
        """Return the number of the run that each time belongs to."""
        return np.searchsorted(self.joins, time, side='right')


def _first_reset(stamp: np.ndarray, values: np.ndarray, period: float) -> int | None:
    """Return the index of the first sample after the clock was set back.

    A late sample fills a hole. After a reset, samples in a row go once more over time that is
    covered already, with other values; or they are too late for any transport.
    """
    newest = np.maximum.accumulate(stamp)
    for first, end in stretches(stamp < newest):
        if end - first < 3:
            continue
        if newest[first] - stamp[first] > SET_BACK:
            return first
        again, order = stamp[first:end], np.argsort(stamp[:first], kind='stable')
        if len(order) < 3:
            continue
        nearest = order[nearest_stamp(stamp[order], again)]
        covered = np.abs(stamp[nearest] - again) < CROWDED * period
        differs = (np.nan_to_num(values[nearest]) != np.nan_to_num(values[first:end])).any(axis=1)
        if count(covered & differs) >= 3:
            return first
    return None
