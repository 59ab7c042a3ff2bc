"""Two machines or simulations on one topic: which messages are whose, and when they get mixed.

Two simulations count time from their own beginnings, so that stamps of the two differ from the time
of receipt by different offsets and alternate as messages arrive: one of them is kept, also where
one stalled or was set back on the way, which makes its offset another. Two sources on one clock
cannot be told apart, but where both talk, positions jump to and fro from message to message: such
stretches are left out. Where messages come slowly a machine alone jumps to and fro now and then.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from par4_identification.logs.clock import CLOCKS_APART_NS
from par4_identification.logs.jumps import count_of
from par4_identification.logs.masks import stretches, taken
from par4_identification.logs.stamped_rows import StampedRows
from par4_kinematics.stamps import SECOND

FEWEST_CHANGES, OFTEN = 20, 0.04
"""Changes from one clock to the other and back from which there are two: a number, and a share of
the messages with the rarer clock. A clock that is set back changes once, a wrong stamp twice."""
JUMP = 1e-2
"""rad of a jump to and fro, from sample to sample."""
JUMP_COUNTS, EXACT = 2.5, 1e-4
"""The same in counts: a potentiometer read in steps of a degree trembles by one or two. And how
exactly steps are counts: jumps from one machine to the other have much the same size, too."""
AROUND, DENSE = 50, 0.3
"""Samples over which jumps are counted, and share of them where two sources talk; the jumps of
single wrong readings are rarer."""
FOLLOWED = 20_000_000
"""ns from sample to sample up to which positions of one machine follow its motion; it swings at no
more than ten hertz."""
MOST_MIXED = 0.8
"""Share of the time in which two sources talk from which the bag is refused."""
JOINED = SECOND
"""ns between mixed stretches that are one: two machines in one pose look like one."""


@dataclass(frozen=True)
class Source:
    """The source of a bag whose messages are kept.

    Attributes:
        positions: its messages, where there is another clock; None where all are kept.
        mixed: stretches of the bag's time, ns, in which another source talks as well.
    """

    positions: StampedRows | None
    mixed: tuple[tuple[int, int], ...] = ()

    def of_its_clock(self, rows: StampedRows) -> StampedRows:
        """Return the rows of a topic that have the clock of this source."""
        own, sides = self.positions, None if self.positions is None else _clocks(rows)
        if own is None or sides is None:
            return rows
        at = np.searchsorted(np.maximum.accumulate(own.received), rows.received)
        apart = np.abs(_offsets(rows) - _offsets(own)[np.minimum(at, len(own.received) - 1)])
        return rows.part(min(sides, key=lambda side: float(np.median(apart[side]))))

    def unmixed(self, rows: StampedRows, time: np.ndarray) -> StampedRows:
        """Return the rows, at times (n,) ns, that no other source is mixed with."""
        kept = np.ones(len(time), dtype=bool)
        for first, last in self.mixed:
            kept &= (time < first) | (time > last)
        return rows if kept.all() else rows.part(kept)


def source_of(positions: StampedRows) -> Source:
    """Return the source with more messages where two clocks alternate; else what is all of it."""
    sides = _clocks(positions)
    return Source(None if sides is None else positions.part(sides[0]))


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

    The clock with more rows comes first, and with it what alternates with nothing. A clock has one
    offset at a time; one that was set back, and one of a simulation that stalled, have several.
    So offsets that follow each other again and again, from message to message, are of two clocks,
    and those that alternate with the same are of one. Where both clocks run too slowly, so that
    the offsets of one come to be those of the other, they are not told apart.
    """
    offset = _offsets(rows)
    ordered = np.sort(offset)
    below = np.flatnonzero(np.diff(ordered) >= CLOCKS_APART_NS)
    if not len(below):
        return None
    cluster = np.searchsorted(0.5 * (ordered[below] + ordered[below + 1]), offset)
    pairs = np.sort(np.column_stack((cluster[:-1], cluster[1:])), axis=1)
    pairs, changes = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0, return_counts=True)
    sizes = np.bincount(cluster)
    often = changes >= np.maximum(FEWEST_CHANGES, OFTEN * sizes[pairs].min(axis=1))
    if not often.any():
        return None
    strongest = pairs[often][np.argsort(-changes[often], kind='stable')].tolist()
    lower, upper = _of_two_clocks(strongest, np.bincount(cluster, offset) / sizes)
    other = np.isin(cluster, upper if sizes[upper].sum() <= sizes[lower].sum() else lower)
    return ~other, other


def _of_two_clocks(alternating: list[list[int]], offsets: np.ndarray
                   ) -> tuple[list[int], list[int]]:
    """Return which offsets are of the one clock and which of the other.

    Where both stall at once, no offset from before alternates with one from after: the clock that
    had the smaller offset has the smaller one still.

    Args:
        alternating: pairs of numbers of offsets that are of two clocks, the surest first.
        offsets: their size.
    """
    lower: list[int] = []
    upper: list[int] = []
    while alternating:
        first, second = alternating[0]
        clock = {first: 0, second: 1}
        while (pair := next((pair for pair in alternating
                             if (pair[0] in clock) != (pair[1] in clock)), None)) is not None:
            known, new = pair if pair[0] in clock else pair[::-1]
            clock[new] = 1 - clock[known]
        groups = [[number for number in clock if clock[number] == side] for side in (0, 1)]
        below, above = sorted(groups, key=lambda group: float(np.mean(offsets[group])))
        lower, upper = lower + below, upper + above
        alternating = [pair for pair in alternating if pair[0] not in clock]
    return lower, upper


def _offsets(rows: StampedRows) -> np.ndarray:
    return (rows.received - rows.stamp).astype(float)


def to_and_fro(values: np.ndarray) -> np.ndarray:
    """Return at which inner samples a position of (n, J), rad, jumps and jumps back, (n - 2,)."""
    found = np.zeros(max(len(values) - 2, 0), dtype=bool)
    for own in values.T:  # joint by joint: an hour of all of them is half a gigabyte
        step = np.diff(own)
        moved = np.abs(step[step != 0.0])
        least = max(JUMP, JUMP_COUNTS * count_of(moved, EXACT)) if len(moved) else JUMP
        smaller = np.minimum(np.abs(step[:-1]), np.abs(step[1:]))
        found |= (np.abs(step[:-1] + step[1:]) < 0.3 * smaller) & (smaller > least)
    return found


def _mixed_stretches(stamp: np.ndarray, values: np.ndarray) -> list[tuple[int, int]]:
    """Return the stretches of time, ns, in which positions of two sources get mixed.

    Args:
        stamp: (n,) ns, increasing or repeated.
        values: positions (n, J), rad.
    """
    if len(values) < 3 or np.median(np.diff(stamp)) > FOLLOWED:
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
