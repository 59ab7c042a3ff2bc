"""What designed excitation gains over quasi-random excitation; prints a table.

The same duration and limits of workspace, speed, acceleration and torque, the same share of slow
motion. Standard deviations as `par4_excite` predicts them, and the rms error of identifications
from simulated logs. `python bench/excitation_study.py`.
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.model import Model
from par4_dynamics.model_from_file import read_model
from par4_identification.excitation.design import design_excitation
from par4_identification.excitation.motion_limits import largest_loads, limits_of
from par4_identification.excitation.precision import expected_precision
from par4_identification.excitation.quasi_random import quasi_random_within
from par4_identification.excitation.request import DesignRequest
from par4_identification.fitting.identification import identify
from par4_identification.logs.log import Log
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.closed_loop.simulation import build_simulation
from robots import OTHER, REFERENCE, other_model

FIRST_SEED = 20_000
"""Tests use seeds far below."""
DWELL = 0.5
"""s of rest before and after."""
MACHINES = {'reference': (REFERENCE, read_model('table1', REFERENCE)),
            'other': (OTHER, other_model())}
KINDS = ('designed', 'quasi-random')


@dataclass(frozen=True)
class Case:
    """One motion and the identifications from it.

    Attributes:
        predicted: standard deviations over the true values, (6,).
        errors: of identified values, likewise, (logs, 6).
        loads: largest share of each limit, by kind.
        seconds: that the motion took to make.
        valid: fraction of the rows that identification keeps.
        saturated: torque commands clipped by the drives in the simulations.
    """

    predicted: np.ndarray
    errors: np.ndarray
    loads: dict[str, float]
    seconds: float
    valid: float
    saturated: int


def case(task: tuple[str, str, int, int, float, float]) -> Case:
    """Return what one motion of a kind gives on `logs` simulated logs."""
    name, kind, seed, logs, duration, noise = task
    robot, model = MACHINES[name]
    limits = limits_of(robot, model)
    start = time.perf_counter()
    motion = (design_excitation(robot, model, limits, DesignRequest(duration, seed=seed)).motion
              if kind == 'designed' else quasi_random_within(robot, model, limits, duration, seed))
    seconds = time.perf_counter() - start
    precision = expected_precision(motion, robot, model, np.full(4, noise))
    true = np.array([model.values[term.name][0] for term in BASE_TERMS])
    errors, saturated = [], 0
    for offset in range(logs):
        log, clipped = simulated(robot, model, motion, FIRST_SEED + 100 * seed + offset, noise)
        errors.append(identify([log], robot).estimate.values / true - 1.0)
        saturated += clipped
    return Case(np.array(list(precision.relative_std.values())), np.array(errors),
                largest_loads(limits, motion, robot, model), seconds, precision.rows, saturated)


def simulated(robot: Robot, model: Model, motion: Motion, seed: int, noise: float
              ) -> tuple[Log, int]:
    """Return the log of a motion on the exact plant and how many commands the drives clipped."""
    simulation = build_simulation(robot, model, 'exact', motion.period, seed, torque_noise=noise)
    start = simulation.time + DWELL
    simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
    samples = [simulation.next_sample()
               for _ in range(round((motion.duration + 2.0 * DWELL) / motion.period))]
    clipped = simulation.counts['saturated_commands']
    simulation.close()
    count = len(samples)
    return Log(
        name=motion.name, joint_names=robot.joint_names, start_stamp=samples[0].time_ns,
        period=motion.period, t=np.arange(count) * motion.period,
        q=np.array([sample.q for sample in samples]),
        tau=np.array([sample.effort for sample in samples]), segments=(slice(0, count),),
        reference=None, accounts=None), clipped


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robots', nargs='+', default=list(MACHINES), choices=MACHINES)
    parser.add_argument('--motions', type=int, default=3, help='of each kind and robot')
    parser.add_argument('--logs', type=int, default=5, help='simulated of each motion')
    parser.add_argument('--duration', type=float, default=20.0, help='s')
    parser.add_argument('--noise', type=float, default=0.5, help='of the torque, N m rms')
    parser.add_argument('--workers', type=int, default=2)
    given = parser.parse_args()
    keys = [(name, kind) for name in given.robots for kind in KINDS]
    tasks = [(*key, seed, given.logs, given.duration, given.noise)
             for key in keys for seed in range(given.motions)]
    with ProcessPoolExecutor(given.workers) as pool:
        found = list(track(pool.map(case, tasks), 'designing, simulating', len(tasks)))
    cases = {key: [one for task, one in zip(tasks, found, strict=True) if task[:2] == key]
             for key in keys}
    console = Console(width=140)
    for name in given.robots:
        report(console, name, *(cases[name, kind] for kind in KINDS))


def report(console: Console, name: str, designed: list[Case], random: list[Case]) -> None:
    """Print the table of one robot."""
    table = Table(title=name)
    table.add_column('parameter')
    for column in ('predicted: designed', 'quasi-random', 'factor', 'realised: designed',
                   'quasi-random', 'factor'):
        table.add_column(column, justify='right')
    predicted = [np.exp(np.mean([np.log(one.predicted) for one in cases], axis=0))
                 for cases in (designed, random)]
    realised = [np.sqrt(np.mean(np.concatenate([one.errors for one in cases]) ** 2, axis=0))
                for cases in (designed, random)]
    factors = [right / left for left, right in (predicted, realised)]
    for index, term in enumerate(BASE_TERMS):
        table.add_row(term.name, *(
            cell for (left, right), factor in zip((predicted, realised), factors, strict=True)
            for cell in (f'{100 * left[index]:.4f} %', f'{100 * right[index]:.4f} %',
                         f'{factor[index]:.2f}')))
    table.add_row('geometric mean', '', '', f'{np.exp(np.log(factors[0]).mean()):.2f}', '', '',
                  f'{np.exp(np.log(factors[1]).mean()):.2f}')
    console.print(table)
    for kind, cases in zip(KINDS, (designed, random), strict=True):
        means = [np.exp(np.log(random_std / one.predicted).mean())
                 for one in cases for random_std in [predicted[1]]]
        console.print(
            f'{kind}: {len(cases)} motions, {sum(len(one.errors) for one in cases)} logs; made in '
            f'{np.mean([one.seconds for one in cases]):.1f} s; rows kept '
            f'{100 * np.mean([one.valid for one in cases]):.0f} %; clipped commands '
            f'{sum(one.saturated for one in cases)}; mean factors of the motions '
            f'{min(means):.2f} to {max(means):.2f}; largest use of the limits: '
            + ', '.join(f'{limit} {100 * max(one.loads[limit] for one in cases):.0f} %'
                        for limit in cases[0].loads))


if __name__ == '__main__':
    main()
