"""Two machines or simulations on one topic: which messages are whose, and when they get mixed.

Two simulations count time from their own beginnings, so that stamps of the two differ from the time
of receipt by different offsets and alternate as messages arrive: one of them is kept. Two sources
on one clock cannot be told apart, but where both talk, positions jump to and fro from message to
message: such stretches are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from par4_identification.logs.masks import stretches, taken
from par4_identification.logs.stamped_rows import StampedRows

APART = 250_000_000
"""ns between the offsets of two clocks; transport does not delay a message so long."""
FEWEST_CHANGES, OFTEN = 20, 0.04
"""Changes from one clock to the other and back from which there are two: a number, and a share of
the messages with the rarer clock. A clock that is set back changes once, a wrong stamp twice."""
JUMP = 1e-2
"""rad of a jump to and fro, from sample to sample."""
AROUND, DENSE = 50, 0.3
"""Samples over which jumps are counted, and share of them where two sources talk; the jumps of
single wrong readings are rarer."""
MOST_MIXED = 0.8
"""Share of the time in which two sources talk from which the bag is refused."""
JOINED = 1_000_000_000
"""ns between mixed stretches that are one: two machines in one pose look like one."""


@dataclass(frozen=True)
class Source:
    """The source of a bag whose messages are kept.

    Attributes:
        offset: receipt less stamp of its messages, ns; None where all are kept.
        mixed: stretches of the bag's time, ns, in which another source talks as well.
    """

    offset: float | None
    mixed: tuple[tuple[int, int], ...] = ()

    def of_its_clock(self, rows: StampedRows) -> StampedRows:
        """Return the rows of a topic that have the clock of this source."""
        offset = self.offset
        if offset is None:
            return rows
        sides = _clocks(rows)
        return rows if sides is None else rows.part(min(
            sides, key=lambda side: abs(_offset(rows, side) - offset)))

    def unmixed(self, rows: StampedRows, time: np.ndarray) -> StampedRows:
        """Return the rows, at times (n,) ns, that no other source is mixed with."""
        kept = np.ones(len(time), dtype=bool)
        for first, last in self.mixed:
            kept &= (time < first) | (time > last)
        return rows if kept.all() else rows.part(kept)


def source_of(positions: StampedRows) -> Source:
    """Return the source with more messages where two clocks alternate; else what is all of it."""
    sides = _clocks(positions)
    if sides is None:
        return Source(None)
    return Source(_offset(positions, max(sides, key=np.count_nonzero)))


def beside_mixed(source: Source, positions: StampedRows, time: np.ndarray) -> Source:
    """Return the source with the stretches in which positions at times (n,) ns get mixed.

    Where they are mixed nearly throughout there is nothing to be kept, and nothing is left out.
    """
    finite = np.flatnonzero(np.isfinite(positions.values).all(axis=1))
    order = finite[np.argsort(time[finite], kind='stable')]
    found = _mixed_stretches(taken(time, order), taken(positions.values, order))
    lost = sum(last - first for first, last in found)
    if not found or lost > MOST_MIXED * (time[order[-1]] - time[order[0]]):
        return source
    return replace(source, mixed=tuple(found))


def _clocks(rows: StampedRows) -> tuple[np.ndarray, np.ndarray] | None:
    """Return which rows have the one clock and which the other; None where no two alternate.

    Every clock has an offset of its own, and one that was set back has several. Of the two offsets
    that follow each other most often, from message to message, the rarer is that of the other.
    """
    offset = (rows.received - rows.stamp).astype(float)
    ordered = np.sort(offset)
    below = np.flatnonzero(np.diff(ordered) >= APART)
    if not len(below):
        return None
    cluster = np.searchsorted(0.5 * (ordered[below] + ordered[below + 1]), offset)
    pairs = np.sort(np.column_stack((cluster[:-1], cluster[1:])), axis=1)
    pairs, changes = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0, return_counts=True)
    most = int(np.argmax(changes))
    sizes = np.bincount(cluster)[pairs[most]]
    if changes[most] < max(FEWEST_CHANGES, OFTEN * sizes.min()):
        return None
    other = cluster == pairs[most][np.argmin(sizes)]
    return ~other, other


def _offset(rows: StampedRows, side: np.ndarray) -> float:
    return float(np.median((rows.received - rows.stamp)[side]))


def to_and_fro(values: np.ndarray) -> np.ndarray:
    """Return at which inner samples a position of (n, J), rad, jumps and jumps back, (n - 2,)."""
    found = np.zeros(max(len(values) - 2, 0), dtype=bool)
    for own in values.T:  # joint by joint: an hour of all of them is half a gigabyte
        step = np.diff(own)
        smaller = np.minimum(np.abs(step[:-1]), np.abs(step[1:]))
        found |= (np.abs(step[:-1] + step[1:]) < 0.3 * smaller) & (smaller > JUMP)
    return found


def _mixed_stretches(stamp: np.ndarray, values: np.ndarray) -> list[tuple[int, int]]:
    """Return the stretches of time, ns, in which positions of two sources get mixed.

    Args:
        stamp: (n,) ns, increasing or repeated.
        values: positions (n, J), rad.
    """
    if len(values) < 3:
        return []
    dense = np.convolve(to_and_fro(values), np.full(AROUND, 1.0 / AROUND), 'same') > DENSE
    found: list[tuple[int, int]] = []
    for start, end in stretches(dense):
        first = int(stamp[max(start - AROUND, 0)])
        last = int(stamp[min(end + AROUND, len(stamp) - 1)])
        if found and first - found[-1][1] < JOINED:
            first = found.pop()[0]
        found.append((first, last))
    return found
