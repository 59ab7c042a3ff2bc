"""Experiments on simulated machines with effects, and the physics by hand that predicts them.

Nothing here comes from the effects of `par4_dynamics` or from `par4_sim`: only inverse kinematics,
masses on points, and finite differences.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.model_file import EffectEntry, read_model_file
from par4_dynamics.model_from_file import build_model
from par4_dynamics.state import GRAVITY, state_of_joints
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.geometry import Geometry
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Robot
from par4_sim.closed_loop.simulation import Simulation, build_plant
from par4_sim.machines.machine import Machine
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.plants.plant import Plant
from robots import REFERENCE

FIDELITIES = ('exact', 'fast', 'accurate')
HOME = np.array((0.0, 0.0, -0.78, 0.0))
ASIDE = np.array((0.12, -0.09, -0.72, 0.35))
LEVEL = np.array((0.0, 0.0, 1.0))
TABLE = {name: float(np.mean(item.value))
         for name, item in read_model_file('table1').parameters.items()}
"""TABLE 1 by name."""
IDEAL = REFERENCE.model_copy(update={
    'drives': REFERENCE.drives.model_copy(update={'encoder_counts': 0})})
"""The reference robot with ideal encoders."""


# ------------------------------------------------------------------------------- machines


def entry(name: str, joints: tuple[int, ...] | None = None, unit: str = '', **values
          ) -> EffectEntry:
    """Return an effect as a model file has it."""
    return EffectEntry(effect=name, joints=joints, parameters={
        key: {'value': value, 'unit': unit} for key, value in values.items()})


def model_of(*entries: EffectEntry, robot: Robot = REFERENCE, friction: bool = True,
             **base) -> Model:
    """Return TABLE 1 with effects, other base parameters, with or without joint friction."""
    if not friction:
        base = {'coulomb_friction': 0.0, 'viscous_friction': 0.0} | base
    content = read_model_file('table1')
    parameters = content.parameters | {
        name: content.parameters[name].model_copy(update={'value': value})
        for name, value in base.items()}
    return build_model(robot, content.model_copy(update={'parameters': parameters,
                                                         'effects': entries}))


def machine_of(*entries: EffectEntry, robot: Robot = REFERENCE, **options) -> Machine:
    """Return the machine of `model_of`."""
    return machine_of_model(robot, model_of(*entries, robot=robot, **options))


@contextmanager
def plant_of(machine: Machine, fidelity: str, x: np.ndarray = HOME) -> Iterator[Plant]:
    """Yield the plant at rest at x and close it after."""
    plant = build_plant(machine, fidelity)
    try:
        plant.reset(x)
        yield plant
    finally:
        plant.close()


# ------------------------------------------------------------------------- physics by hand


def second_point(geometry: Geometry, x: np.ndarray) -> np.ndarray:
    """Return D' (3,), m: the other end of the bar h, which turns with theta."""
    h = geometry.platform_bar_length
    return x[:3] + h * np.array((-np.sin(x[3]), np.cos(x[3]), 0.0))


def outward(geometry: Geometry) -> np.ndarray:
    """Return the horizontal directions of the legs (4, 3)."""
    azimuth = np.array(geometry.actuator_azimuth)
    return np.stack((np.cos(azimuth), np.sin(azimuth), np.zeros(4)), axis=1)


def arm_lines(geometry: Geometry, x: np.ndarray) -> np.ndarray:
    """Return the directions of the arms from axis to elbow (4, 3): q is positive downwards."""
    q = inverse_kinematics(geometry, x)[:, None]
    return np.cos(q) * outward(geometry) - np.sin(q) * LEVEL


def rods(geometry: Geometry, x: np.ndarray) -> np.ndarray:
    """Return the vectors from elbow to plate joint (4, 3), m."""
    radial = outward(geometry)
    elbow = geometry.base_radius * radial + np.array(geometry.arm_lengths)[:, None] * arm_lines(
        geometry, x)
    across = 0.5 * geometry.platform_bar_length * np.array((0.0, 1.0, 0.0))
    plate = geometry.platform_radius * radial
    plate[:2] += second_point(geometry, x) - across
    plate[2:] += x[:3] + across
    return plate - elbow


def weight_energy(x: np.ndarray, geometry: Geometry = REFERENCE.geometry, up: np.ndarray = LEVEL,
                  mass_1: float = TABLE['platform_mass_1'],
                  mass_2: float = TABLE['platform_mass_2']) -> float:
    """Return the potential energy, J, of plate masses and arms; `up` as seen from the base."""
    return float(GRAVITY * (mass_1 * x[:3] + mass_2 * second_point(geometry, x)) @ up
                 + TABLE['arm_gravity'] * np.sum(arm_lines(geometry, x) @ up))


def rate(quantity: Callable[[np.ndarray], np.ndarray], x: np.ndarray, step: float = 1e-5
         ) -> np.ndarray:
    """Return d quantity / dx by central differences, (4, ...)."""
    return np.array([(np.asarray(quantity(x + step * unit)) - np.asarray(quantity(x - step * unit)))
                     / (2.0 * step) for unit in np.eye(4)])


def gradient(potential: Callable[[np.ndarray], float], x: np.ndarray,
             geometry: Geometry = REFERENCE.geometry) -> np.ndarray:
    """Return the joint torques (4,), N m, that hold against a potential energy of the pose."""
    turns = rate(lambda pose: inverse_kinematics(geometry, pose), x)
    return np.linalg.solve(turns, rate(potential, x))


def joint_inertia(x: np.ndarray, mass_1: float = TABLE['platform_mass_1'],
                  mass_2: float = TABLE['platform_mass_2'], theta: float = 0.0,
                  actuator=TABLE['actuator_inertia'], rod: float = 0.0) -> np.ndarray:
    """Return the mass matrix (4, 4), kg m2, at the joints, from velocities of points.

    A rod as a slender bar has m/12 |v_B - v_A|^2 less kinetic energy than its two end masses.
    """
    geometry = REFERENCE.geometry
    parts = [(mass_1, lambda pose: pose[:3]), (theta, lambda pose: pose[3:]),
             (mass_2, lambda pose: second_point(geometry, pose)),
             (np.broadcast_to(actuator, 4), lambda pose: inverse_kinematics(geometry, pose)),
             (-2.0 * rod / 6.0, lambda pose: rods(geometry, pose).ravel())]
    inertia = 0.0
    for weight, place in parts:
        velocity = rate(place, x)
        inertia = inertia + velocity @ (np.asarray(weight)[..., None] * velocity.T)
    pose_of_joint = np.linalg.inv(rate(lambda pose: inverse_kinematics(geometry, pose), x))
    return pose_of_joint @ inertia @ pose_of_joint.T


def rotation(axis: int, angle: float) -> np.ndarray:
    """Return the rotation (3, 3) of a body by `angle`, rad, about a coordinate axis."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[first, first] = matrix[second, second] = np.cos(angle)
    matrix[second, first], matrix[first, second] = np.sin(angle), -np.sin(angle)
    return matrix


# ----------------------------------------------------------------------------- experiments


def guided(plant: Plant, travel: Callable[[float], tuple[np.ndarray, np.ndarray]], duration: float,
           stiffness: float = 4000.0, damping: float = 40.0
           ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q, qd, torque (n, 4) of joints led along `travel` (t -> dq, qd) by strong springs.

    q and qd are those of the middle of the step in which the torque acted.
    """
    start, told = plant.q, []
    for step in range(round(duration / plant.dt)):
        dq, qd = travel(step * plant.dt)
        before = plant.q
        torque = stiffness * (start + dq - before) + damping * (qd - plant.qd)
        plant.step(torque)
        told.append((0.5 * (before + plant.q), (plant.q - before) / plant.dt, torque))
    return tuple(np.array(part) for part in zip(*told))


def ramp(speed: np.ndarray, rise: float = 0.03) -> Callable[[float], tuple[np.ndarray, np.ndarray]]:
    """Return the travel that goes smoothly over to a constant speed (4,), rad/s."""
    speed = np.broadcast_to(speed, (4,)).astype(float)

    def travel(t):
        if t >= rise:
            return speed * (t - 0.5 * rise), speed
        angle = np.pi * t / rise
        return (speed * (0.5 * t - 0.5 * rise / np.pi * np.sin(angle)),
                0.5 * speed * (1.0 - np.cos(angle)))

    return travel


MOTION = excitation_motion(REFERENCE, 4.0, seed=5, acceleration=60.0)
START = 0.05


def played(simulation: Simulation, known: Model | None = None, duration: float = 4.0,
           slow: float = 1.0) -> dict[str, np.ndarray]:
    """Return what is told, by name (n, ...), while the excitation runs; closes the simulation.

    Args:
        simulation: at rest at home.
        known: model whose torques the drives get, or None.
        duration: of the record, s.
        slow: by how much slower the excitation is.
    """
    t = slow * MOTION.t
    motion = (MOTION.q, MOTION.qd / slow, MOTION.qdd / slow ** 2)
    simulation.queue_reference(START + t, *motion)
    if known is not None:
        geometry = REFERENCE.geometry
        simulation.queue_effort(START + t, known.torque(state_of_joints(geometry, t, *motion)))
    period = simulation.sample_period
    told = vars(simulation.next_samples(round(duration / period)))
    simulation.close()
    return told | {'t': 1e-9 * (told['time_ns'] - told['time_ns'][0])}


def changed(machine: Machine, part: str, **fields) -> Machine:
    """Return the machine with fields of one of its parts replaced, as code switches effects on."""
    return replace(machine, **{part: replace(getattr(machine, part), **fields)})
