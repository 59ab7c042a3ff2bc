"""A motion whose joints are not where they were read: q + dq(t)."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State, state_of_joints

SMALL_SHIFT = 1e-5
"""rad: the largest shift of a finite difference."""


def shifted(state: State, dq: np.ndarray) -> State:
    """Return the state of the joint motion q + dq(t), dq (n, J) rad, without its torque.

    The velocity and acceleration of dq are its differences in time.

    Raises:
        UnreachableError: joint positions with which the mechanism does not close.
    """
    velocity = time_rate(state, dq)
    return state_of_joints(state.geometry, state.t, state.q + dq, state.qd + velocity,
                           state.qdd + time_rate(state, velocity))


def shift_derivative(state: State, direction: np.ndarray) -> np.ndarray:
    """Return d/ds of the bodies' torque on the motion q + s direction(t) at s = 0, (n, J).

    Args:
        state: the motion with its nominal torque.
        direction: (n, J), rad per unit of s.

    Returns:
        N m per unit of s.
    """
    largest = float(np.max(np.abs(direction), initial=0.0))
    if largest == 0.0:
        return np.zeros_like(state.q)
    step = SMALL_SHIFT / largest
    torque = state.nominal.rigid_torque
    return (torque(shifted(state, step * direction))
            - torque(shifted(state, -step * direction))) / (2.0 * step)
