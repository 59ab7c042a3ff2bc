"""Ordinary least squares: the textbook's, every row counting alike."""

from __future__ import annotations

import numpy as np

from par4_identification.estimators.covariance import sandwich, scores_of
from par4_identification.estimators.estimate import Estimate, fields_of_estimate
from par4_identification.estimators.normal_equations import residuals_of, solve, weights_of
from par4_identification.estimators.problem import Problem


def ordinary(problem: Problem) -> Estimate:
    """Return chi = (W^T W)^-1 W^T y.

    Its textbook deviations are those of the literature on identification (Gautier and Khalil
    1990): s^2 (W^T W)^-1 with s^2 = |r|^2 / (N - p) over all N rows.

    Raises:
        InputError: too few rows, or columns that do not tell the values apart.
    """
    weights = weights_of(problem, np.ones(problem.outputs))
    solution = solve(problem, weights)
    residuals = residuals_of(problem, solution.values)
    weighted = [residual * weight for residual, weight in zip(residuals, weights)]
    square = sum((part ** 2).sum() for part in weighted) / (problem.rows - problem.size)
    covariance = sandwich(
        solution.inverse, scores_of([part.columns for part in problem.series], weighted),
        problem.rows)
    return Estimate(**fields_of_estimate(problem, solution.values, covariance,
                                         np.sqrt(square * np.diag(solution.inverse))))
