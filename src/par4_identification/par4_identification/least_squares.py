"""Weighted least squares with standard deviations that hold for coloured residuals.

Knows nothing of robots: series of rows (m, J) of J outputs, columns (m, J, p), masks (m, J).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_identification.noise import ArNoise, fit_noise
from par4_kinematics.errors import InputError

LAGS = 10
"""Rows over which prewhitened scores are taken to be correlated in the standard deviations."""


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
class Estimate:
    """Result of a fit.

    Attributes:
        values: chi, (p,).
        covariance: of chi under coloured noise, (p, p).
        textbook_std: what white noise of the same size would give, (p,).
        noise: model of the residual of each output.
        residuals: y - W chi of each series, (m, J).
        rms: root mean square of the valid residuals of each output, (J,).
        relative_error: |residual| / |y| over all valid rows.
        condition_number: of the stacked W of valid rows.
        rows: number of valid rows.
    """

    values: np.ndarray
    covariance: np.ndarray
    textbook_std: np.ndarray
    noise: tuple[ArNoise, ...]
    residuals: tuple[np.ndarray, ...]
    rms: np.ndarray
    relative_error: float
    condition_number: float
    rows: int

    @property
    def std(self) -> np.ndarray:
        """Standard deviations (p,)."""
        return np.sqrt(np.diag(self.covariance))


def fit(series: list[Series]) -> Estimate:
    """Return the least squares fit of y = W chi, outputs weighted by their residual's size.

    chi = (sum W^T S^-1 W)^-1 sum W^T S^-1 y with S diagonal over the outputs. The covariance is
    the sandwich with the long-run covariance of the scores W_t^T S^-1 r_t (Newey and West 1987,
    prewhitened after Andrews and Monahan 1992): residuals may be coloured, larger in fast motion,
    and correlated between outputs, as encoder noise is through the mass matrix.

    Raises:
        InputError: fewer valid rows than parameters, or columns that do not tell the parameters
            apart.
    """
    outputs, parameters = series[0].columns.shape[1:]
    rows = int(sum(part.valid.sum() for part in series))
    if rows < 5 * parameters:
        raise InputError(f'{rows} usable rows for {parameters} parameters; record a longer motion '
                         f'in which all joints move')
    sigma = np.ones(outputs)
    for _ in range(3):
        gram, moment = np.zeros((parameters, parameters)), np.zeros(parameters)
        for part in series:
            weighted = part.columns * (part.valid / sigma ** 2)[..., None]
            gram += np.einsum('mjp,mjr->pr', weighted, part.columns)
            moment += np.einsum('mjp,mj->p', weighted, part.target)
        scale = np.sqrt(np.diag(gram))
        if np.any(scale == 0.0):
            raise InputError(f'parameter {int(np.argmin(scale))} does not show in the data; record '
                             f'a motion that excites it')
        scaled = gram / np.outer(scale, scale)
        if np.linalg.cond(scaled) > 1e12:
            raise InputError('the motion does not tell the parameters apart (singular regressor); '
                             'record a richer motion')
        values = np.linalg.solve(scaled, moment / scale) / scale
        residuals = tuple(part.target - part.columns @ values for part in series)
        count = np.maximum(sum(part.valid.sum(axis=0) for part in series), 1)
        square = sum((residual ** 2 * part.valid).sum(axis=0)
                     for residual, part in zip(residuals, series))
        sigma = np.sqrt(np.maximum(square / count, 1e-24))

    noise = tuple(
        fit_noise([residual[:, joint] for residual in residuals],
                  [part.valid[:, joint] for part in series], parameters / outputs)
        for joint in range(outputs))
    scores = [np.einsum('mjp,mj->mp', part.columns * (part.valid / sigma ** 2)[..., None], residual)
              / scale for part, residual in zip(series, residuals)]
    middle = long_run_covariance(scores) * np.outer(scale, scale)
    middle *= rows / (rows - parameters)
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    covariance = inverse @ middle @ inverse
    stacked = np.concatenate([part.columns[part.valid] for part in series])
    target = np.concatenate([part.target[part.valid] for part in series])
    return Estimate(
        values=values, covariance=0.5 * (covariance + covariance.T),
        textbook_std=np.sqrt(np.diag(inverse)), noise=noise, residuals=residuals,
        rms=np.sqrt(square / count),
        relative_error=float(np.sqrt(square.sum()) / np.linalg.norm(target)),
        condition_number=float(np.linalg.cond(stacked)), rows=rows)


def long_run_covariance(scores: list[np.ndarray]) -> np.ndarray:
    """Return the covariance (p, p) of the sum over all rows of score series (m_i, p).

    Each series is prewhitened by a first order vector autoregression, its innovations' covariance
    is summed over `LAGS` with Bartlett weights, and recoloured. Series are never joined.
    """
    parameters = scores[0].shape[1]
    past = sum(score[:-1].T @ score[:-1] for score in scores)
    step = sum(score[1:].T @ score[:-1] for score in scores)
    transition = step @ np.linalg.pinv(past)
    left, values, right = np.linalg.svd(transition)
    transition = left @ np.diag(np.minimum(values, 0.97)) @ right  # recolouring must stay finite
    total = np.zeros((parameters, parameters))
    for score in scores:
        innovation = score.copy()
        innovation[1:] -= score[:-1] @ transition.T
        total += innovation.T @ innovation
        for lag in range(1, min(LAGS, len(innovation))):
            shifted = innovation[lag:].T @ innovation[:-lag]
            total += (1.0 - lag / LAGS) * (shifted + shifted.T)
    recolour = np.linalg.inv(np.eye(parameters) - transition)
    return recolour @ total @ recolour.T
