"""How the time of a diagnosis grows with the log and with the library; prints Markdown tables.

A machine with hidden cogging is simulated (exact plant, 1 kHz, noise) along excitations of 5 s, one
after the other, so that each stretch is like any other. The logs are its first seconds; two thirds
of each are fitted, the rest is held out. Every figure is the median of some runs in a process of
its own that has diagnosed a short log before, so that kernels are compiled.

`python bench/diagnosis.py`, five to six minutes on two cores that do nothing else.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from rich.box import MARKDOWN
from rich.console import Console
from rich.progress import track
from rich.table import Table

from par4_dynamics.model_from_file import read_model
from par4_identification.diagnosis.diagnosis import LIBRARY, diagnose
from par4_identification.diagnosis.search.shapes import shapes_of
from par4_identification.logs.log import Log
from par4_identification.logs.read_log import read_log
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot, read_robot
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from robots import model_with

LENGTHS = (15.0, 30.0, 60.0, 120.0)
"""Of the logs, s."""
USUAL = 60.0
"""Length for the library, the steps and the command, s."""
EFFECTS = (8, 16, 24)
"""Of the library, in its order, besides all of them."""
PIECE = 5.0
"""Length of one excitation, s."""
HIDDEN = {'amplitude': 0.6, 'periods': 22.0, 'phase': (0.3, 1.0, 2.0, -1.0)}
NOISE = 0.1
"""Of the torque, N m rms."""
SEED = 5


@dataclass(frozen=True)
class Timing:
    """What one diagnosis took.

    Attributes:
        seconds: median over the runs.
        spread: longest less shortest, s.
        steps: share of each step that it reports.
        memory: largest of the process, MiB.
        shapes: of the effects that were searched, tried at first.
        answer: verdict and names.
    """

    seconds: float
    spread: float
    steps: dict[str, float]
    memory: float
    shapes: int
    answer: str


def excitations(robot: Robot, duration: float) -> Motion:
    """Return excitations from home to home, one after the other."""
    parts = [excitation_motion(robot, PIECE, seed) for seed in range(round(duration / PIECE))]
    columns = (np.concatenate([getattr(part, field) for part in parts])
               for field in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd'))
    count = sum(len(part.t) for part in parts)
    return Motion('excitations', np.arange(count) * parts[0].period, *columns)


def record(robot: Robot, duration: float, bag: Path) -> None:
    """Write the bag of a machine with hidden cogging."""
    machine = model_with(read_model('table1', robot), 'cogging', **HIDDEN)
    simulation = build_simulation(robot, machine, 'exact', seed=SEED, torque_noise=NOISE)
    simulate_to_bag(simulation, excitations(robot, duration), robot, bag)


def beginning(log: Log, duration: float) -> Log:
    """Return the first seconds of a log without gaps."""
    count = round(duration / log.period)
    return replace(log, t=log.t[:count], q=log.q[:count], tau=log.tau[:count],
                   segments=(slice(0, count),))


def timing(log: Log, robot: Robot, effects: int, runs: int) -> Timing:
    """Return what diagnosing a log with the first effects of the library takes."""
    library = dict(list(LIBRARY.items())[:effects])
    diagnose([beginning(log, min(LENGTHS))], robot, library=library)
    totals, steps = [], Counter()
    for _ in range(runs):
        marks = [('', time.perf_counter())]
        found = diagnose([log], robot, library=library, progress=lambda step, marks=marks:
                         marks.append((step, time.perf_counter())))
        marks.append(('', time.perf_counter()))
        totals.append(marks[-1][1] - marks[0][1])
        for (step, begin), (_, end) in pairwise(marks[1:]):
            steps[step] += end - begin
    return Timing(
        float(np.median(totals)), max(totals) - min(totals),
        {step: spent / sum(totals) for step, spent in steps.items()},
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        sum(len(shapes_of(found.evidence.observations, effect)) for effect in library.values()),
        ', '.join([found.verdict, *(cause.effect.name for cause in found.causes)]))


def timed_alone(*given: object) -> Timing:
    """Return `timing` of a process of its own."""
    with ProcessPoolExecutor(1, get_context('spawn')) as pool:
        return pool.submit(timing, *given).result()


def command(bag: Path, output: Path, runs: int, *options: str) -> float:
    """Return the median time of par4_diagnose, from process start to its files, s."""
    spent = []
    for _ in range(runs):
        start = time.perf_counter()
        subprocess.run([sys.executable, '-m', 'par4_identification.commands.diagnose', bag,
                        '--robot', 'reference', '--output', output, *options], check=True,
                       capture_output=True)
        spent.append(time.perf_counter() - start)
    return float(np.median(spent))


def table(*columns: str) -> Table:
    """Return an empty table, the first column of text."""
    made = Table(box=MARKDOWN)
    for number, column in enumerate(columns):
        made.add_column(column, justify='right' if number else 'left')
    return made


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=3, help='of which the median is printed')
    runs = parser.parse_args().runs
    robot = read_robot('reference')
    console = Console(width=120)
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as folder:
        bag, usual_bag = Path(folder) / 'longest', Path(folder) / 'usual'
        record(robot, max(LENGTHS), bag)
        record(robot, USUAL, usual_bag)
        log = read_log(bag, robot)
        asked = [(duration, len(LIBRARY)) for duration in LENGTHS]
        asked += [(USUAL, effects) for effects in EFFECTS]
        found = {(duration, effects): timed_alone(beginning(log, duration), robot, effects, runs)
                 for duration, effects in track(asked, 'diagnosing', console=Console(stderr=True))}
        offline = command(usual_bag, Path(folder) / 'offline', runs, '--no-simulate')
        whole = command(usual_bag, Path(folder) / 'whole', runs)

    lengths = table(f'log, {len(LIBRARY)} effects', 'seconds', 'spread', 'a second of log',
                    'peak memory', 'answer')
    for duration in LENGTHS:
        item = found[duration, len(LIBRARY)]
        lengths.add_row(f'{duration:.0f} s', f'{item.seconds:.2f}', f'{item.spread:.2f}',
                        f'{item.seconds / duration:.3f}', f'{item.memory:.0f} MiB', item.answer)
    effects = table(f'effects, {USUAL:.0f} s', 'shapes', 'seconds', 'spread', 'answer')
    for count in (*EFFECTS, len(LIBRARY)):
        item = found[USUAL, count]
        effects.add_row(str(count), str(item.shapes), f'{item.seconds:.2f}', f'{item.spread:.2f}',
                        item.answer)
    usual = found[USUAL, len(LIBRARY)]
    steps = table(f'step, {USUAL:.0f} s, {len(LIBRARY)} effects', 'seconds', 'share')
    for step, share in usual.steps.items():
        steps.add_row(step, f'{share * usual.seconds:.2f}', f'{100 * share:.0f} %')
    processes = table(f'par4_diagnose, process start to files, {USUAL:.0f} s', 'seconds')
    processes.add_row('with `--no-simulate`', f'{offline:.2f}')
    processes.add_row('with the re-simulation', f'{whole:.2f}')
    processes.add_row('share of the re-simulation', f'{100 * (1 - offline / whole):.0f} %')
    console.print(f'{os.cpu_count()} cores, load before {load:.1f}, medians of {runs} runs')
    for made in (lengths, effects, steps, processes):
        console.print(made)


if __name__ == '__main__':
    main()
