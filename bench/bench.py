"""Accuracy of the plants and speed of the parts, printed as a table for docs/benchmarks.md.

Speeds are ratios within this run: times real time, or against reading the bag alone.
"""

from __future__ import annotations

import platform
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from plants import add_plants
from rich.console import Console
from rich.table import Table

from par4_dynamics.base_terms import base_columns
from par4_dynamics.model import read_model
from par4_dynamics.state import state_of_joints, state_of_platform
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.identification import identify
from par4_identification.log import read_log
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.robot import Robot, read_robot
from par4_sim.bag import read_bag
from par4_sim.offline import simulate_to_bag
from par4_sim.simulation import build_simulation


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest of some timings of `work`, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


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
    table = Table('what', 'measured', 'target',
                  title=f'{platform.machine()}, Python {platform.python_version()}')
    add_plants(robot, table)
    mathematics(robot, table)
    pipeline(robot, table)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    table.add_row('peak memory of this run', f'{memory:.0f} MiB')
    Console(width=120).print(table)


if __name__ == '__main__':
    main()
