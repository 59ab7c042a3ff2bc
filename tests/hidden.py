"""Machines with a hidden effect, made from physics; nothing here is shared with the diagnosis.

The plant gets forces and friction laws directly. What the effect looks like in a regressor is the
diagnosis's business.
"""

from __future__ import annotations

import cmath
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.model import Model, read_model
from par4_kinematics.robot import Robot
from par4_sim.friction import Friction
from par4_sim.machine import Machine
from robots import OTHER, REFERENCE, other_model


@dataclass(frozen=True)
class Hidden:
    """A machine and what is hidden in it.

    Attributes:
        robot, model: what is known: geometry and the model without the effect.
        machine: what is simulated.
        effect: name of the hidden effect, None for a clean machine.
        joints: where it acts.
        truth: its size by parameter.
    """

    robot: Robot
    model: Model
    machine: Machine
    effect: str | None
    joints: tuple[int, ...]
    truth: dict[str, object]


def clean(robot: Robot) -> Hidden:
    """Return a machine that obeys (20) with Coulomb and viscous friction."""
    model = read_model('table1', REFERENCE) if robot is REFERENCE else other_model()
    friction = Friction(model.values['coulomb_friction'], model.values['viscous_friction'])
    machine = Machine(robot.geometry, model.lumped_bodies(), friction)
    return Hidden(robot, model, machine, None, (), {})


def offset_machine(robot: Robot, random: np.random.Generator) -> Hidden:
    """A constant load on one to four joints: a biased amplifier."""
    base, joints = clean(robot), some_joints(random)
    level = np.zeros(4)
    level[list(joints)] = random.choice((-1, 1), len(joints)) * random.uniform(
        0.15, 0.5, len(joints))

    def load(time, q, qd):  # noqa: ARG001
        return level

    return replace(base, machine=loaded(base.machine, load),
                   effect='torque_offset', joints=joints, truth={'offset': level})


def stribeck_machine(robot: Robot, random: np.random.Generator) -> Hidden:
    """Breakaway friction 30 to 60 % above the Coulomb level, gone at a few tenths of a rad/s."""
    base = clean(robot)
    rise = random.uniform(0.3, 0.6) * base.model.values['coulomb_friction']
    speed = random.uniform(0.05, 0.25)
    friction = replace(base.machine.friction, stribeck_torque=rise,
                       stribeck_velocity=np.full(4, speed))
    return replace(base, machine=replace(base.machine, friction=friction), effect='stribeck',
                   joints=(0, 1, 2, 3), truth={'stribeck_torque': rise, 'stribeck_velocity': speed})


def cogging_machine(robot: Robot, random: np.random.Generator) -> Hidden:
    """A torque that returns every slot of the motor: rotating phasors, whole slots a turn."""
    base, joints = clean(robot), some_joints(random)
    slots = int(random.integers(10, 80))
    phasors = np.zeros(4, dtype=complex)
    for joint in joints:
        phasors[joint] = random.uniform(0.15, 0.6) * cmath.exp(1j * random.uniform(-3.0, 3.0))

    def load(time, q, qd):  # noqa: ARG001
        return (phasors * np.exp(1j * slots * np.asarray(q))).imag

    return replace(base, machine=loaded(base.machine, load), effect='cogging', joints=joints,
                   truth={'amplitude': np.abs(phasors), 'periods': slots,
                          'phase': np.angle(phasors)})


def rods_machine(robot: Robot, random: np.random.Generator) -> Hidden:
    """Heavy rods whose mass lies along them: the kinetic energy of slender rods."""
    base = clean(robot)
    mass = random.uniform(0.04, 0.08)
    return replace(base, machine=replace(base.machine, bodies=replace(
        base.machine.bodies, rod_mass=mass)), effect='distributed_rods', joints=(0, 1, 2, 3),
        truth={'rod_mass': mass})


def some_joints(random: np.random.Generator) -> tuple[int, ...]:
    """Return all joints, or one or two of them."""
    if random.uniform() < 0.5:
        return (0, 1, 2, 3)
    return tuple(sorted(random.choice(4, size=random.integers(1, 3), replace=False).tolist()))


def loaded(machine: Machine, load) -> Machine:
    """Return the machine with a further load on its drives."""
    return replace(machine, loads=(*machine.loads, load))


def with_coloured_noise(hidden: Hidden, level: float, random: np.random.Generator) -> Hidden:
    """Add a load that wanders by itself (a first order process of 30 ms), N m rms."""
    step, memory = 1e-3, 0.03
    keep = np.exp(-step / memory)
    noise = np.zeros((60_000, 4))
    for row in range(1, len(noise)):
        noise[row] = keep * noise[row - 1] + np.sqrt(1 - keep ** 2) * random.standard_normal(4)

    def load(time, q, qd):  # noqa: ARG001
        return level * noise[int(time / step) % len(noise)]

    return replace(hidden, machine=loaded(hidden.machine, load))


HIDERS = {'torque_offset': offset_machine, 'stribeck': stribeck_machine,
          'cogging': cogging_machine, 'distributed_rods': rods_machine}


def draw(effect: str | None, seed: int) -> Hidden:
    """Return the machine that `seed` draws for an effect, or a clean one."""
    random = np.random.default_rng((seed, 17))
    robot = REFERENCE if random.uniform() < 0.6 else OTHER
    return clean(robot) if effect is None else HIDERS[effect](robot, random)
