"""Short moves between states of motion: quintic polynomials of the platform within limits."""

from __future__ import annotations

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_platform
from par4_identification.excitation.motion_limits import MotionLimits
from par4_kinematics.geometry import Geometry

DURATIONS = np.round(np.geomspace(0.04, 4.0, 60), 3)
"""Durations of a transition that are tried, s."""
SAMPLES = 40
"""Samples of a transition at which the search checks limits."""
_POWERS = np.arange(6)


def transition(start: np.ndarray, end: np.ndarray, duration: float, t: np.ndarray) -> np.ndarray:
    """Return X, Xd, Xdd (3, ..., n, 4) at times t (n,) of the quintic from one state to another.

    Args:
        start, end: X, Xd, Xdd (3, ..., 4) at 0 and at `duration`.
        duration: s.
        t: s.
    """
    scale = duration ** np.arange(3).reshape(3, *[1] * (start.ndim - 1))
    values = np.concatenate((start * scale, end * scale))
    u = t / duration
    ends = np.stack([_powers(np.array(place), order) for place in (0.0, 1.0)
                     for order in range(3)])
    weights = np.linalg.solve(ends, np.eye(6))
    laws = np.stack([_powers(u, order) @ weights / duration ** order for order in range(3)])
    x = (laws @ values.reshape(6, -1)).reshape(*laws.shape[:2], *values.shape[1:])
    return np.ascontiguousarray(np.moveaxis(x, 1, -2))


def _powers(u: np.ndarray, order: int) -> np.ndarray:
    """Return the derivatives (..., 6) of 1, u .. u^5."""
    factor = np.ones(6)
    for past in range(order):
        factor = factor * (_POWERS - past)
    return factor * u[..., None] ** np.maximum(_POWERS - order, 0)


def shortest_durations(start: np.ndarray, end: np.ndarray, geometry: Geometry, model: Model,
                       limits: MotionLimits) -> np.ndarray:
    """Return the shortest of `DURATIONS` (m,) whose transitions keep the limits, inf for none.

    Args:
        start, end: X, Xd, Xdd of m candidates, (3, m, 4); either may have m = 1.
        geometry, model: for joints and torque.
        limits: to be kept.
    """
    start, end = np.broadcast_arrays(start, end)
    count = start.shape[1]
    found = np.full(count, np.inf)
    for duration in DURATIONS:
        open_ones = np.flatnonzero(np.isinf(found))
        if not len(open_ones):
            break
        x = transition(start[:, open_ones], end[:, open_ones], duration,
                       np.linspace(0.0, duration, SAMPLES)).reshape(3, -1, 4)
        state = state_of_platform(geometry, np.zeros(x.shape[1]), limits.nearest(x[0]), *x[1:])
        loads = limits.loads(state, x[0], model.torque(state))
        worst = np.max([load.max(axis=1) for load in loads.values()], axis=0)
        kept = worst.reshape(len(open_ones), SAMPLES).max(axis=1) <= 1.0
        found[open_ones[kept]] = duration
    return found
