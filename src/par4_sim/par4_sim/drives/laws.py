"""The laws of the drives by name, and by number inside the compiled control step."""

from __future__ import annotations

import numba

from par4_dynamics.model import Model
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Robot
from par4_sim.choices import LAWS
from par4_sim.drives.computed_torque import ComputedTorque, computed_torque
from par4_sim.drives.controller import COMPUTED_TORQUE, TORQUE, Controller
from par4_sim.drives.drive import DriveLoops, control
from par4_sim.drives.predictive import Predictive
from par4_sim.drives.torque_mode import TorqueMode, torque_mode

KNOWING: dict[str, type[ComputedTorque]] = {
    'computed_torque': ComputedTorque, 'predictive': Predictive}
"""Laws that know a model."""


@numba.njit(cache=True, error_model='numpy')
def command_of(law, target, q, qd, state, saturated, command):
    """Write the command (4,), N m, of a law.

    Args:
        law: of `Controller.law`.
        target: (TARGET,).
        q, qd: what the encoders tell (4,).
        state, saturated: of the controller, moved on and raised.
        command: written.
    """
    number, gains, geometry, bodies = law
    if number == COMPUTED_TORQUE:
        computed_torque(gains, geometry, bodies, target, q, qd, state, saturated, command)
    elif number == TORQUE:
        torque_mode(gains, target, q, qd, state, saturated, command)
    else:
        control(gains, target, q, qd, state, saturated, command)


def controller_named(name: str, robot: Robot, torque_limit: float, dt: float,
                     model: Model | None = None) -> Controller:
    """Return a controller.

    Args:
        name: of LAWS.
        robot: its drives and nominal geometry.
        torque_limit: of the commands, N m.
        dt: s between commands.
        model: what the law knows of the machine; those of KNOWING need it.

    Raises:
        InputError: unknown name, or a law without the model it needs.
    """
    if name == 'loops':
        return DriveLoops(robot.drives, torque_limit, dt)
    if name == 'torque':
        return TorqueMode(robot.drives, torque_limit, dt)
    if name not in KNOWING:
        raise InputError(f'controller {name!r} asked; known are {", ".join(LAWS)}')
    if model is None:
        raise InputError(f'controller {name}: it needs a model, found none; give one')
    return KNOWING[name](robot, model, torque_limit, dt)
