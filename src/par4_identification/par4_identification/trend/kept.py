"""What bags said, kept in a folder: a bag that was seen is not computed again."""

from __future__ import annotations

import json
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from par4_dynamics.model_file import ModelFile
from par4_identification.logs.bag_hash import bag_sha256
from par4_identification.trend.bag_values import FORMAT, BagValues
from par4_kinematics.files import written_atomically
from par4_kinematics.robot import Axis, Robot

FOLDER = 'bags'
"""In the folder of results."""


class Kept:
    """Results of bags in files, named by what they were computed from, and by which version.

    Args:
        folder: of all results.
        machine, model_file, namespace: by which bags are read; others give other results.
    """

    def __init__(self, folder: Path, machine: Robot | Axis, model_file: ModelFile | None,
                 namespace: str | None) -> None:
        self._folder = folder / FOLDER
        self._settings = json.dumps(
            [FORMAT, version('par4_identification'), machine.model_dump(mode='json'),
             None if model_file is None else model_file.to_yaml(), namespace], sort_keys=True)

    def key(self, bag: str) -> str:
        """Return the name of a bag's result.

        Raises:
            OSError: the bag cannot be read.
        """
        return sha256(f'{bag_sha256(bag)} {self._settings}'.encode()).hexdigest()[:32]

    def read(self, key: str) -> dict[str, Any] | None:
        """Return a result, None where there is none that can be read, so that it is made anew."""
        try:
            result = json.loads((self._folder / f'{key}.json').read_text(encoding='utf-8'))
            BagValues.from_json(result, '')
        except (OSError, ValueError, RecursionError):  # no result, no JSON, or not even text
            return None
        return result

    def write(self, key: str, result: dict[str, Any]) -> None:
        """Keep a result."""
        with written_atomically(self._folder / f'{key}.json') as scratch:
            scratch.write_text(json.dumps(result), encoding='utf-8')
