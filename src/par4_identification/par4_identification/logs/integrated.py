"""Whether positions were measured or are the integral of measured speeds, as `par4_bag` makes it.

The noise of such a position is that of the speeds, added up: it is no white noise.
"""

from __future__ import annotations

import numpy as np

from par4_kinematics.stamps import SECOND

EXACT = 1e-5
"""Share of the largest step of a position by which it may miss that of the speeds: times are whole
nanoseconds."""
MOST = 0.9
"""Least share of the known steps that are those of the speeds: others lie across repairs."""


def ways_of(speed: np.ndarray, seconds: np.ndarray) -> np.ndarray:
    """Return the way from each reading of a speed (n, ...) to the next, (n - 1, ...).

    It is that of the trapezoidal rule over times between them of `seconds`, which broadcast.
    """
    return np.asarray(0.5 * (speed[1:] + speed[:-1]) * seconds)


def are_integrals(stamp: np.ndarray, position: np.ndarray, speed: np.ndarray) -> bool:
    """Return whether positions are the integral, by the trapezoidal rule, of the speeds beside.

    Args:
        stamp: ns, (n,).
        position: rad, (n, J).
        speed: rad/s, (n, J); NaN where there is none.
    """
    steps = np.diff(position, axis=0)
    made = ways_of(speed, (np.diff(stamp) / SECOND)[:, None])
    known = np.isfinite(steps) & np.isfinite(made)
    largest = np.max(np.abs(steps), initial=0.0, where=known)
    alike = np.abs(steps - made) <= EXACT * largest
    return bool(largest > 0.0 and np.mean(alike[known]) > MOST)
