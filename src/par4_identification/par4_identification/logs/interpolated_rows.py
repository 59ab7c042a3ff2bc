"""Samples that were not measured: whoever wrote the log put a straight line where some were lost.

A torque has noise, so that it lies on the line between its neighbours by chance alone, and that of
all joints at once never. Readings in steps, as of encoder counts, lie there often: how often each
of them does tells how often all do by chance.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from par4_identification.logs.neighbours import off_the_line
from par4_identification.logs.stamps import GAP
from par4_identification.logs.topic_signal import Signal

EXACT = 1e-9
"""Deviation from the line, over the range of a signal, that is none."""
FEWEST, BEYOND = 10, 10.0
"""Samples on the line, and so many times what chance makes, above which they were put there."""
TELLING = 4
"""Signals that change and could be off the line, at the least. The two of an axis in steps are on
it together more often than chance has it: both hardly change where it is slow."""


def without_interpolated(position: Signal, torque: Signal) -> tuple[Signal, Signal, int]:
    """Return the samples that were measured, and how many others there were.

    Positions and torques must have the same stamps; one signal alone does not tell.
    """
    if not np.array_equal(position.stamp, torque.stamp) or len(position.stamp) < 3:
        return position, torque, 0
    values = np.concatenate((position.values, torque.values), axis=1)
    on_line = _on_line(position.stamp.astype(float), values)
    found = int(np.count_nonzero(on_line))
    if not found:
        return position, torque, 0
    kept = ~on_line
    return _with(position, kept), _with(torque, kept), found


def _on_line(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return which samples (n,) of signals (n, K) were put on the line between their neighbours."""
    on = np.abs(off_the_line(time, values)) <= EXACT * np.ptp(values, axis=0)
    changes = values[2:] != values[:-2]
    together = on.all(axis=1) & (np.count_nonzero(changes, axis=1) >= TELLING)
    # of all other samples: how often each signal is on the line where it changes
    others = changes & ~together[:, None]
    often = np.count_nonzero(on & others, axis=0) / np.maximum(np.count_nonzero(others, axis=0), 1)
    by_chance = np.sum(np.prod(np.where(changes, often, 1.0), axis=1)[
        np.count_nonzero(changes, axis=1) >= TELLING])
    if np.count_nonzero(together) <= max(FEWEST, BEYOND * by_chance):
        together[:] = False
    return np.concatenate(([False], together, [False]))


def _with(signal: Signal, kept: np.ndarray) -> Signal:
    """Return a signal with some of its samples; many fewer have a period of their own."""
    stamp = signal.stamp[kept]
    apart = float(np.median(np.diff(stamp))) if len(stamp) > 1 else signal.period
    return replace(signal, stamp=stamp, values=signal.values[kept],
                   period=apart if apart > GAP * signal.period else signal.period)
