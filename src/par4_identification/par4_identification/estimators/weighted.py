"""Weighted least squares: every output weighs by the size of its own residual."""

from __future__ import annotations

import numpy as np

from par4_identification.estimators.covariance import sandwich, scores_of
from par4_identification.estimators.estimate import Estimate, fields_of_estimate
from par4_identification.estimators.normal_equations import (
    Solution,
    mean_square,
    residuals_of,
    solve,
    weights_of,
)
from par4_identification.estimators.problem import Problem

ROUNDS = 3
"""Rounds after which the weights have settled."""


def weighted(problem: Problem) -> Estimate:
    """Return chi = (sum W^T S^-1 W)^-1 sum W^T S^-1 y, S diagonal over the outputs.

    The textbook deviations are the roots of the diagonal of (sum W^T S^-1 W)^-1.

    Raises:
        InputError: too few rows, or columns that do not tell the values apart.
    """
    solution, weights = weighted_solution(problem)
    residuals = residuals_of(problem, solution.values)
    scores = scores_of([part.columns for part in problem.series],
                       [residual * weight for residual, weight in zip(residuals, weights)])
    covariance = sandwich(solution.inverse, scores, problem.rows)
    return Estimate(**fields_of_estimate(problem, solution.values, covariance,
                                         np.sqrt(np.diag(solution.inverse))))


def weighted_solution(problem: Problem) -> tuple[Solution, list[np.ndarray]]:
    """Return the solution and the weights (m, J) of each series behind it."""
    sigma = np.ones(problem.outputs)
    for _ in range(ROUNDS):
        weights = weights_of(problem, sigma)
        solution = solve(problem, weights)
        square = mean_square(problem, residuals_of(problem, solution.values))
        sigma = np.sqrt(np.maximum(square, 1e-24))
    return solution, weights
