"""Rates of what is known at the samples of a motion only."""

from __future__ import annotations

import numpy as np

from par4_dynamics.state import State


def time_rate(state: State, values: np.ndarray) -> np.ndarray:
    """Return the time derivative of `values` (n, ...) by differences, zero of a single sample."""
    if len(state.t) < 2:
        return np.zeros_like(values)
    return np.gradient(values, state.t, axis=0)
