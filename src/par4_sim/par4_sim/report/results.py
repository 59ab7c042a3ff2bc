"""The files of a run: what is in them besides the result, and how none is ever half there."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from par4_dynamics.model_file import ModelFile
from par4_kinematics.files import alone_in, written_atomically, yaml_text
from par4_kinematics.robot import Axis, Robot

Results = Mapping[str, str | dict[str, Any] | ModelFile | None]
"""What is written under each name."""


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


def origin(tool: str, machine: Robot | Axis, options: Mapping[str, Any]) -> dict[str, Any]:
    """Return where a result comes from: tool, date, versions, machine, options that are set."""
    return {
        'tool': tool, 'date': datetime.now(UTC).isoformat(timespec='seconds'),
        'versions': {'par4': version('par4_sim'), 'numpy': np.__version__},
        'robot': machine.name,
        'options': plain({name: value for name, value in options.items() if value})}


@contextmanager
def results_into(folder: Path) -> Iterator[Callable[[Results], None]]:
    """Yield what writes results into a folder, which no other command does in this block.

    It writes text, JSON or a model under each name; all are whole before the first is replaced.
    None removes what an earlier run left under that name. Other files in the folder stay.

    Raises:
        InputError: they cannot be written.
    """
    with alone_in(folder):
        yield partial(_write, folder)


def write_results(folder: Path, results: Results) -> None:
    """Write results alone into a folder; see `results_into`."""
    with results_into(folder) as write:
        write(results)


def _write(folder: Path, results: Results) -> None:
    with ExitStack() as complete:
        for name, content in results.items():
            if content is None:
                continue
            scratch = complete.enter_context(written_atomically(folder / name))
            if isinstance(content, ModelFile):
                scratch.write_text(yaml_text(content.to_yaml()), 'utf-8')
            elif isinstance(content, dict):
                scratch.write_text(json.dumps(content, indent=2, allow_nan=False) + '\n', 'utf-8')
            else:
                scratch.write_text(content, 'utf-8')
    for name in (name for name, content in results.items() if content is None):
        (folder / name).unlink(missing_ok=True)
