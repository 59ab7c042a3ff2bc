"""Signals that are refreshed more slowly than the log is written: each reading repeats until then.

A drive that renews its current every 10 ms fills ten rows of a log of 1 kHz with it. What repeats
is no measurement: taken as one, it comes half of that time late. Readings in encoder counts repeat,
too, but then the next one is a count away, and the time that they stand follows the speed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from par4_identification.logs.stamps import nearest_stamp
from par4_identification.logs.topic_signal import FILLED, Signal

FEWEST = 50
"""Refreshes from which their rhythm is known."""
EVENNESS, MOSTLY = 0.4, 0.9
"""Largest deviation from the usual number of rows between refreshes, over it (one row is always
allowed), and the share of the refreshes that keep to it."""
RHYTHM, USUAL = 0.1, 0.5
"""Share of the usual number of rows by which longer times may miss a whole multiple of it, and the
least share of the refreshes with the usual one, where readings come out as the last ones did."""
STEPS = 2.5
"""Ratio of the usual step at a refresh to the least one; encoder counts change by one count."""
LEAST = 0.02
"""Quantile of the steps between values that stands for the least."""


@dataclass(frozen=True)
class Refresh:
    """How a signal is held between refreshes.

    Attributes:
        rows: at which it has a new reading, in order.
        every: usual number of rows between two.
    """

    rows: np.ndarray
    every: int


def refresh_of(values: np.ndarray) -> Refresh | None:
    """Return how values (n, J) are held between refreshes; None where they are not.

    Readings that stay for longer, as in a rest, are readings still: they have rows where the rhythm
    has them. Few that fail to come are missing. Where many stay for whole multiples of the rhythm,
    coarse readings came out as the last ones did, if the step after them is no larger than others.
    """
    changes = np.flatnonzero((np.diff(values, axis=0) != 0.0).any(axis=1)) + 1
    apart = np.diff(changes)
    if len(apart) < FEWEST or not (every := round(float(np.median(apart)))) > 1:
        return None
    spread = max(1.0, EVENNESS * every)
    in_time = (apart >= max(2.0, every - spread)) & (apart <= every + spread)
    periods = np.round(apart / every)
    late = apart > every + spread
    again = late & (np.abs(apart - periods * every) <= RHYTHM * every)
    coarse = bool(np.mean(in_time) < MOSTLY and np.mean(in_time) > USUAL
                  and np.mean(in_time | again) >= MOSTLY and np.mean(again[late]) >= MOSTLY)
    if not coarse and (np.mean(in_time) < MOSTLY
                       or not jumps(values[changes - 1], values[changes])):
        return None
    if coarse:
        step = np.abs(np.diff(values[[0, *changes]], axis=0)).max(axis=1)[1:]
        coarse = bool(np.median(step[late]) <= np.median(step[in_time]))
    steps = np.round(np.append(apart, len(values) - changes[-1]) / every)
    steps = steps if coarse else np.where(steps > FILLED + 1, steps, 1)
    rows = np.concatenate([start + every * np.arange(int(count)) for start, count in zip(
        changes, steps, strict=True)])
    return Refresh(rows[rows < len(values)], every)


def jumps(before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether some column of values (m, J) changes by more than its least step, mostly."""
    for old, new in zip(before.T, after.T, strict=True):
        step = np.abs(new - old)
        step = step[step > 0.0]
        least = np.diff(np.unique(np.concatenate((old, new))))
        if len(step) and np.median(step) > STEPS * np.quantile(least, LEAST):
            return True
    return False


def fresh(signal: Signal) -> tuple[Signal, float]:
    """Return the samples that are no repetition, and the time, s, for which each is held.

    That time is zero where a signal is not held; all its samples are then returned.
    """
    found = refresh_of(signal.values)
    if found is None:
        return signal, 0.0
    period = found.every * signal.period
    return replace(signal, stamp=signal.stamp[found.rows], values=signal.values[found.rows],
                   period=period), 1e-9 * period


def at_refreshes(signal: Signal, slow: Signal) -> Signal:
    """Return the samples of a signal next to those of one that is refreshed more slowly."""
    rows = np.unique(nearest_stamp(signal.stamp, slow.stamp))
    return replace(signal, stamp=signal.stamp[rows], values=signal.values[rows],
                   period=slow.period)
