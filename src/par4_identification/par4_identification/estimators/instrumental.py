"""Instrumental variables: unbiased where the regressor itself is noisy.

Least squares takes W for known. Noise of the positions, differentiated twice, makes W noisy, and a
closed loop feeds it back into the torque: the residual then correlates with W and least squares is
biased. Instruments Z, columns that move like W but know nothing of its noise, cure that. The
columns of a simulation of the closed loop along the same reference do (Janot, Vandanjon and
Gautier 2014, IDIM-IV); so do those of a second measurement of the same motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.estimators.bias_test import BiasTest, bias_test
from par4_identification.estimators.covariance import sandwich, scores_of
from par4_identification.estimators.estimate import Estimate, fields_of_estimate
from par4_identification.estimators.normal_equations import product, residuals_of, solve
from par4_identification.estimators.problem import Problem
from par4_identification.estimators.weighted import weighted, weighted_solution
from par4_kinematics.errors import InputError

WEAK = 0.3
"""Canonical correlation of instruments and columns below which the instruments say too little."""


@dataclass(frozen=True)
class InstrumentalEstimate(Estimate):
    """An estimate with the test of least squares against it.

    Attributes:
        bias: of weighted least squares.
        least_squares: the estimate tested.
        relevance: smallest canonical correlation of instruments and columns, 0 to 1.
    """

    bias: BiasTest
    least_squares: Estimate
    relevance: float


def instrumental(problem: Problem, instruments: Sequence[np.ndarray]) -> InstrumentalEstimate:
    """Return chi = (sum Z^T S^-1 W)^-1 sum Z^T S^-1 y, S as in weighted least squares.

    Args:
        problem: W and y.
        instruments: Z of each series, (m, J, p), row by row what W would be without noise.

    Raises:
        InputError: too few rows, columns that do not tell the values apart, instruments of
            another shape or that have little to do with the columns.
    """
    shapes = [part.shape for part in instruments], [part.columns.shape for part in problem.series]
    if shapes[0] != shapes[1]:
        raise InputError(f'instruments of shapes {shapes[0]} for columns of shapes {shapes[1]}; '
                         f'give them at the same rows')
    solution, weights = weighted_solution(problem)
    relevance = _relevance(problem, weights, instruments)
    if relevance < WEAK:
        raise InputError(f'the instruments hardly move like the measured regressor (canonical '
                         f'correlation {relevance:.2f}, {WEAK:g} needed); check that the reference '
                         f'and the drive gains are those of the recording')
    free = solve(problem, weights, instruments)
    residuals = residuals_of(problem, free.values)
    scores = scores_of(instruments, _weighted(residuals, weights))
    own = scores_of([part.columns for part in problem.series],
                    _weighted(residuals_of(problem, solution.values), weights))
    influences = [least @ solution.inverse.T - other @ free.inverse.T
                  for least, other in zip(own, scores)]
    gram = product(instruments, weights, instruments)
    textbook = np.sqrt(np.diag(free.inverse @ gram @ free.inverse.T))
    least = weighted(problem)
    return InstrumentalEstimate(
        **fields_of_estimate(problem, free.values, sandwich(free.inverse, scores, problem.rows),
                             textbook),
        bias=bias_test(least.values - free.values, influences, least.std),
        least_squares=least, relevance=relevance)


def _weighted(residuals: Sequence[np.ndarray], weights: Sequence[np.ndarray]) -> list[np.ndarray]:
    return [residual * weight for residual, weight in zip(residuals, weights)]


def _relevance(problem: Problem, weights: Sequence[np.ndarray], instruments: Sequence[np.ndarray]
               ) -> float:
    """Return the smallest canonical correlation of instruments and columns; 0 if either is
    singular.
    """
    columns = [part.columns for part in problem.series]
    gram_z, gram_w = (product(part, weights, part) for part in (instruments, columns))
    size_z, size_w = (np.sqrt(np.diag(gram)) for gram in (gram_z, gram_w))
    if not (size_z.all() and size_w.all()):
        return 0.0
    try:
        root_z, root_w = (np.linalg.cholesky(gram / np.outer(size, size))
                          for gram, size in ((gram_z, size_z), (gram_w, size_w)))
    except np.linalg.LinAlgError:
        return 0.0
    cross = product(instruments, weights, columns) / np.outer(size_z, size_w)
    between = np.linalg.solve(root_w, np.linalg.solve(root_z, cross).T)
    return float(np.linalg.svd(between, compute_uv=False).min())
