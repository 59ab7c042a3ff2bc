"""A measured axis: the published identification, the project's own, its diagnosis, and a bag.

Run it with the path of DATA_EMPS.mat as argument or in PAR4_EMPS_DATA; see README.md.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from axis_scales import diagnosis_of_axis
from diagnosed import claims, error_as_diagnosed, steps
from own_recipe import own_estimates, values_by_name
from par4_identification import Diagnosis, Estimate
from par4_kinematics import InputError, Par4Error
from par4_kinematics.files import write_yaml
from published_recipe import BY_DIRECTION, COLUMNS, published_estimate
from recording import VARIABLE, Recording, data_path, read_recording, write_bag
from remainder import low_speed_friction, strongest_periods

PUBLISHED = {
    'M': ('95.1089', '0.1141'), 'Fv': ('203.5034', '0.5631'), 'Fc': ('20.3935', '0.4964'),
    'offset': ('-3.1648', '1.4021')}
"""Value and relative deviation in percent, as printed."""
PUBLISHED_FIT = ('4.0834', '25.9883')
"""Relative error in percent and condition number, as printed."""
PUBLISHED_BY_DIRECTION = {'M': '95.1540', 'Fv+': '166.7061', 'Fc+': '20.1440', 'Fv-': '240.4236',
                          'Fc-': '20.6277'}
PUBLISHED_FIT_BY_DIRECTION = '3.1117'
PUBLISHED_VALUES = {'viscous_asymmetry': '-36.86 N s/m'}
"""Of the causes, where the publication has them: half of Fv+ - Fv-."""
UNITS_OF_AXIS = {'N m s/rad': 'N s/m', 'N m': 'N', '1/turn': '/ 2 pi m'}
WIDTHS = (0.0, 1e-3, 2e-3, 4e-3)
"""Speeds at which friction may have reached half its level, m/s."""
BIN = Path(sys.executable).parent


def reproduced_table(recording: Recording) -> Table:
    """Return published beside reproduced digits."""
    table = Table('', 'published', 'reproduced', 'rel. std, published', 'reproduced',
                  box=SIMPLE_HEAD, title='Published recipe')
    estimate, relative = published_estimate(recording.position, recording.force, recording.period)
    for name, value, std in zip(COLUMNS, estimate.values, relative):
        table.add_row(name, PUBLISHED[name][0], f'{value:.4f}', f'{PUBLISHED[name][1]} %',
                      f'{100.0 * std:.4f} %')
    table.add_row('relative error', f'{PUBLISHED_FIT[0]} %',
                  f'{100.0 * estimate.relative_error:.4f} %')
    table.add_row('condition number', PUBLISHED_FIT[1], f'{estimate.condition_number:.4f}')
    split, _ = published_estimate(recording.position, recording.force, recording.period,
                                  BY_DIRECTION)
    table.add_section()
    for name, value in zip(BY_DIRECTION, split.values):
        table.add_row(name, PUBLISHED_BY_DIRECTION[name], f'{value:.4f}')
    table.add_row('relative error', f'{PUBLISHED_FIT_BY_DIRECTION} %',
                  f'{100 * split.relative_error:.4f} %')
    return table


def own_table(estimates: dict[str, Estimate]) -> Table:
    """Return what each estimator makes of the recording by the project's own recipe."""
    table = Table('', *PUBLISHED, 'rel. error', box=SIMPLE_HEAD, title='Own recipe')
    rows = [('ordinary, textbook', estimates['ordinary'], estimates['ordinary'].textbook_std),
            *((name, estimate, estimate.std) for name, estimate in estimates.items())]
    for name, estimate, std in rows:
        values = values_by_name(estimate)
        spread = dict(zip(values, std))
        table.add_row(name, *(f'{values[key]:.2f} ± {spread[key]:.2f}' for key in PUBLISHED),
                      f'{100.0 * estimate.relative_error:.2f} %')
    return table


def claims_table(diagnosis: Diagnosis) -> Table:
    """Return each cause with its evidence."""
    table = Table('cause (twins)', 'estimate', 'published', 'lik. ratio', 'p', 'held-out gain',
                  box=SIMPLE_HEAD, title=f'Diagnosis: {diagnosis.verdict}')
    for claim in claims(diagnosis):
        values = '\n'.join(
            f'{name} {value:.4g} ± {std:.1g} {UNITS_OF_AXIS.get(entry.unit, entry.unit)}'
            for name, entry in claim.parameters.items()
            for value, std in zip(np.ravel(entry.value), np.ravel(entry.std)))
        table.add_row(
            '\n'.join((claim.name, *(f'({twin})' for twin in claim.twins))), values,
            PUBLISHED_VALUES.get(claim.name, '-'), f'{claim.likelihood_ratio:.0f}',
            f'{claim.p_value:.0e}' if claim.p_value > 1e-300 else '< 1e-300',
            f'{claim.gain.share:.0%}\n{claim.gain.low:.0%} to {claim.gain.high:.0%}')
    return table


def steps_table(recording: Recording, diagnosis: Diagnosis) -> Table:
    """Return the relative error of the published recipe with one more cause at a time."""
    table = Table('published recipe', 'relative error', 'where it moves', box=SIMPLE_HEAD,
                  title='The causes in the published recipe')
    for step in steps(recording, diagnosis):
        table.add_row(f'+ {step.names[-1]}' if step.names else 'as published',
                      f'{100.0 * step.estimate.relative_error:.3f} %',
                      f'{100.0 * step.moving.relative_error:.3f} %')
    table.add_section()
    table.add_row('all as diagnosed, nothing refitted', *(
        f'{100.0 * error:.3f} %' for error in error_as_diagnosed(recording, diagnosis)))
    return table


def low_speed_table(recording: Recording, diagnosis: Diagnosis) -> Table:
    """Return what friction Fc v / (|v| + w) explains, with and without the delay diagnosed."""
    table = Table('force moved by', *(f'w = {1e3 * width:g} mm/s' for width in WIDTHS),
                  box=SIMPLE_HEAD,
                  title='Friction Fc v / (|v| + w): relative error, all rows (held-out half)')
    delays = (0.0, delay_of(diagnosis))
    found = low_speed_friction(recording, diagnosis, delays, WIDTHS)
    for delay in delays:
        table.add_row(f'{1e3 * delay:.2f} ms', *(
            f'{100.0 * item.estimate.relative_error:.2f} % ({100.0 * item.heldout:.2f} %)'
            for item in found if item.delay == delay))
    return table


def periods_table(recording: Recording, diagnosis: Diagnosis) -> Table:
    """Return the strongest periodic force of each direction and half of the record."""
    table = Table('direction', 'half', 'period', 'amplitude', 'rises through 0 at', 'gain',
                  box=SIMPLE_HEAD, title='What repeats with the place, of all periods from 1 mm')
    for item in strongest_periods(recording, delay_of(diagnosis)):
        table.add_row('forward' if item.forward else 'backward', str(item.half + 1),
                      f'{1e3 * item.period:.3f} mm', f'{item.amplitude:.2f} N',
                      f'{1e3 * item.place:.2f} mm', f'{item.gain:.0%}')
    return table


def delay_of(diagnosis: Diagnosis) -> float:
    """Return the delay of the cause `time_offset`, zero without it, s."""
    return sum(cause.parameters['delay'].value for cause in diagnosis.causes
               if cause.effect.name == 'time_offset')


def through_a_bag(recording: Recording, folder: Path) -> tuple[dict, dict]:
    """Return identification.json and validation.json of a bag made from the recording.

    Raises:
        InputError: an executable refused the bag.
    """
    write_bag(recording, folder / 'bag')
    write_yaml(folder / 'emps.yaml', recording.axis.model_dump(by_alias=True))
    machine = ('--robot', str(folder / 'emps.yaml'))
    for command in (
            ('par4_identify', folder / 'bag', *machine, '--offsets', '--no-report',
             '--output', folder / 'found'),
            ('par4_validate', folder / 'bag', *machine, '--model', folder / 'found' / 'model.yaml',
             '--no-report', '--output', folder / 'found')):
        done = subprocess.run([str(BIN / command[0]), *map(str, command[1:])],
                              capture_output=True, text=True, check=False)
        if done.returncode:
            raise InputError(done.stderr.strip())
    return tuple(json.loads((folder / 'found' / f'{name}.json').read_text('utf-8'))
                 for name in ('identification', 'validation'))


def main() -> int:
    """Print everything; return the exit code."""
    console = Console(highlight=False, width=100)
    path = data_path(*sys.argv[1:2])
    if path is None:
        print(f'error: give the path of DATA_EMPS.mat as argument or in {VARIABLE}',
              file=sys.stderr)
        return 2
    try:
        recording = read_recording(path)
        console.print(reproduced_table(recording))
        estimates = own_estimates(recording)
        console.print(own_table(estimates))
        bias = estimates['instrumental'].bias
        console.print('Is least squares biased? largest difference '
                      f'{np.abs(bias.difference / estimates["weighted"].std).max():.2f} of its '
                      f'standard deviations, p = {bias.p_value:.2g}\n')
        diagnosis = diagnosis_of_axis(recording)
        console.print(claims_table(diagnosis))
        for table in (steps_table, low_speed_table, periods_table):
            console.print(table(recording, diagnosis))
        with tempfile.TemporaryDirectory() as folder:
            identification, validation = through_a_bag(recording, Path(folder))
    except Par4Error as error:
        print(f'error: {error}', file=sys.stderr)
        return 2
    console.print('\nThrough a bag, par4_identify --offsets:')
    for name, entry in {**identification['parameters'], **identification['offsets']}.items():
        console.print(f'  {name} {np.atleast_1d(entry["value"])[0]:.4g} ± '
                      f'{np.atleast_1d(entry["std"])[0]:.2g} {entry["unit"]}')
    console.print(f'  par4_validate: relative error '
                  f'{100.0 * validation["overall"]["relative_error"]:.2f} %, without standstill '
                  f'{100.0 * validation["without_standstill"]["overall"]["relative_error"]:.2f} %')
    return 0


if __name__ == '__main__':
    sys.exit(main())
