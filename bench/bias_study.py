"""TABLE 1 given back from a bag, and by how much (20) misses the full mechanism; prints tables.

TABLE 1 in both readings of f_v goes through `par4_simulate` and `par4_identify`. Then quasi-random
logs of the machine with distributed rods and real stick-slip: bias of `full`, bias of `paper`
beside what projecting the rods onto the columns of (20) predicts, along the recorded positions and
along the motion that was only asked for, in three closed loops. `python bench/bias_study.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault('OMP_NUM_THREADS', '1')  # the processes share the cores already
sys.path.insert(0, str(Path(__file__).parents[1] / 'tests'))

import numpy as np
from measured import excitation, log_of_model
from rich.console import Console
from rich.progress import track
from rich.table import Table

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.model_file import read_model_file
from par4_dynamics.model_from_file import read_model
from par4_identification.fitting.identification import identify
from par4_identification.fitting.lumping_bias import lumping_bias
from par4_identification.logs.log import Log
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import Motion
from robots import REFERENCE

READINGS = ('table1', 'table1_as_printed')
TORQUE_NOISE = 3.0
"""N m rms, white: gives standard deviations of the paper's size."""
DURATION = 15.0
"""s of excitation in each log of the bias study."""
FIRST_SEED = 40_000
"""Tests use seeds far below."""
LOOPS = {
    'PI and feedforward': (REFERENCE, True),
    'PI': (REFERENCE, False),
    'P, as in the paper': (REFERENCE.model_copy(update={'drives': REFERENCE.drives.model_copy(
        update={'integral_gain': 0.0})}), False)}
"""Loop of the joint position around the P loop of its speed -> robot, whether feedforward acts."""
BODIES = ('paper', 'full')
ACCELERATIONS = (10.0, 15.0, 30.0, 100.0)
"""m/s2, largest of the platform in the excitation."""
NAMES = tuple(term.name for term in BASE_TERMS)
MODEL = read_model('table1_full', REFERENCE)
TRUE = np.array([MODEL.values[name][0] for name in NAMES])


@dataclass(frozen=True)
class Case:
    """One log of one loop.

    Attributes:
        bias, std: over the true values, (2, p) for BODIES.
        residual: rms over the joints, (2,), N m.
        recorded, asked: bias of `paper` predicted along either motion, (p,).
        following: rms error of the joints behind the reference, rad.
    """

    bias: np.ndarray
    std: np.ndarray
    residual: np.ndarray
    recorded: np.ndarray
    asked: np.ndarray
    following: float


def asked_log(motion: Motion) -> Log:
    """Return the log of a machine that follows a motion to the letter; its torque is zero."""
    return Log(name=motion.name, joint_names=REFERENCE.joint_names, start_stamp=0,
               period=motion.period, t=motion.t, q=motion.q, tau=np.zeros_like(motion.q),
               segments=(slice(0, len(motion.t)),), reference=None, accounts=None)


def predicted(log: Log) -> np.ndarray:
    """Return the bias of `paper` along the positions of a log, over the true values, (p,)."""
    return lumping_bias(runs_of_log(log, REFERENCE), REFERENCE) / TRUE


def case(task: tuple[str, int]) -> Case:
    """Return what is identified from one log."""
    loop, seed = task
    robot, feedforward = LOOPS[loop]
    log = log_of_model(robot, MODEL, duration=DURATION, seed=seed, feedforward=feedforward)
    motion = excitation(robot.name, DURATION, seed)
    fits = [identify([log], robot, body).estimate for body in BODIES]
    # samples carry their stamps; the motion starts half a second after the log does
    shift = round((len(log.t) - len(motion.t)) / 2)
    error = log.q[shift:shift + len(motion.t)] - motion.q
    return Case(
        bias=np.array([fit.values / TRUE - 1.0 for fit in fits]),
        std=np.array([fit.std / TRUE for fit in fits]),
        residual=np.array([np.sqrt(np.mean(fit.rms ** 2)) for fit in fits]),
        recorded=predicted(log), asked=predicted(asked_log(motion)),
        following=float(np.sqrt(np.mean(error ** 2))))


def read_back(reading: str, folder: Path) -> dict:
    """Return `identification.json` of a bag of the machine of that model."""
    bag, found = folder / reading, folder / f'{reading}_identified'
    for name, *arguments in (
            ('par4_simulate', 'excitation', '--model', reading, '--duration', '30',
             '--torque-noise', str(TORQUE_NOISE), '--output', bag),
            ('par4_identify', bag, '--robot', 'reference', '--no-report', '--output', found)):
        subprocess.run([Path(sys.executable).with_name(name), *arguments], check=True,
                       stdout=subprocess.DEVNULL)
    return json.loads((found / 'identification.json').read_text(encoding='utf-8'))


def add_readings(console: Console) -> None:
    """Print TABLE 1 as it comes back."""
    table = Table('parameter', 'rel. std of the paper',
                  title=f'TABLE 1 from a bag of 30 s, {TORQUE_NOISE:g} N m of noise')
    with tempfile.TemporaryDirectory() as folder:
        found = {reading: read_back(reading, Path(folder)) for reading in READINGS}
    for reading in READINGS:
        for column in (reading, 'identified', 'rel. std', 'textbook', 'error / std'):
            table.add_column(column, justify='right')
    for name in NAMES:
        cells = []
        for reading in READINGS:
            true = read_model_file(reading).parameters[name]
            own, textbook = (found[reading]['parameters'][name],
                             found[reading]['estimator']['textbook_std'][name])
            cells += [f'{true.value:g}', f'{own["value"]:.4g}', share(own['relative_std']),
                      share(textbook / own['value']),
                      f'{(own["value"] - true.value) / own["std"]:+.1f}']
        printed = read_model_file('table1_as_printed').parameters[name]
        table.add_row(name, share(printed.std / printed.value), *cells)
    console.print(table)


def share(value: float) -> str:
    """Return a fraction in percent."""
    return f'{100.0 * value:.3f} %'


def add_bias(console: Console, cases: list[Case]) -> None:
    """Print bias and prediction of each parameter."""
    table = Table('parameter', 'paper: bias, mean', 'predicted, mean', 'largest difference',
                  'full: bias, mean', 'largest', title=f'table1_full, {len(cases)} logs, all loops')
    paper, full = (np.array([one.bias[index] for one in cases]) for index in range(2))
    recorded = np.array([one.recorded for one in cases])
    for index, name in enumerate(NAMES):
        table.add_row(name, *(share(value) for value in (
            paper[:, index].mean(), recorded[:, index].mean(),
            np.abs(paper - recorded)[:, index].max(), full[:, index].mean(),
            np.abs(full)[:, index].max())))
    console.print(table)


def add_loops(console: Console, cases: dict[str, list[Case]]) -> None:
    """Print what the closed loop matters."""
    table = Table('loop', 'following, rms', 'body', 'bias of arm gravity', 'largest bias',
                  'prediction off: recorded', 'asked', 'rel. std, mean', 'residual',
                  title='closed loops')
    gravity = NAMES.index('arm_gravity')
    for loop, own in cases.items():
        for index, body in enumerate(BODIES):
            bias = np.array([one.bias[index] for one in own])
            off = [share(np.abs(bias - [getattr(one, motion) for one in own]).max())
                   for motion in ('recorded', 'asked')] if body == 'paper' else ['', '']
            table.add_row(
                loop, f'{1e3 * np.mean([one.following for one in own]):.2f} mrad', body,
                share(bias[:, gravity].mean()), share(np.abs(bias).max()),
                *off, share(np.exp(np.mean(np.log([one.std[index] for one in own])))),
                f'{np.mean([one.residual[index] for one in own]):.3f} N m')
    console.print(table)


def add_accelerations(console: Console, seed: int) -> None:
    """Print how the predicted bias of `paper` goes with the acceleration of the excitation."""
    table = Table('excitation', *NAMES, title='predicted bias of paper')
    for acceleration in ACCELERATIONS:
        motion = excitation_motion(REFERENCE, 30.0, seed, acceleration=acceleration)
        bias = predicted(asked_log(motion))
        table.add_row(f'{acceleration:g} m/s2', *map(share, bias))
    console.print(table)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--logs', type=int, default=12, help='of each loop')
    parser.add_argument('--processes', type=int, default=os.cpu_count())
    given = parser.parse_args()
    seeds = range(FIRST_SEED, FIRST_SEED + given.logs)
    tasks = [(loop, seed) for loop in LOOPS for seed in seeds]
    with ProcessPoolExecutor(given.processes) as pool:
        found = list(track(pool.map(case, tasks), 'simulating, identifying', len(tasks)))
    console = Console(width=170)
    add_readings(console)
    add_bias(console, found)
    add_loops(console, {loop: [one for task, one in zip(tasks, found, strict=True)
                               if task[0] == loop] for loop in LOOPS})
    add_accelerations(console, FIRST_SEED)


if __name__ == '__main__':
    main()
