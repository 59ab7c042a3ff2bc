"""Drives in torque mode: the torque that comes is the command; the loops wait until none comes.

When torque is late or lost the loops take over with the command that was last given, and when it
is there again the difference between the two commands fades: neither jumps.
"""

from __future__ import annotations

import numba

from par4_sim.drives.controller import (
    CARRIED,
    COMMANDS,
    FEEDFORWARD,
    INTEGRAL,
    LIMITED,
    TORQUE,
    hand_over,
)
from par4_sim.drives.drive import DriveLoops, control


@numba.njit(cache=True, error_model='numpy')
def torque_mode(gains, target, q, qd, state, saturated, command):
    """Write the command (4,), N m, after clipping; see `control` for the arguments."""
    per_torque, torque_limit, dt = gains[0] * gains[2], gains[3], gains[5]
    had, has = False, False
    for joint in range(4):
        had = had or state[FEEDFORWARD, joint] != 0.0
        has = has or target[8 + joint] != 0.0
    if had and not has:
        for joint in range(4):  # the loops begin with what their errors ask taken off
            asked = gains[0] * (target[4 + joint] + gains[1] * (target[joint] - q[joint])
                                - qd[joint])
            if per_torque > 0.0:
                state[INTEGRAL, joint] = -asked / per_torque
            else:
                state[CARRIED, joint] -= asked
    if not (had and has):
        control(gains, target, q, qd, state, saturated, command)
        if has:
            for joint in range(4):
                state[CARRIED, joint] = command[joint] - target[16 + joint]
        return
    hand_over(target, state, per_torque, dt)
    for joint in range(4):
        wanted = target[16 + joint] + state[CARRIED, joint]
        command[joint] = min(max(wanted, -torque_limit), torque_limit)
        saturated[COMMANDS] += command[joint] != wanted
        saturated[LIMITED] += command[joint] != wanted


class TorqueMode(DriveLoops):
    """Drives that pass torques on; without torque, the paper's loops."""

    number = TORQUE
