"""Computed torque: the model turns errors into torque, whatever the pose, on top of feedforward.

    a = qdd_ref + damping edot + stiffness e + c, e = q_ref - q
    command = tau_ff + I + D(q, qd, a) - D(q_ref, qd_ref, qdd_ref), limited
    dI/dt = M(q) integral e

c is 0 but where `par4_sim.drives.predictive` corrects for limits that lie ahead.
D(q, qd, qdd) is the torque of the model's rigid bodies without friction, M its inertia matrix.
tau_ff is the torque of the whole model, effects included, along the reference; it comes as every
feedforward does. With the model right, e obeys eddot + damping edot + stiffness e + ... = 0 at
every pose. Without feedforward what is left is a decoupled loop, which the integral holds.

The gains place the poles where the drives' own loops have them on the mean inertia of the home
pose: damping = velocity_gain / M, stiffness = damping position_gain, integral = damping
integral_gain. So a comparison with the loops compares laws, not bandwidths.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_dynamics.mechanism import joint_mass_matrix
from par4_dynamics.model import Model
from par4_dynamics.rigid_body import torque_of_joints_sample
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose
from par4_sim.drives.controller import (
    CARRIED,
    COMMANDS,
    COMPUTED_TORQUE,
    CORRECTION,
    INTEGRAL,
    LIMITED,
    Controller,
    hand_over,
)


@numba.njit(cache=True, error_model='numpy')
def computed_torque(gains, geometry, bodies, target, q, qd, state, saturated, command):
    """Write the command (4,), N m, after clipping; without feedback where no pose fits q.

    Args:
        gains: (6,) damping 1/s, stiffness 1/s2, integral 1/s3, limit of command, unused, dt.
        geometry, bodies: of `Geometry.packed` and `Model.rigid_table`.
        target: (TARGET,).
        q, qd: what the encoders tell (4,).
        state: rows of `Controller`, the integral in N m, (4, 4), moved on.
        saturated: counts (3,), raised.
        command: written.
    """
    damping, stiffness, integral = gains[0], gains[1], gains[2]
    torque_limit, dt = gains[3], gains[5]
    hand_over(target, state, 1.0 if integral > 0.0 else 0.0, dt)
    motions, torques = np.empty((3, 3, 4)), np.empty((3, 4))
    for joint in range(4):
        motions[0, 0, joint], motions[0, 1, joint] = target[joint], target[4 + joint]
        motions[1:, 0, joint], motions[1:, 1, joint] = q[joint], qd[joint]
        error = target[joint] - q[joint]
        asked = (target[12 + joint] + damping * (target[4 + joint] - qd[joint])
                 + stiffness * error + state[CORRECTION, joint])
        motions[0, 2, joint] = target[12 + joint]
        motions[1, 2, joint], motions[2, 2, joint] = asked, asked + integral * error
    finite = True
    for row in range(3):
        finite = torque_of_joints_sample(geometry, bodies, motions[row], torques[row]) and finite
    if not finite:
        torques[:] = 0.0
    for joint in range(4):
        wanted = (target[16 + joint] + state[INTEGRAL, joint] + state[CARRIED, joint]
                  + torques[1, joint] - torques[0, joint])
        command[joint] = min(max(wanted, -torque_limit), torque_limit)
        saturated[COMMANDS] += command[joint] != wanted
        saturated[LIMITED] += command[joint] != wanted
        if command[joint] == wanted and state[CORRECTION, joint] == 0.0:
            state[INTEGRAL, joint] += (torques[2, joint] - torques[1, joint]) * dt


class ComputedTorque(Controller):
    """Computed torque with a model's rigid bodies.

    Args:
        robot: nominal geometry, and the loops whose poles are taken over.
        model: whose rigid bodies are known.
        torque_limit: of the commands, N m.
        dt: s.

    Raises:
        InputError: a model whose joints feel no inertia.
    """

    number = COMPUTED_TORQUE

    def __init__(self, robot: Robot, model: Model, torque_limit: float, dt: float) -> None:
        drives = robot.drives
        damping = drives.velocity_gain / mean_inertia(robot, model)
        super().__init__(
            np.array((damping, damping * drives.position_gain, damping * drives.integral_gain,
                      torque_limit, math.inf, dt)),
            robot.geometry.packed, model.rigid_table)

    @property
    def per_torque(self) -> float:
        """What one unit of the integral makes, N m; 0 without an integral."""
        return 1.0 if self.gains[2] > 0.0 else 0.0


def mean_inertia(robot: Robot, model: Model) -> float:
    """Return the mean of the inertia that a joint feels at home, kg m2: trace of M over four.

    Raises:
        InputError: a model whose joints feel none.
    """
    mass = joint_mass_matrix(robot.geometry, model.lumped_bodies(), home_pose(robot))
    inertia = float(np.trace(mass)) / LEGS
    if not inertia > 0.0:
        raise InputError(f'computed torque divides by the inertia of a joint at home; the model '
                         f'has {inertia:.4g} kg m2, expected more than 0; give it an '
                         f'actuator_inertia or platform masses')
    return inertia
