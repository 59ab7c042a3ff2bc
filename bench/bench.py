"""Accuracy of the plants and speed of the parts, printed as a table for docs/benchmarks.md.

Speeds are ratios within this run: times real time, or against reading the bag alone.
"""

from __future__ import annotations

import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from plants import add_plants
from rich.console import Console
from rich.table import Table
from rosbags.highlevel import AnyReader
from torque import add_torque

from par4_dynamics.model_from_file import read_model
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.logs.bag import read_bag
from par4_identification.logs.read_log import read_log
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.robot import JOINT_NAMES, Robot, read_robot
from par4_sim.bags.bag_writer import BagWriter
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation

SAMPLES = 600_000
MILLISECOND = 1_000_000


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Return the shortest of some timings of `work`, s."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


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
        ten_minutes(bag, Path(folder), table)
        log = read_log(bag, robot)
        spent = seconds(lambda: diagnose([log], robot), 2)
        table.add_row('diagnosis of 30 s, the whole library',
                      f'{spent:.1f} s, {motion.duration / spent:.0f} x real time')


def ten_minutes(bag: Path, folder: Path, table: Table) -> None:
    """Add what par4_identify, as a process, takes for a log of ten minutes at 1 kHz.

    The log repeats a recording that begins and ends at home.
    """
    topics = read_bag(bag).joints
    states, voltages = topics['joint_states'], topics['amplifier_voltage']
    rows = len(states.stamp)
    long_bag = folder / 'ten_minutes'
    start = time.perf_counter()
    with BagWriter(long_bag) as writer:
        for index in range(SAMPLES):
            row, stamp = index % rows, int(states.stamp[0]) + index * MILLISECOND
            writer.write_joint_state('/joint_states', stamp, JOINT_NAMES, states.position[row],
                                     states.velocity[row], states.effort[row])
            writer.write_joint_state('/amplifier_voltage', stamp, JOINT_NAMES,
                                     effort=voltages.effort[row])
    table.add_row('writing joint states into a bag',
                  f'{2 * SAMPLES / (time.perf_counter() - start):.0f} messages/s')

    def deserialise() -> None:
        with AnyReader([long_bag]) as reader:
            for connection, _, data in reader.messages():
                reader.deserialize(data, connection.msgtype)

    def identify_process() -> int:
        """Return the peak memory, KiB."""
        child = subprocess.Popen(
            [sys.executable, '-m', 'par4_identification.commands.identify', long_bag, '--robot',
             'reference', '--output', folder / 'identified', '--no-report'],
            stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        if status:
            raise SystemExit('par4_identify failed')
        return usage.ru_maxrss

    memory = identify_process()  # compiles what is not compiled yet
    alone, whole = seconds(deserialise, 2), seconds(identify_process, 2)
    table.add_row('ten minutes at 1 kHz: AnyReader alone', f'{alone:.2f} s')
    table.add_row('par4_identify --no-report, from process start to the files', f'{whole:.2f} s')
    table.add_row('the same, over AnyReader alone', f'{whole / alone:.2f}', '0.5')
    table.add_row('its peak memory', f'{memory / 1024:.0f} MiB', '2000 MB')


def main() -> None:
    """Print the table."""
    robot = read_robot('reference')
    table = Table('what', 'measured', 'target',
                  title=f'{platform.machine()}, Python {platform.python_version()}')
    add_plants(robot, table)
    add_torque(robot, table)
    pipeline(robot, table)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    table.add_row('peak memory of this run', f'{memory:.0f} MiB')
    Console(width=120).print(table)


if __name__ == '__main__':
    main()
