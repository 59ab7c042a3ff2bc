"""Four measured axes whose faults are known, each from its file to an answer by the commands alone.

    PAR4_AXES_DATA=/path/to/archives python examples/axes/measured_axes.py [DATA SET ...]

The archives stand outside the repository; docs/measured.md says what they are.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from par4_kinematics import InputError

VARIABLE = 'PAR4_AXES_DATA'
HERE = Path(__file__).parent
BIN = Path(sys.executable).parent


@dataclass(frozen=True)
class DataSet:
    """What a measured axis needs on its way to an answer.

    Attributes:
        name: to ask for it by.
        archive: file of the measured tables, whose stem is that of the axis file beside this one.
        columns: options of `par4_bag` that say what the tables hold.
        runs: tables to fit; one that ends with `__` stands for all that begin with it. `NAME 8 40`
            is the part of a table from 8 to 40 s.
        heldout: tables to confirm on; without any, a part of the others is held out.
        known: what is known to be wrong with it.
    """

    name: str
    archive: str
    columns: tuple[str, ...]
    runs: tuple[str, ...]
    heldout: tuple[str, ...]
    known: str

    @property
    def robot(self) -> Path:
        """The axis file: what the nameplate says."""
        return HERE / Path(self.archive).with_suffix('.yaml').name


LAAS_COLUMNS = ('--columns', 'time=1:s position=2:rad velocity=3:rad/s torque=5:A',
                '--motor-gain', '0.025')
SCREW_COLUMNS = ('--columns', 'time=1:s position=2:rad velocity=3:rad/s torque=4:Nm')
DATA_SETS = (
    DataSet('laas', 'laas.npz', LAAS_COLUMNS, ('speed_test 8.01 40',), (),
            'cogging, 72 periods a turn, 0.15 to 0.21 A (3.8 to 5.3 mN m)'),
    DataSet('odrive', 'odrive.npz',
            ('--columns', 'time=1:s position=2:counts torque=3:A', '--counts-per-turn', '8192',
             '--motor-gain', '0.0551'),
            ('slow2_slower__nocomp_0',), ('slow2_slower__comp_0',),
            'cogging with 7, 28, 14, 12, 36 and 84 periods a turn'),
    DataSet('screw1', 'screws.npz', SCREW_COLUMNS, ('drive1__',), (),
            'a lead screw: Stribeck friction, and a hanging load'),
    DataSet('screw2', 'screws.npz', SCREW_COLUMNS, ('drive2__',), (),
            'a screw without backlash: no Stribeck friction'),
    DataSet('screw3', 'screws.npz', SCREW_COLUMNS, ('drive3__',), (),
            'a worm: a little Stribeck friction, and a hanging load'),
    DataSet('xl330', 'xl330.npz',
            ('--columns', 'time=1:s position=2:rad velocity=3:rad/s voltage=4:V'),
            ('sin_sin__kp100', 'sin_sin__kp200', 'sin_sin__kp400'), ('sin_sin__kp800',),
            'friction that grows with the load'))
Command = Callable[[Sequence[str]], str]


@dataclass(frozen=True)
class Answer:
    """What `par4_diagnose` says: diagnosis.json, and its words on the terminal."""

    diagnosis: dict[str, Any]
    words: str


def called(words: Sequence[str]) -> str:
    """Run a command of the project; return what it prints.

    Raises:
        InputError: it refused; says why.
    """
    done = subprocess.run([str(BIN / words[0]), *words[1:]], capture_output=True, text=True,
                          check=False)
    if done.returncode:
        raise InputError(done.stderr.strip())
    return done.stdout


def answer(data: DataSet, archives: Path, folder: Path, call: Command = called) -> Answer:
    """Return the answer for a data set.

    Args:
        data: which one.
        archives: folder of the measured tables.
        folder: for the bags and the results.
        call: runs a command of these words; returns what it prints.

    Raises:
        InputError: a file is missing, or a command refused.
    """
    archive = archives / data.archive
    if not archive.is_file():
        raise InputError(f'{archive}: there is no such file; {VARIABLE} gives the folder of the '
                         f'archives')
    tables = list(np.load(archive))
    bags: dict[str, list[str]] = {'fit': [], 'heldout': []}
    for use, asked in (('fit', data.runs), ('heldout', data.heldout)):
        for run in asked:
            name, *span = run.split()
            for table in (tables if name.endswith('__') else [name]):
                if not table.startswith(name):
                    continue
                bag = str(folder / table)
                call(['par4_bag', str(archive), '--array', table, *data.columns, '--joints',
                      'motor', *(['--between', *span] if span else []), '--output', bag])
                bags[use].append(bag)
    results = folder / 'diagnosed'
    heldout = [word for bag in bags['heldout'] for word in ('--holdout', bag)]
    said = call(['par4_diagnose', *bags['fit'], *heldout, '--robot', str(data.robot), '--output',
                 str(results)])
    return Answer(json.loads((results / 'diagnosis.json').read_text('utf-8')),
                  said[:said.rfind('\nresults')])


def chosen(names: Sequence[str]) -> list[DataSet]:
    """Return the data sets of these names, all without any.

    Raises:
        InputError: there is none of a name.
    """
    known = {data.name: data for data in DATA_SETS}
    for name in names:
        if name not in known:
            raise InputError(f'{name}: there is no such data set; there are {", ".join(known)}')
    return [known[name] for name in names] if names else list(DATA_SETS)


def main() -> int:
    """Print what is known beside what the commands answer; return the exit code."""
    console = Console(highlight=False)
    table = Table('data', 'known', 'answer', box=SIMPLE_HEAD)

    def shown(words: Sequence[str]) -> str:
        console.print('$ ' + shlex.join(words), style='dim', markup=False, soft_wrap=True)
        return called(words)

    try:
        if VARIABLE not in os.environ:
            raise InputError(f'{VARIABLE} is not set; it gives the folder of the archives')
        for data in chosen(sys.argv[1:]):
            with tempfile.TemporaryDirectory() as folder:
                found = answer(data, Path(os.environ[VARIABLE]), Path(folder), shown)
            table.add_row(data.name, data.known, found.words)
    except InputError as error:
        print(f'error: {error}', file=sys.stderr)
        return 2
    console.print(table)
    return 0


if __name__ == '__main__':
    sys.exit(main())
