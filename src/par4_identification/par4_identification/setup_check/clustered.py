"""Covariance of fitted values by clusters of rows (Liang and Zeger 1986).

What a model misses lasts: rows that follow each other share it, and least squares that take them
for independent are too sure.
"""

from __future__ import annotations

import numpy as np

CLUSTER = 0.5
"""Length of a cluster, s."""


def clusters_of(t: np.ndarray, log: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return the number of the cluster of each valid row, joint by joint, (n,).

    Args:
        t: of the rows, s, (m,).
        log: number of the log of each row, (m,).
        valid: rows of a joint that count, (m, J).
    """
    of_row = np.floor(t / CLUSTER) + 1e6 * log
    return np.unique(np.concatenate([of_row[kept] for kept in valid.T]), return_inverse=True)[1]


def clustered_covariance(slopes: np.ndarray, residual: np.ndarray, cluster: np.ndarray
                         ) -> np.ndarray:
    """Return the covariance (k, k) of values with these slopes (n, k) and residuals (n,)."""
    inverse = np.linalg.pinv(slopes.T @ slopes, rcond=1e-10, hermitian=True)
    scores = np.zeros((int(cluster.max()) + 1, slopes.shape[1]))
    np.add.at(scores, cluster, slopes * residual[:, None])
    return np.asarray(inverse @ (scores.T @ scores) @ inverse)
