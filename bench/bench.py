"""Accuracy of the plants and speed of the parts, printed as a table for docs/benchmarks.md.

Speeds are ratios within this run: times real time, or against reading the bag alone.
"""

from __future__ import annotations

import platform
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from par4_dynamics.base_terms import base_columns
from par4_dynamics.model import Model, read_model
from par4_dynamics.state import state_of_joints, state_of_platform
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.identification import identify
from par4_identification.log import read_log
from par4_kinematics.adept import adept_motion
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot, read_robot
from par4_sim.bag import read_bag
from par4_sim.drive import DriveLoops
from par4_sim.friction import Friction
from par4_sim.machine_effects import machine_of_model
from par4_sim.offline import simulate_to_bag
from par4_sim.simulation import build_plant, build_simulation


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest of some timings of `work`, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def frictionless(model: Model) -> Model:
    """Return the model without friction."""
    none = {name: np.zeros(4) for name in ('coulomb_friction', 'viscous_friction')}
    return replace(model, values={**model.values, **none})


def torque_error(robot: Robot, model: Model, motion: Motion, fidelity: str
                 ) -> tuple[float, float, float, float]:
    """Return worst and rms torque error over peak torque, loop opening (m), times real time.

    The frictionless plant runs the motion under its drives with feedforward. What torque was
    applied is held against the inverse dynamics of the motion that came of it (central
    differences of the joint positions step by step).
    """
    machine = replace(machine_of_model(robot, model), friction=Friction())
    plant = build_plant(machine, fidelity)
    plant.reset(motion.x[0])
    state = state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)
    forward = model.torque(state)
    loops = DriveLoops(robot.drives.model_copy(update={'encoder_counts': 0}), 1e6, plant.dt)
    loops.restart(forward[0])
    q, applied, opening = [], [], 0.0
    start = time.process_time()
    for k in range(len(motion.t)):
        target = np.concatenate((motion.q[k], motion.qd[k], forward[k]))
        q.append(plant.q)
        torque = loops.follow(target, q[-1], plant.qd).copy()
        plant.step(torque)
        applied.append(torque)
        if k % 50 == 0:
            opening = max(opening, plant.loop_opening())
    spent = time.process_time() - start
    q, applied = np.array(q), np.array(applied)
    if plant.torque_offset > 0.0:
        applied[1:] = 0.5 * (applied[1:] + applied[:-1])
    inner = slice(1, -1)
    came = state_of_joints(robot.geometry, motion.t[inner], q[inner],
                           (q[2:] - q[:-2]) / (2 * plant.dt),
                           (q[2:] - 2 * q[1:-1] + q[:-2]) / plant.dt ** 2)
    error = applied[inner] - model.torque(came)
    plant.close()
    peak = np.abs(applied).max()
    return (float(np.abs(error).max() / peak), float(np.sqrt(np.mean(error ** 2)) / peak), opening,
            motion.duration / spent)


def plants(robot: Robot, table: Table) -> None:
    """Add the accuracy and speed of the plants."""
    model = frictionless(read_model('table1_full', robot))
    motion = adept_motion(robot, theta_swing=1.5, jerk=30_000.0, round_trip=0.25, cycles=4,
                          period=0.25e-3)
    for fidelity in ('exact', 'fast', 'accurate'):
        torque_error(robot, model, motion, fidelity)  # compile
        worst, rms, opening, pace = torque_error(robot, model, motion, fidelity)
        table.add_row(f'{fidelity}: torque error, worst (rms), of peak',
                      f'{worst:.3%} ({rms:.4%})')
        table.add_row(f'{fidelity}: loop opening', f'{1e6 * opening:.2f} um')
        table.add_row(f'{fidelity}: stepped from Python, drives included',
                      f'{pace:.1f} x real time')


def mathematics(robot: Robot, table: Table) -> None:
    """Add the speed of kinematics and dynamics, one core."""
    motion = excitation_motion(robot, duration=30.0, seed=1)
    model = read_model('table1_full', robot)

    def from_platform() -> np.ndarray:
        return model.torque(state_of_platform(robot.geometry, motion.t, motion.x, motion.xd,
                                              motion.xdd))

    def from_joints() -> np.ndarray:
        return model.torque(state_of_joints(robot.geometry, motion.t, motion.q, motion.qd,
                                            motion.qdd))

    state = state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)
    for name, work in (('torque from platform motion', from_platform),
                       ('torque from joint motion, forward kinematics included', from_joints),
                       ('regressor', lambda: base_columns(state))):
        work()
        table.add_row(name, f'{len(motion.t) / seconds(work) / 1e6:.2f} million samples/s')


def pipeline(robot: Robot, table: Table) -> None:
    """Add the offline tools' work on a bag of 30 s."""
    model = read_model('table1_full', robot)
    motion = excitation_motion(robot, duration=30.0, seed=2)
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        simulation = build_simulation(robot, model, 'exact', torque_noise=0.05)
        start = time.perf_counter()
        simulate_to_bag(simulation, motion, robot, bag)
        table.add_row('par4_simulate, exact, bag written',
                      f'{motion.duration / (time.perf_counter() - start):.1f} x real time')
        alone = seconds(lambda: read_bag(bag), 2)
        whole = seconds(lambda: identify([read_log(bag, robot)], robot), 2)
        table.add_row('bag to identified parameters, over decoding the bag',
                      f'{whole / alone:.2f}')
        log = read_log(bag, robot)
        spent = seconds(lambda: diagnose([log], robot), 2)
        table.add_row('diagnosis of 30 s, the library of four effects',
                      f'{spent:.1f} s, {motion.duration / spent:.0f} x real time')


def main() -> None:
    """Print the table."""
    robot = read_robot('reference')
    table = Table('what', 'measured', title=f'{platform.machine()}, Python '
                                            f'{platform.python_version()}')
    plants(robot, table)
    mathematics(robot, table)
    pipeline(robot, table)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    table.add_row('peak memory of this run', f'{memory:.0f} MiB')
    Console(width=110).print(table)


if __name__ == '__main__':
    main()
