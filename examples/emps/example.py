"""A measured axis: the published identification, the project's own, and the way through a bag.

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

from own_recipe import own_estimates, values_by_name
from par4_identification.estimators.estimate import Estimate
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.files import write_yaml
from published_recipe import BY_DIRECTION, COLUMNS, published_estimate
from recording import VARIABLE, Recording, data_path, read_recording, write_bag

PUBLISHED = {
    'M': ('95.1089', '0.1141'), 'Fv': ('203.5034', '0.5631'), 'Fc': ('20.3935', '0.4964'),
    'offset': ('-3.1648', '1.4021')}
"""Value and relative deviation in percent, as printed."""
PUBLISHED_FIT = ('4.0834', '25.9883')
"""Relative error in percent and condition number, as printed."""
PUBLISHED_BY_DIRECTION = {'M': '95.1540', 'Fv+': '166.7061', 'Fc+': '20.1440', 'Fv-': '240.4236',
                          'Fc-': '20.6277'}
PUBLISHED_FIT_BY_DIRECTION = '3.1117'
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
             '--output', folder / 'found')):
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
                      f'standard deviations, p = {bias.p_value:.2g}')
        with tempfile.TemporaryDirectory() as folder:
            identification, validation = through_a_bag(recording, Path(folder))
    except Par4Error as error:
        print(f'error: {error}', file=sys.stderr)
        return 2
    console.print('\nThrough a bag, par4_identify --offsets (rows above 0.05 m/s):')
    for name, entry in {**identification['parameters'], **identification['offsets']}.items():
        console.print(f'  {name} {np.atleast_1d(entry["value"])[0]:.4g} ± '
                      f'{np.atleast_1d(entry["std"])[0]:.2g} {entry["unit"]}')
    console.print(f'  par4_validate: relative error '
                  f'{100.0 * validation["overall"]["relative_error"]:.2f} %, without standstill '
                  f'{100.0 * validation["without_standstill"]["overall"]["relative_error"]:.2f} %')
    return 0


if __name__ == '__main__':
    sys.exit(main())
