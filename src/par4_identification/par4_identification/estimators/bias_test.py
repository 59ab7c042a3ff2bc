"""Whether least squares is biased: the test of Durbin, Wu and Hausman for coloured residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from par4_identification.estimators.covariance import long_run_covariance

TOLERANCE = 1e-10
"""Relative size below which a direction of the difference has no variance of its own."""
ROUNDING = 1e-6
"""Deviation of a difference, over that of least squares, below which both are the same."""


@dataclass(frozen=True)
class BiasTest:
    """How least squares differs from an estimate that is consistent either way.

    Attributes:
        difference: least squares minus the other, (p,).
        std: of the difference if least squares is not biased, (p,).
        statistic: Wald's, chi-square with `freedom` degrees if least squares is not biased.
        freedom: degrees of freedom.
        p_value: of the statistic.
    """

    difference: np.ndarray
    std: np.ndarray
    statistic: float
    freedom: int
    p_value: float


def bias_test(difference: np.ndarray, influences: Sequence[np.ndarray], own_std: np.ndarray
              ) -> BiasTest:
    """Return the test of a difference (p,) of two estimates.

    Hausman's variance of the difference, that of one estimate minus that of the other, holds for
    white residuals alone. The difference is a sum over the rows; its variance is the long-run
    covariance of what each row contributes.

    Args:
        difference: least squares minus the other, (p,).
        influences: contribution of each row to it, (m, p) of each series.
        own_std: of least squares, (p,); differences that are nothing beside it are rounding.
    """
    covariance = long_run_covariance([part / own_std for part in influences])
    std = np.sqrt(np.diag(covariance))
    differs = std > ROUNDING
    if not differs.any():
        return BiasTest(difference, own_std * std, 0.0, 0, 1.0)
    correlation = (covariance / np.maximum(np.outer(std, std), ROUNDING ** 2)
                   )[np.ix_(differs, differs)]
    sizes, directions = np.linalg.eigh(0.5 * (correlation + correlation.T))
    kept = sizes > TOLERANCE * sizes.max()
    along = directions.T @ (difference / own_std / np.maximum(std, ROUNDING))[differs]
    statistic = float(np.sum(along[kept] ** 2 / sizes[kept]))
    freedom = int(kept.sum())
    return BiasTest(difference, own_std * std, statistic, freedom,
                    float(scipy.special.chdtrc(freedom, statistic)))
