"""par4_excite: an excitation motion by design, and what to expect of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from par4_dynamics.model_from_file import read_model
from par4_identification.excitation.design import (
    Design,
    Repeats,
    design_excitation,
)
from par4_identification.excitation.motion_limits import (
    MotionLimits,
    largest_loads,
    limits_of,
)
from par4_identification.excitation.precision import Precision, expected_precision
from par4_identification.excitation.quasi_random import quasi_random_within
from par4_identification.excitation.request import DesignRequest
from par4_kinematics.errors import InputError
from par4_kinematics.files import alone_in
from par4_kinematics.limits import limits_not_given
from par4_kinematics.motion_file import write_motion
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import read_robot
from par4_sim.report.terminal import print_table, say
from par4_sim.report.words import in_words, number, percent


def excite(robot: str, model: str, output: Path, duration: float, joint_speed: float | None,
           acceleration: float, torque_limit: float | None, torque_noise: tuple[float, ...],
           harmonics: int, base_frequency: float | None, periods: int | None,
           slow_fraction: float, starts: int, seed: int) -> None:
    """Design the motion from which the base parameters are known best."""
    machine = read_robot(robot)
    truth = read_model(model, machine)
    noise = noise_of(torque_noise, len(machine.joint_names))
    request = DesignRequest(duration, harmonics, base_frequency, periods, slow_fraction, starts,
                            seed)
    limits = limits_of(machine, truth, joint_speed, acceleration, torque_limit)
    if output.suffix not in ('.yaml', '.yml'):
        raise InputError(f'--output {output}: expected a name that ends in .yaml; the samples go '
                         f'into a .csv beside it')
    refuse_unwritable(output.parent)
    random = quasi_random_within(machine, truth, limits, duration, seed)
    terminal = Console(stderr=True)
    with Progress(console=terminal, transient=True, disable=not terminal.is_terminal) as bar:
        task = bar.add_task('optimising', total=1.0)
        design = design_excitation(machine, truth, limits, request, noise,
                                   progress=lambda share: bar.update(task, completed=share))
    designed, undesigned = (expected_precision(motion, machine, truth, noise)
                            for motion in (design.motion, random))
    with alone_in(output.parent):
        write_motion(output, design.motion, 'platform')
    print_table(precision_table(designed, undesigned))
    print_table(limits_table(limits, design, largest_loads(limits, random, machine, truth)))
    say(sentence(design, designed, undesigned, noise))
    say(f'motion: {output} and {output.with_suffix(".csv")}', *limits_not_given(machine),
        whole=True)


def noise_of(given: tuple[float, ...], joints: int) -> np.ndarray:
    """Return the torque noise (J,), N m, of one number or of J.

    Raises:
        InputError: another count.
    """
    if len(given) not in (1, joints):
        raise InputError(f'--torque-noise: found {len(given)} numbers, expected one positive '
                         f'number in N m, or {joints} with commas between them')
    return np.broadcast_to(np.array(given), (joints,))


def precision_table(designed: Precision, random: Precision) -> Table:
    """Return the expected relative standard deviations of both motions."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column('expected rel. std', no_wrap=True)
    for name in ('designed', 'quasi-random', 'gain'):
        table.add_column(name, justify='right', no_wrap=True)
    for name, std in designed.relative_std.items():
        table.add_row(in_words(name), percent(std), percent(random.relative_std[name]),
                      number(random.std[name] / designed.std[name]))
    table.add_row('geometric mean', '', '', number(gain_over_random(designed, random)))
    for name, row in (('condition number', 'condition_number'),
                      ('the same, columns of equal length', 'collinearity')):
        values = [getattr(precision, row) for precision in (designed, random)]
        table.add_row(name, *map(number, values), '')
    table.add_row('rows kept by the low-speed mask', percent(designed.rows), percent(random.rows))
    return table


def limits_table(limits: MotionLimits, design: Design, random: dict[str, float]) -> Table:
    """Return what both motions use of the limits."""
    table = Table(box=SIMPLE_HEAD, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column('largest use of', no_wrap=True)
    for name in ('limit', 'designed', 'quasi-random'):
        table.add_column(name, justify='right', no_wrap=True)
    in_units = {'joint speed': f'{number(limits.joint_speed)} rad/s',
                'acceleration': f'{number(limits.acceleration)} m/s2',
                'torque': f'{number(limits.torque)} N m'}
    for kind, load in design.loads.items():
        table.add_row(kind, in_units.get(kind, ''), percent(load), percent(random[kind]))
    return table


def gain_over_random(designed: Precision, random: Precision) -> float:
    """Return the geometric mean, over the parameters, of the ratio of standard deviations."""
    ratios = [random.std[name] / std for name, std in designed.std.items()]
    return float(np.exp(np.mean(np.log(ratios))))


def sentence(design: Design, designed: Precision, random: Precision, noise: np.ndarray) -> str:
    """Return what was made and what it is worth, in words."""
    def phase(name: str, repeats: Repeats) -> str:
        period = design.motion.period
        return (f'{repeats.count} {name} periods of {repeats.samples * period:.3f} s from '
                f'{repeats.first * period:.3f} s')

    size = (f'{noise[0]:g}' if np.ptp(noise) == 0.0 else ', '.join(f'{one:g}' for one in noise))
    return (f'{design.motion.duration:.1f} s: {phase("slow", design.slow)}, '
            f'{phase("fast", design.fast)}, each the same samples, so that what differs between '
            f'them in a log is noise. With {size} N m of torque noise a sample the standard '
            f'deviations are expected to be {number(gain_over_random(designed, random), 2)} times '
            f'smaller (geometric mean) than after the quasi-random excitation of the same duration '
            f'and limits.')
