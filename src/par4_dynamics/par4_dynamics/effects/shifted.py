"""A motion whose joints are not where they were read: q + dq(t)."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State


def shift_columns(state: State, dq: np.ndarray, dqd: np.ndarray | None = None,
                  dqdd: np.ndarray | None = None) -> np.ndarray:
    """Return how bodies and pulls load the joints as each by itself moves at q + c dq(t).

    Args:
        state: the motion with its nominal torque.
        dq: of each joint, (n, J), rad per unit of c.
        dqd, dqdd: its rates; without them its differences in time.

    Returns:
        d/dc at c = 0, (n, J, J), N m per unit of c: [:, i, j] of joint i as joint j is shifted.
    """
    dqd = time_rate(state, dq) if dqd is None else dqd
    dqdd = time_rate(state, dqd) if dqdd is None else dqdd
    columns = state.load_by_q * dq[:, None, :]
    if np.any(dqd):  # a single sample has no rates
        columns = columns + state.load_by_qd * dqd[:, None, :]
    if np.any(dqdd):
        columns = columns + state.torque_by_qdd * dqdd[:, None, :]
    return columns
