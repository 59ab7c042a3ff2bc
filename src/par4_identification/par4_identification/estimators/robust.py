"""Robust estimation: rows that the others contradict count little or not at all.

Minimises sum rho(r / sigma), sigma the spread of each output by the median. First Huber's rho,
which has one minimum, then Tukey's bisquare from there, under which gross outliers do not count
(an MM-estimate but for its start; Maronna, Martin and Yohai 2006, 5.5). Outliers in the torque,
not in the motion, are what this is for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.estimators.covariance import sandwich, scores_of
from par4_identification.estimators.estimate import Estimate, fields_of_estimate
from par4_identification.estimators.normal_equations import residuals_of, solve, weights_of
from par4_identification.estimators.problem import Problem
from par4_identification.estimators.weighted import weighted_solution

HUBER = 1.345
"""Residual over spread beyond which rows count less; 95 % efficient on Gaussian noise."""
BISQUARE = 4.685
"""Residual over spread beyond which rows do not count; 95 % efficient on Gaussian noise."""
SPREAD = 1.482602
"""Standard deviation of a Gaussian over its median absolute value."""
MOST_ROUNDS = 50
SETTLED = 1e-4
"""Relative change of spreads, or of values in standard deviations, at which they have settled."""


@dataclass(frozen=True)
class RobustEstimate(Estimate):
    """An estimate with what its rows counted.

    Attributes:
        weights: 0 to 1 of each row of each series, (m, J); zero where not valid.
    """

    weights: tuple[np.ndarray, ...]

    @property
    def rejected(self) -> float:
        """Fraction of the valid rows that do not count at all."""
        return 1.0 - sum(np.count_nonzero(part) for part in self.weights) / self.rows


def robust(problem: Problem) -> RobustEstimate:
    """Return the bisquare estimate, outputs weighted by the median size of their residuals.

    The covariance is the sandwich of the estimating equations sum W^T psi(r / sigma) / sigma = 0;
    the textbook deviations are Huber's (1981, 7.6) for white residuals.

    Raises:
        InputError: too few rows, or columns that do not tell the values apart.
    """
    values = weighted_solution(problem)[0].values
    columns = [part.columns for part in problem.series]
    valid = [part.valid for part in problem.series]
    sigma = _spread(problem, residuals_of(problem, values))
    for _ in range(MOST_ROUNDS):
        values = _reweighted(problem, values, sigma, _huber)
        before, sigma = sigma, _spread(problem, residuals_of(problem, values))
        if np.all(np.abs(sigma - before) < SETTLED * sigma):
            break
    values = _reweighted(problem, values, sigma, _bisquare)

    scaled = [residual / sigma for residual in residuals_of(problem, values)]
    weights = tuple(_bisquare(part) * mask for part, mask in zip(scaled, valid))
    # the derivative of psi(u) = u (1 - (u / c)^2)^2
    slope = [np.sqrt(part) * (5.0 * np.sqrt(part) - 4.0) for part in weights]
    inverse = solve(problem, [part / sigma ** 2 for part in slope]).inverse
    psi = [part * weight for part, weight in zip(scaled, weights)]
    covariance = sandwich(inverse, scores_of(columns, [part / sigma for part in psi]),
                          problem.rows)
    spread = sum((part ** 2).sum() for part in psi) / (problem.rows - problem.size)
    flat = sum(part.sum() for part in slope) / problem.rows
    least = solve(problem, weights_of(problem, sigma)).inverse
    textbook = np.sqrt(spread / flat ** 2 * np.diag(least))
    return RobustEstimate(**fields_of_estimate(problem, values, covariance, textbook),
                          weights=weights)


def _reweighted(problem: Problem, values: np.ndarray, sigma: np.ndarray,
                weight: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Return the values with sum W^T w(r / sigma) r / sigma^2 = 0, by reweighting."""
    for _ in range(MOST_ROUNDS):
        before = values
        solution = solve(problem, [
            part.valid * weight(residual / sigma) / sigma ** 2
            for part, residual in zip(problem.series, residuals_of(problem, values))])
        values = solution.values
        step = np.abs(values - before) / np.sqrt(np.diag(solution.inverse))
        if step.max() < SETTLED:
            break
    return values


def _huber(scaled: np.ndarray) -> np.ndarray:
    """Return the weights of residuals over their spread."""
    return HUBER / np.maximum(np.abs(scaled), HUBER)


def _bisquare(scaled: np.ndarray) -> np.ndarray:
    """Return the weights of residuals over their spread."""
    return np.maximum(1.0 - (scaled / BISQUARE) ** 2, 0.0) ** 2


def _spread(problem: Problem, residuals: Sequence[np.ndarray]) -> np.ndarray:
    """Return the spread (J,) of the valid residuals by their median size."""
    sizes = [np.concatenate([residual[part.valid[:, output], output]
                             for residual, part in zip(residuals, problem.series)])
             for output in range(problem.outputs)]
    return np.array([max(SPREAD * np.median(np.abs(size)), 1e-12) if len(size) else 1.0
                     for size in sizes])
