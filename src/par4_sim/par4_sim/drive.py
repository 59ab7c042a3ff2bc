"""The drives: a P loop on joint velocity inside a PI loop on joint position (the paper's)."""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Drives


@numba.njit(cache=True, error_model='numpy')
def _command(target, q, qd, integral, feedforward, torque, velocity_gain, position_gain,
             integral_gain, limit, dt, follow, command):
    """Write the clipped command (4,) and the delivered torque (4,); return clipped joints."""
    clipped = 0
    had, has = False, False
    for joint in range(4):
        had = had or feedforward[joint] != 0.0
        has = has or target[8 + joint] != 0.0
    per_torque = velocity_gain * integral_gain
    for joint in range(4):
        if had != has and per_torque > 0.0:
            # feedforward that sets in or stops is handed over by the integral without a jump
            integral[joint] += (feedforward[joint] - target[8 + joint]) / per_torque
        feedforward[joint] = target[8 + joint]
    for joint in range(4):
        error = target[joint] - q[joint]
        speed = target[4 + joint] + position_gain * error + integral_gain * integral[joint]
        wanted = velocity_gain * (speed - qd[joint]) + target[8 + joint]
        command[joint] = min(max(wanted, -limit), limit)
        if command[joint] == wanted:
            integral[joint] += error * dt
        else:  # a saturated loop must not wind up
            clipped += 1
        torque[joint] += follow * (command[joint] - torque[joint])
    return clipped


class DriveLoops:
    """Four drives: reference in, torque out.

    The loops see the encoder's counts and the velocity that the amplifier's own fine
    interpolation gives, taken as ideal.

    Attributes:
        command: torque asked of the amplifiers after clipping (4,), N m; volts times gain.
        torque: torque delivered behind the current lag (4,), N m.
        saturated: count of clipped commands.
    """

    def __init__(self, drives: Drives, torque_limit: float, dt: float) -> None:
        self.saturated = 0
        self._drives = drives
        self._limit = torque_limit
        self._dt = dt
        self._follow = (1.0 if drives.current_lag == 0.0
                        else 1.0 - math.exp(-dt / drives.current_lag))
        self._resolution = (2.0 * math.pi / drives.encoder_counts if drives.encoder_counts
                            else 0.0)
        self.restart(np.zeros(LEGS))

    def restart(self, holding: np.ndarray) -> None:
        """Begin settled: the integrals supply the torque `holding` (4,), N m; the count stays."""
        per_torque = self._drives.velocity_gain * self._drives.integral_gain
        self._integral = (holding / per_torque if per_torque > 0.0 else np.zeros(LEGS))
        self._feedforward = np.zeros(LEGS)
        self.command, self.torque = holding.copy(), holding.copy()

    def encoder(self, q: np.ndarray) -> np.ndarray:
        """Return the joint positions (4,), rad, that the encoders count."""
        if self._resolution == 0.0:
            return q
        return np.round(q / self._resolution) * self._resolution

    def follow(self, target: np.ndarray, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Return the torque (4,), N m, for target (12,) = q_ref, qd_ref, tau_ff; see `encoder`."""
        drives = self._drives
        self.saturated += _command(
            target, q, qd, self._integral, self._feedforward, self.torque, drives.velocity_gain,
            drives.position_gain, drives.integral_gain, self._limit, self._dt, self._follow,
            self.command)
        return self.torque
