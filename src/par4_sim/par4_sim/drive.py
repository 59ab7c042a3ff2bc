"""The drives: a P loop on joint velocity inside a PI loop on joint position (the paper's).

    speed = qd_ref + position_gain e + integral_gain integral(e), e = q_ref - q, limited
    command = velocity_gain (speed - qd) + tau_ff, limited

A joint whose speed or command is limited does not wind its integral up.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Drives

SPEEDS, COMMANDS = 0, 1
"""Which of the two limits was met, in the counts."""


@numba.njit(cache=True, error_model='numpy')
def control(gains, target, q, qd, state, saturated, command):
    """Write the command (4,), N m, after clipping.

    Args:
        gains: (6,) velocity, position and integral gain, limit of command and of speed, dt.
        target: q_ref, qd_ref, tau_ff (12,).
        q, qd: what the encoders tell (4,).
        state: integral of the position error, rad s, and feedforward torque, N m, (2, 4), moved on.
        saturated: counts (2,) of limited speeds and commands, raised.
        command: written.
    """
    velocity_gain, position_gain, integral_gain = gains[0], gains[1], gains[2]
    torque_limit, speed_limit, dt = gains[3], gains[4], gains[5]
    integral, feedforward = state[0], state[1]
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
        asked = target[4 + joint] + position_gain * error + integral_gain * integral[joint]
        speed = min(max(asked, -speed_limit), speed_limit)
        wanted = velocity_gain * (speed - qd[joint]) + target[8 + joint]
        command[joint] = min(max(wanted, -torque_limit), torque_limit)
        saturated[SPEEDS] += speed != asked
        saturated[COMMANDS] += command[joint] != wanted
        if speed == asked and command[joint] == wanted:
            integral[joint] += error * dt


class DriveLoops:
    """Four drives: reference and encoder readings in, torque command out.

    The velocity that they see is the one that the amplifier's own fine interpolation gives.

    Attributes:
        command: torque asked of the amplifiers after clipping (4,), N m; volts times gain.
        gains, state, counts: as `control` takes them.
    """

    def __init__(self, drives: Drives, torque_limit: float, dt: float) -> None:
        speed_limit = math.inf if drives.speed_limit is None else drives.speed_limit
        self.gains = np.array((drives.velocity_gain, drives.position_gain, drives.integral_gain,
                               torque_limit, speed_limit, dt))
        self.state, self.command = np.zeros((2, LEGS)), np.zeros(LEGS)
        self.counts = np.zeros(2, dtype=np.int64)

    @property
    def saturated_commands(self) -> int:
        """Count of clipped commands, each joint and step."""
        return int(self.counts[COMMANDS])

    @property
    def saturated_speeds(self) -> int:
        """Count of clipped speeds, each joint and step."""
        return int(self.counts[SPEEDS])

    def restart(self, holding: np.ndarray) -> None:
        """Begin settled: the integrals supply the command `holding` (4,), N m; counts stay."""
        per_torque = self.gains[0] * self.gains[2]
        self.state[0] = holding / per_torque if per_torque > 0.0 else 0.0
        self.state[1] = 0.0
        self.command[:] = holding

    def follow(self, target: np.ndarray, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Return `command` for the target (12,) = q_ref, qd_ref, tau_ff and readings (4,)."""
        control(self.gains, target, q, qd, self.state, self.counts, self.command)
        return self.command
