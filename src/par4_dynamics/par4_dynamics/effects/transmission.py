"""A load that is not where the encoder on its motor says: elasticity and backlash.

The motor side, friction and a share of the actuator's inertia, moves as measured. The load side
moves by q + dq(t); the change of its torque to first order is what the model lacks. A shift of one
joint moves the platform and with it the torque of all.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from par4_dynamics.effects.shifted import shift_columns
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State, state_of_joints

MOTOR_SHARE = 0.5
"""Of the actuator inertia that turns with the encoder, before the transmission: assumed where
nothing tells."""
ORDER, FOLDED = 4, 0.4
"""Of the filter, either way, that ends what encoders tell; share of the sample rate from which on
there is nothing to end."""


def half_assumed(size: str) -> str:
    """Return that a size takes `MOTOR_SHARE` for granted, as `Effect.assumes` says it."""
    return (f'{100.0 * MOTOR_SHARE:.0f} % of the actuator inertia is taken to turn with the motor '
            f'and its encoder, the rest with the load; where the load has more of it, the {size}.')


def motor_side(state: State, qdd: np.ndarray, share: float = MOTOR_SHARE) -> np.ndarray:
    """Return the torque, N m, that accelerates the motors by qdd (..., J), rad/s2.

    `share` is that of the actuator inertia which turns with them.
    """
    return share * state.known.whole['actuator_inertia'] * qdd


def transmitted_torque(state: State) -> np.ndarray:
    """Return the torque (n, J), N m, that the transmission carries to the load."""
    return state.known.load - motor_side(state, state.qdd)


def transmission_columns(state: State, shift: np.ndarray, share: float = MOTOR_SHARE
                         ) -> np.ndarray:
    """Return d/dc of the load side's torque on q + c shift, (n, J, J): one column a joint shifted.

    Args:
        state: the motion with its nominal torque.
        shift: of the load of each joint against its motor, (n, J), rad per unit of c.
        share: of the actuator inertia that turns with the motor.
    """
    curvature = time_rate(state, time_rate(state, shift))
    return (shift_columns(state, shift)
            - motor_side(state, curvature, share)[:, None, :] * np.eye(state.joints))


def load_inertia(state: State, t: np.ndarray) -> np.ndarray:
    """Return the inertia (m, J, J), kg m2, behind the transmissions at the times t (m,), s.

    Column j: what the load side takes to accelerate joint j alone, from rest.
    """
    q = np.stack([np.interp(t, state.t, joint) for joint in state.q.T], axis=1)
    still = np.zeros_like(q)
    rest = replace(state_of_joints(state.geometry, t, q, still, still), nominal=state.nominal)
    return rest.torque_by_qdd - motor_side(state, np.eye(state.joints))


def told_part(state: State, torque: np.ndarray) -> np.ndarray:
    """Return a torque (n, J), N m, of a motion as far as `State.told_hz`.

    Beyond it drives answer encoder counts, so that motors move with what encoders misread. A load
    that swings would make a large torque of that little noise.
    """
    if len(state.t) < 2:
        return torque
    period = (state.t[-1] - state.t[0]) / (len(state.t) - 1)
    if state.told_hz * period >= FOLDED:
        return torque
    from scipy.signal import butter, sosfiltfilt  # slow to load, and seldom needed

    sections = butter(ORDER, state.told_hz, fs=1.0 / period, output='sos')
    reach = min(len(torque) - 1, round(3.0 / (state.told_hz * period)))
    return np.asarray(sosfiltfilt(sections, torque, axis=0, padlen=reach))


def one_a_joint(values: np.ndarray) -> np.ndarray:
    """Return shared coefficients (J, J) of values (J,): coefficient k is that of joint k."""
    return np.repeat(values[:, None], len(values), axis=1)
