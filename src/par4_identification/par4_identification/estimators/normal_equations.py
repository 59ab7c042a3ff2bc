"""Weighted normal equations Z^T w W chi = Z^T w y, and when they cannot be solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.estimators.problem import Problem
from par4_kinematics.errors import InputError

ROWS_PER_VALUE = 5
"""Fewest valid rows a value."""
SINGULAR = 1e12
"""Condition number of the scaled equations above which they say nothing."""


@dataclass(frozen=True)
class Solution:
    """Solved normal equations.

    Attributes:
        values: chi, (p,).
        matrix: sum Z^T w W, (p, p).
        moment: sum Z^T w y, (p,).
        inverse: of the matrix, (p, p).
    """

    values: np.ndarray
    matrix: np.ndarray
    moment: np.ndarray
    inverse: np.ndarray


def solve(problem: Problem, weights: Sequence[np.ndarray],
          instruments: Sequence[np.ndarray] | None = None) -> Solution:
    """Return chi with sum Z^T w (y - W chi) = 0; Z = W makes that least squares.

    Args:
        problem: W and y.
        weights: w of each series, (m, J), zero for rows that do not count.
        instruments: Z of each series, (m, J, p), or None for W.

    Raises:
        InputError: fewer valid rows than values ask for, or columns that do not tell them apart.
    """
    if problem.rows < ROWS_PER_VALUE * problem.size:
        raise InputError(f'{problem.rows} usable rows for {problem.size} parameters; record a '
                         f'longer motion in which all joints move')
    columns = [part.columns for part in problem.series]
    instruments = columns if instruments is None else instruments
    matrix = product(instruments, weights, columns)
    moment = product(instruments, weights, [part.target[..., None] for part in problem.series]
                     )[:, 0]
    row_scale, scale = (np.sqrt(sum(np.einsum('mjp,mj->p', part ** 2, weight)
                                    for part, weight in zip(parts, weights)))
                        for parts in (instruments, columns))
    for size in (scale, row_scale):
        if np.any(size == 0.0):
            raise InputError(f'{problem.labels[int(np.argmin(size))]} does not show in the data; '
                             f'record a motion that excites it')
    scaled = matrix / np.outer(row_scale, scale)
    if np.linalg.cond(scaled) > SINGULAR:
        raise InputError('the motion does not tell the parameters apart (singular regressor); '
                         'record a richer motion')
    inverse = np.linalg.inv(scaled)
    return Solution(inverse @ (moment / row_scale) / scale, matrix, moment,
                    inverse / np.outer(scale, row_scale))


def product(left: Sequence[np.ndarray], weights: Sequence[np.ndarray],
            right: Sequence[np.ndarray]) -> np.ndarray:
    """Return sum A^T w B (p, r) over rows of A (m, J, p) and B (m, J, r).

    Without the threads of a matrix product, which cost more than they save at this size.
    """
    return sum(np.einsum('mjp,mjr->pr', a * w[..., None], b)
               for a, w, b in zip(left, weights, right, strict=True))


def residuals_of(problem: Problem, values: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return y - W chi of each series, (m, J)."""
    return tuple(part.target - part.columns @ values for part in problem.series)


def mean_square(problem: Problem, residuals: Sequence[np.ndarray]) -> np.ndarray:
    """Return the mean square of the valid residuals of each output, (J,)."""
    count = np.maximum(sum(part.valid.sum(axis=0) for part in problem.series), 1)
    return sum((residual ** 2 * part.valid).sum(axis=0)
               for residual, part in zip(residuals, problem.series)) / count


def weights_of(problem: Problem, sigma: np.ndarray) -> list[np.ndarray]:
    """Return valid / sigma^2 of each series, (m, J), for sizes sigma (J,) of the noise."""
    return [part.valid / sigma ** 2 for part in problem.series]
