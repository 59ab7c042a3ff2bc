"""Two machines or simulations on one topic: which messages are whose, and when they get mixed.

Two simulations count time from their own beginnings, so that stamps of the two differ from the time
of receipt by different offsets and alternate as messages arrive: one of them is kept. Two sources
on one clock cannot be told apart, but where both talk, positions jump to and fro from message to
message: such stretches are left out.
"""

from __future__ import annotations

import numpy as np

APART = 250_000_000
"""ns between the offsets of two clocks; transport does not delay a message so long."""
OFTEN = 0.02
"""Share of the messages at which the clock changes from one to the other and back."""
JUMP = 1e-2
"""rad of a jump to and fro."""
AROUND, DENSE = 50, 0.3
"""Samples over which jumps are counted, and share of them where two sources talk; the jumps of
single wrong readings are rarer."""
JOINED = 1_000_000_000
"""ns between mixed stretches that are one: two machines in one pose look like one."""


def of_one_clock(received: np.ndarray, stamp: np.ndarray, near: float | None = None
                 ) -> tuple[np.ndarray, float]:
    """Return which messages (n,) come from one source, and its offset, receipt less stamp, ns.

    All of them, unless clocks alternate; then those of the clock with more messages.

    Args:
        received, stamp: (n,) ns, in the order of receipt.
        near: offset of the source that is wanted, if known.
    """
    offset = (received - stamp).astype(float)
    everything = np.ones(len(offset), dtype=bool)
    if len(offset) < 2:
        return everything, float(offset.sum())
    ordered = np.sort(offset)
    gaps = np.diff(ordered)
    widest = int(np.argmax(gaps))
    middle = 0.5 * (ordered[widest] + ordered[widest + 1])
    late = offset > middle
    if gaps[widest] < APART or np.count_nonzero(late[1:] != late[:-1]) < OFTEN * len(late):
        return everything, float(np.median(offset))
    sides = [(side, float(np.median(offset[side]))) for side in (late, ~late)]
    if near is not None:
        return min(sides, key=lambda item: abs(item[1] - near))
    return max(sides, key=lambda item: np.count_nonzero(item[0]))


def mixed_stretches(stamp: np.ndarray, values: np.ndarray) -> list[tuple[int, int]]:
    """Return the stretches of time, ns, in which positions of two sources get mixed.

    Args:
        stamp: (n,) ns, increasing or repeated.
        values: positions (n, J), rad.
    """
    step = np.diff(values, axis=0)
    if len(step) < 2:
        return []
    there, back = np.abs(step[:-1]), np.abs(step[1:])
    returned = np.abs(step[:-1] + step[1:]) < 0.3 * np.minimum(there, back)
    to_and_fro = (returned & (np.minimum(there, back) > JUMP)).any(axis=1)
    dense = np.convolve(to_and_fro, np.full(AROUND, 1.0 / AROUND), 'same') > DENSE
    found: list[tuple[int, int]] = []
    for start, end in np.flatnonzero(np.diff(np.r_[False, dense, False])).reshape(-1, 2):
        first = int(stamp[max(start - AROUND, 0)])
        last = int(stamp[min(end + AROUND, len(stamp) - 1)])
        if found and first - found[-1][1] < JOINED:
            first = found.pop()[0]
        found.append((first, last))
    return found


def outside(stamp: np.ndarray, stretches: list[tuple[int, int]]) -> np.ndarray:
    """Return which stamps (n,) lie in none of the stretches."""
    kept = np.ones(len(stamp), dtype=bool)
    for first, last in stretches:
        kept &= (stamp < first) | (stamp > last)
    return kept
