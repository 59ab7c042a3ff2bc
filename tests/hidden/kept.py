"""Recordings that are kept: what the diagnosis sees and the truth behind it, a file a scenario.

A file holds all that scoring needs, so that scoring it takes neither the simulation nor the
generator. It says which sources made it: files of other sources are told as stale.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import par4_sim
from par4_identification.logs.log import Log
from par4_kinematics.files import written_atomically
from par4_kinematics.robot import Robot

SCORING = ('scoring.py', 'kept.py', '__init__.py')
"""Files of this package that draw, record and judge nothing."""
MAKING = ('machines', 'plants', 'drives', 'closed_loop')
"""Rooms of the simulation by which recordings are made."""


def hash_of(paths: Iterable[Path]) -> str:
    """Return a short hash of files: names and content."""
    digest = hashlib.sha256()
    for path in sorted(paths, key=lambda path: (path.parent.name, path.name)):
        digest.update(f'{path.parent.name}/{path.name}\n'.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def generator_hash() -> str:
    """Return the hash of the sources that make recordings: generator and simulation."""
    here = Path(__file__).parent
    return hash_of([*(path for path in here.glob('*.py') if path.name not in SCORING),
                    here.parent / 'robots.py', *(
                        path for room in MAKING for path in
                        (Path(par4_sim.__file__).parent / room).glob('*.py'))])


@dataclass(frozen=True)
class Kept:
    """One scenario, recorded and judged.

    Attributes:
        truth: task, machine, what is hidden, as plain data; 'kind' and 'seed' name it.
        robot: what is known of the machine.
        fit, heldout: the logs that the diagnosis sees.
        noise: what no model could explain of the held-out log, (n, 4) N m.
        generator: hash of the sources that made it.
    """

    truth: dict[str, Any]
    robot: Robot
    fit: Log
    heldout: Log
    noise: np.ndarray
    generator: str

    @property
    def name(self) -> str:
        """Kind and seed, the stem of its file."""
        return file_name(self.truth['kind'], self.truth['seed'])

    def write(self, folder: Path) -> Path:
        """Write the file and return its path."""
        path = folder / f'{self.name}.npz'
        header = {'truth': self.truth, 'generator': self.generator,
                  'robot': self.robot.model_dump(mode='json', by_alias=True),
                  'logs': [{'name': log.name, 'joint_names': list(log.joint_names),
                            'start_stamp': log.start_stamp, 'period': log.period,
                            'segments': [[part.start, part.stop] for part in log.segments]}
                           for log in (self.fit, self.heldout)]}
        arrays = {f'{field}_{number}': getattr(log, field)
                  for number, log in enumerate((self.fit, self.heldout))
                  for field in ('t', 'q', 'tau')}
        with written_atomically(path) as scratch, scratch.open('wb') as file:
            # of the noise a mean square alone is taken
            np.savez_compressed(file, header=np.array(json.dumps(header)),
                                noise=self.noise.astype(np.float32), **arrays)
        return path


def file_name(kind: str, seed: int) -> str:
    """Return the stem of a scenario's file."""
    return f'{kind}-{seed}'


def read_header(path: Path) -> dict[str, Any]:
    """Return what a file tells without its logs."""
    with np.load(path) as file:
        return json.loads(str(file['header']))


def read_kept(path: Path) -> Kept:
    """Return the scenario of a file."""
    with np.load(path) as file:
        header = json.loads(str(file['header']))
        logs = [Log(name=told['name'], joint_names=tuple(told['joint_names']),
                    start_stamp=told['start_stamp'], period=told['period'],
                    segments=tuple(slice(*part) for part in told['segments']),
                    reference=None, accounts=None,
                    **{field: file[f'{field}_{number}'] for field in ('t', 'q', 'tau')})
                for number, told in enumerate(header['logs'])]
        return Kept(header['truth'], Robot.model_validate(header['robot']), *logs,
                    file['noise'].astype(float), header['generator'])
