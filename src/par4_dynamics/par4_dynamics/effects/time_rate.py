"""Time derivatives of quantities that are known only at the samples of a motion."""

from __future__ import annotations

import numpy as np

from par4_dynamics.state import State


def time_rate(state: State, values: np.ndarray) -> np.ndarray:
    """Return the time derivative of `values` (n, ...) by differences, zero of a single sample.

    Fourth order where samples are equally far apart, as second order is 1 % too small at 40 Hz of
    1 kHz; second order beside the ends.
    """
    if len(state.t) < 2:
        return np.zeros_like(values)
    slope = np.gradient(values, state.t, axis=0)
    slope[2:-2] -= np.diff(slope[1:-1], n=2, axis=0) / 6.0
    return slope
