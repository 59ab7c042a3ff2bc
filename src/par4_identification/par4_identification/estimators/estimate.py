"""What every estimator gives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from par4_identification.estimators.normal_equations import mean_square, residuals_of
from par4_identification.estimators.problem import Label, Problem, Series


@dataclass(frozen=True)
class Estimate:
    """Result of a fit.

    Attributes:
        labels: of the values.
        values: chi, (p,).
        covariance: of chi, residuals correlated in time and between outputs, (p, p).
        textbook_std: what the textbook states, which takes the residual for white noise, (p,).
        residuals: y - W chi of each series, (m, J).
        rms: root mean square of the valid residuals of each output, (J,).
        relative_error: |residual| / |y| over all valid rows.
        condition_number: of the stacked W of valid rows.
        rows: number of valid rows.
    """

    labels: tuple[Label, ...]
    values: np.ndarray
    covariance: np.ndarray
    textbook_std: np.ndarray
    residuals: tuple[np.ndarray, ...]
    rms: np.ndarray
    relative_error: float
    condition_number: float
    rows: int

    @property
    def std(self) -> np.ndarray:
        """Standard deviations (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def relative_std(self) -> np.ndarray:
        """Standard deviations over the size of their values (p,)."""
        with np.errstate(divide='ignore', invalid='ignore'):
            return self.std / np.abs(self.values)


def fields_of_estimate(problem: Problem, values: np.ndarray, covariance: np.ndarray,
                       textbook_std: np.ndarray) -> dict[str, Any]:
    """Return the fields of an `Estimate` of these values."""
    residuals = residuals_of(problem, values)
    square = mean_square(problem, residuals)
    target = np.concatenate([part.target[part.valid] for part in problem.series])
    left = np.concatenate([residual[part.valid]
                           for residual, part in zip(residuals, problem.series)])
    return {
        'labels': problem.labels, 'values': values, 'covariance': covariance,
        'textbook_std': textbook_std, 'residuals': residuals, 'rms': np.sqrt(square),
        'relative_error': float(np.linalg.norm(left)) / max(float(np.linalg.norm(target)), 1e-30),
        'condition_number': condition_number(problem.series), 'rows': problem.rows}


def condition_number(series: Sequence[Series]) -> float:
    """Return the condition number of the stacked W of valid rows."""
    return float(np.linalg.cond(np.concatenate([part.columns[part.valid] for part in series])))
