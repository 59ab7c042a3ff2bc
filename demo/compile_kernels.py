"""Compile the numeric kernels in two processes, so that no later command waits for that.

Numba keeps what it compiled beside the sources. Each job calls what a user will call, for a moment.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from par4_dynamics import (
    EffectEntry,
    Model,
    build_model,
    read_model,
    read_model_file,
    state_of_joints,
)
from par4_dynamics.mechanism import joint_mass_matrix
from par4_identification import Log, diagnose, read_log
from par4_kinematics import read_robot
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.ros.serialised_trajectory import SerialisedTrajectory, serialised_rest
from par4_kinematics.velocity import jacobian_rate
from par4_sim import build_simulation, simulate_to_bag
from par4_sim.ros.compiled_limits import compiled_limits

ROBOT = read_robot('reference')
MODEL = read_model('table1', ROBOT)
MOTION = excitation_motion(ROBOT, 6.0, seed=1)


def soft(joints: int) -> Model:
    """Return a model with soft transmissions on the first joints."""
    springs = EffectEntry(effect='elastic_transmission', joints=tuple(range(joints)), parameters={
        'stiffness': {'value': 1e4, 'unit': 'N m/rad'}})
    return build_model(ROBOT, read_model_file('table1').model_copy(update={'effects': (springs,)}))


def mechanics() -> None:
    """Compile what commands and nodes read a motion with."""
    geometry = ROBOT.geometry
    jacobian_rate(geometry, MOTION.x[:2], MOTION.xd[:2])
    joint_mass_matrix(geometry, MODEL.lumped_bodies(), MOTION.x[:2])
    compiled_limits(ROBOT)
    for count in (1, 2):
        message = SerialisedTrajectory(serialised_rest(MOTION.q[0], count))
        points = message.read()
        message.with_effort(points.q)
        MODEL.torque_of_joints(geometry, points.q[0], points.qd[0], points.qdd[0], 0.0)


def diagnosis() -> None:
    """Compile what a diagnosis computes with, on torque that the model itself asks for."""
    state = state_of_joints(ROBOT.geometry, MOTION.t, MOTION.q, MOTION.qd, MOTION.qdd)
    for joints in range(1, 5):  # each number is compiled by itself
        soft(joints).torque(state)
    torque = MODEL.torque(state)
    noisy = torque + 0.1 * np.random.default_rng(1).standard_normal(torque.shape)
    diagnose([Log(name='torque', joint_names=ROBOT.joint_names, start_stamp=0,
                  period=MOTION.period, t=MOTION.t, q=MOTION.q, tau=noisy,
                  segments=(slice(0, len(MOTION.t)),), reference=None, accounts=None)], ROBOT)


def simulation() -> None:
    """Compile the simulated machine, with soft transmissions and drives that look ahead too."""
    _sample(MODEL, law='predictive')
    _sample(MODEL, 'fast')
    _sample(soft(4))
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        simulate_to_bag(build_simulation(ROBOT, MODEL, 'exact'),
                        MOTION, ROBOT, bag)
        read_log(bag, ROBOT)


def _sample(model: Model, fidelity: str = 'exact', law: str = 'loops') -> None:
    machine = build_simulation(ROBOT, model, fidelity, law=law, known=MODEL)
    try:
        machine.queue_reference(0.1 + MOTION.t, MOTION.q, MOTION.qd, MOTION.qdd)
        for _ in range(200):
            machine.next_sample()
    finally:
        machine.close()


JOBS: tuple[Callable[[], None], ...] = (simulation, diagnosis, mechanics)

if __name__ == '__main__':
    with ProcessPoolExecutor(2) as pool:
        for done in [pool.submit(job) for job in JOBS]:
            done.result()
