"""Counters of positions that start again: readings that jump from one end of their range to the
other while the joint goes on.

Those of a joint itself start again after whole turns, see `jumps.without_turns`; of a motor behind
a gear, of a slide or of a number of so many bits they do so after any way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_identification.logs.jumps import median_of_others

WHOLE = 0.5
"""Part of the range of the readings that a jump is larger than."""
OFTEN, SELDOM = 3, 0.2
"""Jumps from which a counter is known, and largest share of the steps that they are."""
ALIKE = 0.05
"""Most by which jumps differ from their usual size, and the range of the readings from it."""
AGAINST = 0.9
"""Least share of the jumps that go against the motion around them."""
FINE = 50.0
"""Least ratio of the range to the steps of the readings."""


@dataclass(frozen=True)
class Restarts:
    """Where a counter starts again.

    Attributes:
        steps: numbers of the steps from reading to reading that jump, (k,).
        up: whether the reading jumps up there, (k,).
        way: after which it starts again, in the unit of the readings.
    """

    steps: np.ndarray
    up: np.ndarray
    way: float


def restarts_of(q: np.ndarray, width: np.ndarray | float = 1.0) -> Restarts | None:
    """Return where a counter starts again, None if it does not, or so seldom that it may slip.

    Args:
        q: readings of one joint, (n,).
        width: of the steps, in periods, (n - 1,) or one for all.
    """
    step = np.diff(q)
    span = float(np.ptp(q)) if len(q) else 0.0
    moving = np.abs(step[step != 0.0])
    if not len(moving) or span <= FINE * np.quantile(moving, 0.02):
        return None
    moved = width * median_of_others(step / width)
    off = step - moved
    rows = np.flatnonzero(np.abs(off) > WHOLE * span)
    if not OFTEN <= len(rows) <= SELDOM * len(step):
        return None
    sizes = np.abs(off[rows])
    way = float(np.median(sizes))
    alike = np.abs(sizes - way) <= ALIKE * way
    against = off[rows] * moved[rows] <= 0.0
    if not (alike.all() and abs(span - way) <= ALIKE * way and np.mean(against) >= AGAINST):
        return None
    return Restarts(rows, off[rows] > 0.0, way)


def going_on(q: np.ndarray, found: Restarts) -> np.ndarray:
    """Return readings (n,) that go on where a counter starts again."""
    jumps = np.zeros(len(q))
    jumps[found.steps + 1] = np.where(found.up, found.way, -found.way)
    return q - np.cumsum(jumps)
