"""Physically consistent estimation: least squares under linear constraints, a convex program.

minimise 1/2 chi^T H chi - b^T chi subject to A chi >= lower, with the H = sum W^T S^-1 W and
b = sum W^T S^-1 y of weighted least squares. H is positive definite, so that the minimum is one
point; the dual active-set solver DAQP (Arnstrom, Bemporad and Axehill 2022) tells exactly which
constraints hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.estimators.covariance import sandwich, scores_of
from par4_identification.estimators.estimate import Estimate, fields_of_estimate
from par4_identification.estimators.normal_equations import residuals_of
from par4_identification.estimators.problem import Problem
from par4_identification.estimators.weighted import weighted, weighted_solution
from par4_kinematics.errors import InputError

UNBOUNDED = 1e30
"""What the solver takes for no bound."""


@dataclass(frozen=True)
class Constraint:
    """coefficients @ chi >= lower.

    Attributes:
        name: what must not be less, for people.
        coefficients: (p,).
        lower: bound.
    """

    name: str
    coefficients: np.ndarray
    lower: float = 0.0


@dataclass(frozen=True)
class ConsistentEstimate(Estimate):
    """An estimate with what physics had to say.

    Attributes:
        active: names of the constraints that hold the values; empty if physics changes nothing.
        rise: relative rise of the weighted residual's norm over that of least squares.
        least_squares: without constraints.
    """

    active: tuple[str, ...]
    rise: float
    least_squares: Estimate


def consistent(problem: Problem, constraints: Sequence[Constraint]) -> ConsistentEstimate:
    """Return the least squares values that meet every constraint.

    Deviations are those under the active constraints: a value that one of them fixes has none.

    Raises:
        InputError: too few rows, columns that do not tell the values apart, or constraints that
            contradict each other.
    """
    import daqp  # only needed here

    solution, weights = weighted_solution(problem)
    scale = np.sqrt(np.diag(solution.matrix))
    hessian = solution.matrix / np.outer(scale, scale)
    rows = np.array([item.coefficients for item in constraints]).reshape(-1, problem.size) / scale
    size = np.linalg.norm(rows, axis=1)
    rows, lower = rows / size[:, None], np.array([item.lower for item in constraints]) / size
    _, _, flag, info = daqp.solve(
        hessian, -solution.moment / scale, rows, np.full(len(rows), UNBOUNDED), lower,
        np.zeros(len(rows), dtype=np.intc))
    if flag != 1:
        raise InputError(f'no values meet the constraints {", ".join(c.name for c in constraints)} '
                         f'(solver flag {flag}); check the masses that the robot file gives')
    active = info['lam'] != 0.0

    # with the active constraints as equations the solver's tolerance drops out
    values, inverse = solution.values, solution.inverse
    if active.any():
        fixed, bound = rows[active] * scale, lower[active]
        gain = inverse @ fixed.T @ np.linalg.pinv(fixed @ inverse @ fixed.T)
        values = values - gain @ (fixed @ values - bound)
        inverse = inverse - gain @ fixed @ inverse
        # what an equation fixes is fixed to the last digit: below the bound it would be refused
        for item in (item for item, is_active in zip(constraints, active) if is_active):
            own = np.flatnonzero(item.coefficients)
            if len(own) == 1:
                values[own] = item.lower / item.coefficients[own]
    residuals = residuals_of(problem, values)
    weighted_residuals = [part * weight for part, weight in zip(residuals, weights)]
    scores = scores_of([part.columns for part in problem.series], weighted_residuals)
    # the constraints' forces stand in the scores' means; they are no noise
    count = sum(len(part) for part in scores)
    mean = sum(part.sum(axis=0) for part in scores) / count
    covariance = sandwich(inverse, [part - mean for part in scores], problem.rows)
    free = weighted(problem)
    norms = [np.sqrt(sum((part ** 2 * weight).sum() for part, weight in zip(own, weights)))
             for own in (residuals, free.residuals)]
    return ConsistentEstimate(
        **fields_of_estimate(problem, values, covariance,
                             np.sqrt(np.maximum(np.diag(inverse), 0.0))),
        active=tuple(item.name for item, is_active in zip(constraints, active) if is_active),
        rise=float(norms[0] / norms[1] - 1.0), least_squares=free)
