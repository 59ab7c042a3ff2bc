"""The amplifiers as they truly are: what they deliver of the torque that is asked and recorded.

    i = command behind two first-order lags in series (the drives' `current_lag`, `time_constant`)
    delivered = i / ((1 + eps) (1 + sum of a sin(N q + phi))), kept within +-limit

The lag belongs to the current; gain error and ripple are those of the torque that a current makes,
the limit is that of the torque. The torque of a physics step is the mean over the step of what
the lags make of a command held since the step's beginning, which is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numba
import numpy as np

from par4_kinematics.geometry import LEGS


def _zeros() -> np.ndarray:
    return np.zeros(LEGS)


@dataclass(frozen=True)
class Amplifier:
    """What four amplifiers and motors do that their drives do not know; each (4,) but the lag.

    The ripple may have K orders; its three fields are then (4, K).

    Attributes:
        gain_error: eps. The true gain is G / (1 + eps): recorded = (1 + eps) delivered torque.
        ripple: a. The torque constant varies over the turn:
            recorded = (1 + sum over the orders of a sin(N q + phi)) delivered torque.
        ripple_periods: N, periods a turn of the arm.
        ripple_phase: phi, rad.
        time_constant: of a first-order lag from recorded to delivered torque, s, one for the
            machine; it adds to the drives' `current_lag`.
        torque_limit: the delivered torque stays within +-limit, N m, whatever is recorded.
    """

    gain_error: np.ndarray = field(default_factory=_zeros)
    ripple: np.ndarray = field(default_factory=_zeros)
    ripple_periods: np.ndarray = field(default_factory=_zeros)
    ripple_phase: np.ndarray = field(default_factory=_zeros)
    time_constant: float = 0.0
    torque_limit: np.ndarray = field(default_factory=lambda: np.full(LEGS, np.inf))

    @property
    def packed(self) -> np.ndarray:
        """(2 + 3 K, 4): all but the lag, as `deliver` takes it; a, N, phi of each order."""
        waves = np.stack([np.reshape(part, (LEGS, -1)) for part in (
            self.ripple, self.ripple_periods, self.ripple_phase)])  # (3, 4, K)
        return np.concatenate((
            np.stack([np.broadcast_to(part, (LEGS,)).astype(float) for part in (
                self.gain_error, self.torque_limit)]),
            waves.transpose(2, 0, 1).reshape(-1, LEGS)))


def lag_shares(first: float, second: float, dt: float) -> np.ndarray:
    """Return how two first-order lags in series move in a step of dt, (5,).

    With the command c held, both states differ from it by d_1, d_2 at the step's beginning. Then
    d_1 decays by shares[0]; d_2 becomes shares[1] d_1 + shares[2] d_2, and its mean over the step
    is shares[3] d_1 + shares[4] d_2.

    Args:
        first, second: time constants, s; 0 = none.
        dt: s.
    """
    if abs(first - second) <= 1e-6 * first:
        second = first * (1.0 + 1e-6)  # equal lags are a limit of unequal ones

    def left(constant: float) -> tuple[float, float]:
        if constant == 0.0:
            return 0.0, 0.0
        end = math.exp(-dt / constant)
        return end, constant / dt * (1.0 - end)

    (end_1, mean_1), (end_2, mean_2) = left(first), left(second)
    between = first / (first - second) if first > 0.0 else 0.0
    return np.array((end_1, between * (end_1 - end_2), end_2, between * (mean_1 - mean_2), mean_2))


@numba.njit(cache=True, error_model='numpy')
def deliver(amplifier, lag, currents, command, q, torque):
    """Write the mean torque of a step.

    Args:
        amplifier: Amplifier.packed.
        lag: `lag_shares`.
        currents: states of the two lags (2, 4), N m, moved to the end of the step.
        command: held during the step (4,), N m.
        q: position (4,), rad, in the middle of the step.
        torque: delivered (4,), N m, written.
    """
    for joint in range(4):
        asked = command[joint]
        first, second = currents[0, joint] - asked, currents[1, joint] - asked
        current = asked + lag[3] * first + lag[4] * second
        currents[0, joint] = asked + lag[0] * first
        currents[1, joint] = asked + lag[1] * first + lag[2] * second
        wave = 0.0
        for row in range(2, amplifier.shape[0], 3):
            wave += amplifier[row, joint] * math.sin(
                amplifier[row + 1, joint] * q[joint] + amplifier[row + 2, joint])
        true = current / ((1.0 + amplifier[0, joint]) * (1.0 + wave))
        limit = amplifier[1, joint]
        torque[joint] = min(max(true, -limit), limit)
