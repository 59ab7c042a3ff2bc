"""A load that is not where the encoder on its motor says: elasticity and backlash.

The motor side, friction and a share of the actuator's inertia, moves as measured. The load side
moves by q + dq(t); the change of its torque to first order is what the model lacks. A shift of one
joint moves the platform and with it the torque of all.
"""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.shifted import shift_derivative
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State, state_of_joints

MOTOR_SHARE = 0.5
"""Of the actuator inertia that turns with the encoder, before the transmission: assumed."""


def _motor_side(state: State, qdd: np.ndarray) -> np.ndarray:
    return MOTOR_SHARE * state.nominal.values['actuator_inertia'] * qdd


def transmitted_torque(state: State) -> np.ndarray:
    """Return the torque (n, J), N m, that the transmission carries to the load."""
    return state.nominal.load - _motor_side(state, state.qdd)


def transmission_columns(state: State, shift: np.ndarray) -> np.ndarray:
    """Return d/dc of the load side's torque on q + c shift, (n, J, J): one column a joint shifted.

    Args:
        state: the motion with its nominal torque.
        shift: of the load of each joint against its motor, (n, J), rad per unit of c.
    """
    columns = np.empty((*state.q.shape, state.joints))
    for joint in range(state.joints):
        alone = np.zeros_like(shift)
        alone[:, joint] = shift[:, joint]
        curvature = time_rate(state, time_rate(state, alone))
        columns[..., joint] = shift_derivative(state, alone) - _motor_side(state, curvature)
    return columns


def load_inertia(state: State, t: np.ndarray) -> np.ndarray:
    """Return the inertia (m, J, J), kg m2, behind the transmissions at the times t (m,), s.

    Column j: what the load side takes to accelerate joint j alone, from rest.
    """
    q = np.stack([np.interp(t, state.t, joint) for joint in state.q.T], axis=1)
    still, unit = np.zeros_like(q), np.eye(state.joints)

    def torque(qdd: np.ndarray) -> np.ndarray:
        """Return the load side's torque of accelerations (J,) from rest."""
        qdd = np.broadcast_to(qdd, q.shape)
        return (state.nominal.rigid_torque(state_of_joints(state.geometry, t, q, still, qdd))
                - _motor_side(state, qdd))

    rest = torque(np.zeros(state.joints))
    return np.stack([torque(unit[joint]) - rest for joint in range(state.joints)], axis=-1)


def one_a_joint(values: np.ndarray) -> np.ndarray:
    """Return shared coefficients (J, J) of values (J,): coefficient k is that of joint k."""
    return np.repeat(values[:, None], len(values), axis=1)
