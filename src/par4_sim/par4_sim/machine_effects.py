"""What the effects of a model do to the simulated machine.

Written from the physics of each effect, apart from the regressors of `par4_dynamics.effects`:
tests hold one against the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from par4_dynamics.model import ActiveEffect, Model
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Robot
from par4_sim.friction import Friction
from par4_sim.machine import Machine


def machine_of_model(robot: Robot, model: Model) -> Machine:
    """Return the machine that `model` describes, its effects included.

    Raises:
        InputError: an effect that no simulated machine can have.
    """
    machine = Machine(
        robot.geometry, model.lumped_bodies(),
        Friction(model.values['coulomb_friction'], model.values['viscous_friction']))
    for active in model.effects:
        if active.effect.name not in _APPLY:
            raise InputError(f'effect {active.effect.name} cannot be simulated; those that can '
                             f'are {", ".join(_APPLY)}')
        machine = _APPLY[active.effect.name](machine, active)
    return machine


def _acting(active: ActiveEffect, name: str) -> np.ndarray:
    """Return a parameter (4,) that is zero on joints without the effect."""
    values = np.zeros(4)
    for joint in active.joints:
        values[joint] = active.values[name][joint]
    return values


def _torque_offset(machine: Machine, active: ActiveEffect) -> Machine:
    offset = _acting(active, 'offset')

    def load(time: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:  # noqa: ARG001
        return offset

    return replace(machine, loads=(*machine.loads, load))


def _stribeck(machine: Machine, active: ActiveEffect) -> Machine:
    velocity = np.ones(4)
    for joint in active.joints:
        velocity[joint] = active.values['stribeck_velocity'][joint]
    return replace(machine, friction=replace(
        machine.friction, stribeck_torque=_acting(active, 'stribeck_torque'),
        stribeck_velocity=velocity))


def _cogging(machine: Machine, active: ActiveEffect) -> Machine:
    amplitude, phase = _acting(active, 'amplitude'), active.values['phase']
    periods = active.values['periods']

    def load(time: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:  # noqa: ARG001
        return amplitude * np.sin(periods * q + phase)

    return replace(machine, loads=(*machine.loads, load))


def _distributed_rods(machine: Machine, active: ActiveEffect) -> Machine:
    mass = float(active.values['rod_mass'][active.joints[0]])
    if mass < 0:
        raise InputError(f'effect distributed_rods: rod_mass must not be negative, found {mass}')
    return replace(machine, bodies=replace(machine.bodies,
                                           rod_mass=machine.bodies.rod_mass + mass))


_APPLY: dict[str, Callable[[Machine, ActiveEffect], Machine]] = {
    'torque_offset': _torque_offset,
    'stribeck': _stribeck,
    'cogging': _cogging,
    'distributed_rods': _distributed_rods,
}
