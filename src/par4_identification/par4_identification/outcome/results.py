"""The files of a run: what is in them besides the result, and how none is ever half there."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from hashlib import file_digest, sha256
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from par4_dynamics.model_file import ModelFile, write_model_file
from par4_dynamics.parameters import Parameter
from par4_identification.log import Log
from par4_identification.outcome.words import unit_on
from par4_kinematics.errors import InputError
from par4_kinematics.files import written_atomically
from par4_kinematics.robot import Axis, Robot


def plain(value: Any) -> Any:
    """Return nested content as JSON takes it: no numpy, and null for NaN and infinity."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def data_of_logs(logs: Sequence[Log]) -> list[dict[str, Any]]:
    """Return what was read, repaired and dropped, a bag each."""
    return [{**log.accounts.to_json(), 'findings': log.accounts.findings()} for log in logs]


def bag_sha256(path: str | Path) -> str:
    """Return the hash of a bag: that of its file, or that of its files' hashes and names.

    A folder's is the one of `sha256sum *` in it.
    """
    path = Path(path)
    files = [path] if path.is_file() else sorted(item for item in path.rglob('*') if item.is_file())
    lines = []
    for file in files:
        with file.open('rb') as stream:
            digest = file_digest(stream, 'sha256').hexdigest()
        lines.append(f'{digest}  {file.relative_to(path)}\n')
    return digest if path.is_file() else sha256(''.join(lines).encode()).hexdigest()


def provenance(tool: str, machine: Robot | Axis, bags: Sequence[str | Path],
               options: Mapping[str, Any]) -> dict[str, Any]:
    """Return where a model comes from: tool, date, versions, machine, bags with hashes, options."""
    return {
        'tool': tool, 'date': datetime.now(UTC).isoformat(timespec='seconds'),
        'versions': {'par4': version('par4_identification'), 'numpy': np.__version__},
        'robot': machine.name,
        'bags': [{'path': str(bag), 'sha256': bag_sha256(bag)} for bag in bags],
        'options': plain({name: value for name, value in options.items() if value})}


def bags_of(model_file: ModelFile) -> frozenset[str]:
    """Return the hashes of the bags that a model was identified from, as far as it tells them."""
    bags = model_file.provenance.get('bags')
    return frozenset(str(bag.get('sha256')) for bag in bags if isinstance(bag, dict)
                     ) if isinstance(bags, list) else frozenset()


def model_in_units(model_file: ModelFile, machine: Robot | Axis) -> ModelFile:
    """Return the model with the units of its parameters as they are on the machine."""
    def converted(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
        return {name: parameter.model_copy(update={'unit': unit_on(machine, parameter.unit)})
                for name, parameter in parameters.items()}

    return model_file.model_copy(update={
        'parameters': converted(model_file.parameters),
        'effects': tuple(entry.model_copy(update={'parameters': converted(entry.parameters)})
                         for entry in model_file.effects)})


def refuse_unwritable(folder: Path) -> None:
    """See that results can be written to a folder, which need not exist, before any long work.

    Raises:
        InputError: they cannot.
    """
    try:
        there = next(path for path in (folder, *folder.absolute().parents) if path.exists())
        with TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InputError(f'{folder}: results cannot be written there '
                         f'({(error.strerror or str(error)).lower()}); give another folder as '
                         f'--output') from error


def write_results(folder: Path, results: Mapping[str, str | dict | ModelFile | None]) -> None:
    """Write text, JSON or a model under each name; all are whole before the first is replaced.

    None removes what an earlier run left under that name. Other files in the folder stay.
    """
    with ExitStack() as complete:
        for name, content in results.items():
            if content is None:
                continue
            scratch = complete.enter_context(written_atomically(folder / name))
            if isinstance(content, ModelFile):
                write_model_file(scratch, content)
            elif isinstance(content, dict):
                scratch.write_text(json.dumps(content, indent=2, allow_nan=False) + '\n', 'utf-8')
            else:
                scratch.write_text(content, 'utf-8')
    for name in (name for name, content in results.items() if content is None):
        (folder / name).unlink(missing_ok=True)
