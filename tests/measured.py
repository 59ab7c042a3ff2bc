"""Logs of simulated machines for tests of identification and diagnosis."""

from __future__ import annotations

from functools import cache

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints, state_of_platform
from par4_identification.logs.log import Log
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose
from par4_sim.closed_loop.simulation import Simulation, build_plant
from par4_sim.machines.machine import Machine
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.machines.noise import Noise
from robots import OTHER, REFERENCE

DWELL = 0.5
ROBOTS = {robot.name: robot for robot in (REFERENCE, OTHER)}


@cache
def excitation(robot_name: str, duration: float, seed: int) -> Motion:
    """Return the quasi-random excitation of a robot; made once."""
    return excitation_motion(ROBOTS[robot_name], duration=duration, seed=seed)


def holding_torque(robot: Robot, model: Model) -> np.ndarray:
    """Return the torque (4,), N m, that holds the machine at home."""
    still = np.zeros((1, 4))
    return model.torque(state_of_platform(robot.geometry, np.zeros(1), home_pose(robot)[None],
                                          still, still))[0]


def simulation_of(robot: Robot, machine: Machine, model: Model, seed: int, noise: float,
                  noise_time: float = 0.0) -> Simulation:
    """Return a simulation of `machine`, whose drives rest with the torque of `model`."""
    return Simulation(robot, build_plant(machine, 'exact'), 1e-3, robot.drives.torque_limit,
                      holding_torque(robot, model), machine.amplifier, machine.sensors,
                      Noise(torque_noise=noise, correlation_time=noise_time), seed)


def log_of_machine(robot: Robot, machine: Machine, model: Model, *, duration: float = 10.0,
                   seed: int = 0, noise: float = 0.05, noise_time: float = 0.0,
                   feedforward: bool = False, name: str | None = None) -> Log:
    """Return the log of an excitation on `machine`; `model` is what its drives know of it."""
    motion = excitation(robot.name, duration, seed)
    simulation = simulation_of(robot, machine, model, seed, noise, noise_time)
    start = simulation.time + DWELL
    simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
    if feedforward:
        state = state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)
        simulation.queue_effort(start + motion.t, model.torque(state))
    told = simulation.next_samples(round((motion.duration + 2 * DWELL) / 1e-3))
    return Log(name=name or f'{robot.name} {seed}', joint_names=robot.joint_names,
               start_stamp=int(told.time_ns[0]), period=1e-3,
               t=np.arange(len(told.q)) * 1e-3, q=told.q, tau=told.effort,
               segments=(slice(0, len(told.q)),), reference=None, accounts=None)


def log_of_model(robot: Robot, model: Model, **options) -> Log:
    """Return the log of an excitation on the machine that `model` describes."""
    return log_of_machine(robot, machine_of_model(robot, model), model, **options)
