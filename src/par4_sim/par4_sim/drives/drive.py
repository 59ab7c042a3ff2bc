"""The drives' own loops: P on joint velocity inside PI on joint position (the paper's).

    speed = qd_ref + position_gain e + integral_gain integral(e), e = q_ref - q, limited
    command = velocity_gain (speed - qd) + tau_ff, limited

A joint whose speed or command is limited does not wind its integral up.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.robot import Drives
from par4_sim.drives.controller import (
    CARRIED,
    COMMANDS,
    INTEGRAL,
    LIMITED,
    LOOPS,
    SPEEDS,
    Controller,
    hand_over,
)


@numba.njit(cache=True, error_model='numpy')
def control(gains, target, q, qd, state, saturated, command):
    """Write the command (4,), N m, after clipping.

    Args:
        gains: (6,) velocity, position and integral gain, limit of command and of speed, dt.
        target: (TARGET,); its accelerations are not used.
        q, qd: what the encoders tell (4,).
        state: rows of `Controller`, the integral in rad s, (4, 4), moved on.
        saturated: counts (3,) of limited speeds, of limited commands and of either, raised.
        command: written.
    """
    velocity_gain, position_gain, integral_gain = gains[0], gains[1], gains[2]
    torque_limit, speed_limit, dt = gains[3], gains[4], gains[5]
    integral = state[INTEGRAL]
    hand_over(target, state, velocity_gain * integral_gain, dt)
    for joint in range(4):
        error = target[joint] - q[joint]
        asked = target[4 + joint] + position_gain * error + integral_gain * integral[joint]
        speed = min(max(asked, -speed_limit), speed_limit)
        wanted = (velocity_gain * (speed - qd[joint]) + target[16 + joint]
                  + state[CARRIED, joint])
        command[joint] = min(max(wanted, -torque_limit), torque_limit)
        saturated[SPEEDS] += speed != asked
        saturated[COMMANDS] += command[joint] != wanted
        if speed == asked and command[joint] == wanted:
            integral[joint] += error * dt
        else:
            saturated[LIMITED] += 1


class DriveLoops(Controller):
    """The paper's loops, with the gains of the robot file.

    On a joint that feels the inertia M they place the poles of M s^3 + velocity_gain
    (s^2 + position_gain s + integral_gain): `par4_sim.tracking.stability` says where these lie.
    """

    number = LOOPS

    def __init__(self, drives: Drives, torque_limit: float, dt: float) -> None:
        speed_limit = math.inf if drives.speed_limit is None else drives.speed_limit
        super().__init__(np.array((drives.velocity_gain, drives.position_gain,
                                   drives.integral_gain, torque_limit, speed_limit, dt)))

    @property
    def per_torque(self) -> float:
        """What one unit of the integral makes, N m/(rad s)."""
        return self.gains[0] * self.gains[2]

    def follow(self, target: np.ndarray, q: np.ndarray, qd: np.ndarray) -> np.ndarray:
        """Return `command` for the target (TARGET,) and readings q, qd (4,)."""
        control(self.gains, target, q, qd, self.state, self.counts, self.command)
        return self.command
