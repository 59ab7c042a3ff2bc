"""Covariances that hold for residuals correlated in time and between outputs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

LAGS = 10
"""Rows over which prewhitened scores are taken to be correlated."""


def scores_of(columns: Sequence[np.ndarray], weighted_residuals: Sequence[np.ndarray]
              ) -> list[np.ndarray]:
    """Return Z_t^T w r of each row, (m, p), for Z (m, J, p) and w r (m, J)."""
    return [np.einsum('mjp,mj->mp', part, residual)
            for part, residual in zip(columns, weighted_residuals, strict=True)]


def sandwich(inverse: np.ndarray, scores: Sequence[np.ndarray], rows: int) -> np.ndarray:
    """Return A^-1 B A^-T with the long-run covariance B of scores (m, p), (p, p).

    Residuals may be coloured, larger in fast motion and correlated between outputs, as encoder
    noise is through the mass matrix (Newey and West 1987, prewhitened after Andrews and Monahan
    1992).

    Args:
        inverse: A^-1, (p, p).
        scores: of each series.
        rows: valid rows, for the degrees of freedom.
    """
    size = len(inverse)
    scale = np.sqrt(sum((score ** 2).sum(axis=0) for score in scores))
    scale = np.where(scale > 0.0, scale, 1.0)
    middle = long_run_covariance([score / scale for score in scores]) * np.outer(scale, scale)
    middle *= rows / (rows - size)
    covariance = inverse @ middle @ inverse.T
    return 0.5 * (covariance + covariance.T)


def long_run_covariance(scores: Sequence[np.ndarray]) -> np.ndarray:
    """Return the covariance (p, p) of the sum over all rows of score series (m_i, p).

    Each series is prewhitened by a first order vector autoregression, its innovations' covariance
    is summed over `LAGS` with Bartlett weights, and recoloured. Series are never joined.
    """
    parameters = scores[0].shape[1]
    past = sum(_moment(score[:-1], score[:-1]) for score in scores)
    step = sum(_moment(score[1:], score[:-1]) for score in scores)
    transition = step @ np.linalg.pinv(past)
    left, values, right = np.linalg.svd(transition)
    transition = left @ np.diag(np.minimum(values, 0.97)) @ right  # recolouring must stay finite
    total = np.zeros((parameters, parameters))
    for score in scores:
        innovation = score.copy()
        innovation[1:] -= score[:-1] @ transition.T
        total += _moment(innovation, innovation)
        for lag in range(1, min(LAGS, len(innovation))):
            shifted = _moment(innovation[lag:], innovation[:-lag])
            total += (1.0 - lag / LAGS) * (shifted + shifted.T)
    recolour = np.linalg.inv(np.eye(parameters) - transition)
    return recolour @ total @ recolour.T


def _moment(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Return A^T B (p, r) without the threads of a matrix product; see `product`."""
    return np.einsum('mp,mr->pr', left, right)
