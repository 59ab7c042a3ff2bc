"""Clean machines: robots, rigid bodies and friction as a shop would have them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.model_from_file import read_model
from par4_kinematics.robot import Robot
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine import Machine
from robots import OTHER, REFERENCE, other_model


@dataclass(frozen=True)
class Known:
    """What is known of a machine, and the machine that is just that.

    Attributes:
        name: 'reference', 'other' or 'other friction'.
        robot, model: geometry and (20) with Coulomb and viscous friction.
        machine: that obeys them.
    """

    name: str
    robot: Robot
    model: Model
    machine: Machine


def known_machine(name: str, random: np.random.Generator | None = None) -> Known:
    """Return a clean machine; 'other friction' draws that of a random robot."""
    robot = {'reference': REFERENCE, 'other': OTHER}.get(name)
    if robot is None:
        robot = REFERENCE if random.uniform() < 0.5 else OTHER
    model = read_model('table1', REFERENCE) if robot is REFERENCE else other_model()
    if name == 'other friction':
        coulomb, viscous = random.uniform(0.4, 2.0, 2)
        model = replace(model, values={
            **model.values,
            'coulomb_friction': coulomb * model.values['coulomb_friction'],
            'viscous_friction': viscous * model.values['viscous_friction']})
    friction = Friction(model.values['coulomb_friction'], model.values['viscous_friction'])
    return Known(name, robot, model, Machine(robot.geometry, model.lumped_bodies(), friction))
