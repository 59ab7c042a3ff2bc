"""The linear problem y = W chi that every estimator takes: blocks of rows, and what chi is called.

A column is shared by all outputs or, after `per_output`, has a value for each of them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from par4_kinematics.errors import InputError


@dataclass(frozen=True)
class Series:
    """Rows of one uninterrupted run.

    Attributes:
        target: y, (m, J).
        columns: W, (m, J, p).
        valid: rows that count, (m, J).
    """

    target: np.ndarray
    columns: np.ndarray
    valid: np.ndarray


@dataclass(frozen=True)
class Label:
    """What one of the values is.

    Attributes:
        name: of the parameter.
        unit: of the value.
        output: the one output that the value belongs to, None where all share it.
    """

    name: str
    unit: str
    output: int | None = None

    def __str__(self) -> str:
        return self.name if self.output is None else f'{self.name}[{self.output}]'


@dataclass(frozen=True)
class Problem:
    """y = W chi over several runs, which are never joined.

    Attributes:
        series: the runs.
        labels: of the p columns.
    """

    series: tuple[Series, ...]
    labels: tuple[Label, ...]

    @property
    def outputs(self) -> int:
        """J."""
        return self.series[0].columns.shape[1]

    @property
    def size(self) -> int:
        """Number p of values."""
        return len(self.labels)

    @property
    def rows(self) -> int:
        """Number of valid rows."""
        return int(sum(part.valid.sum() for part in self.series))


def problem_of(series: Sequence[Series], names: Sequence[str], units: Sequence[str]) -> Problem:
    """Return the problem of shared columns.

    Raises:
        InputError: not one name and unit a column.
    """
    columns = series[0].columns.shape[2]
    if not columns == len(names) == len(units):
        raise InputError(f'{columns} columns with {len(names)} names and {len(units)} units; give '
                         f'one of each a column')
    return Problem(tuple(series), tuple(map(Label, names, units)))


def per_output(problem: Problem, names: Collection[str]) -> Problem:
    """Return the problem in which each output has its own value of the named columns.

    Raises:
        InputError: an unknown name.
    """
    unknown = set(names) - {label.name for label in problem.labels}
    if unknown:
        raise InputError(f'no column {", ".join(sorted(unknown))}; there are '
                         f'{", ".join(map(str, problem.labels))}')
    split = [label.name in names and label.output is None for label in problem.labels]
    labels = []
    for label, own in zip(problem.labels, split):
        labels += [Label(label.name, label.unit, output) for output in range(problem.outputs)
                   ] if own else [label]

    return Problem(tuple(Series(part.target, _spread(part.columns, split), part.valid)
                         for part in problem.series), tuple(labels))


def _spread(columns: np.ndarray, split: Sequence[bool]) -> np.ndarray:
    """Return columns (m, J, p) with those of `split` (p,) as J columns, each of one output."""
    own = np.eye(columns.shape[1])
    return np.concatenate([columns[..., index, None] * own if apart else columns[..., index, None]
                           for index, apart in enumerate(split)], axis=-1)


def with_offsets(problem: Problem, name: str, unit: str) -> Problem:
    """Return the problem with a constant of each output, of this name, among the values."""
    labels = [Label(name, unit, output) for output in range(problem.outputs)]
    return Problem(tuple(Series(part.target, _with_constants(part.columns), part.valid)
                         for part in problem.series), (*problem.labels, *labels))


def _with_constants(columns: np.ndarray) -> np.ndarray:
    """Return columns (m, J, p) followed by one constant an output, (m, J, p + J)."""
    rows, outputs = columns.shape[:2]
    ones = np.broadcast_to(np.eye(outputs), (rows, outputs, outputs))
    return np.concatenate((columns, ones), axis=-1)
