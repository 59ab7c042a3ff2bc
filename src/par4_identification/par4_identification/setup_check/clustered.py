"""Standard deviations of fitted values by clusters of rows.

What a model misses lasts: rows that follow each other share it, and least squares that take them
for independent are too sure (Liang and Zeger 1986). Of few clusters the fit follows each so far
that what it leaves is too small; the jackknife over clusters is not deceived by that (Bell and
McCaffrey 2002).
"""

from __future__ import annotations

import numpy as np
import scipy

CLUSTER = 0.5
"""Length of a cluster, s."""
FAR = 4.0
"""Standard deviations at which few clusters are made up for: Student's distribution, of as many
degrees of freedom as clusters of equal weight would have."""
ALONE = 1e-6
"""Share of what tells a value that must come from other clusters than one."""


def clusters_of(t: np.ndarray, log: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Return the number of the cluster of each valid row, joint by joint, (n,).

    Args:
        t: of the rows, s, (m,).
        log: number of the log of each row, (m,).
        valid: rows of a joint that count, (m, J).
    """
    of_row = np.floor(t / CLUSTER) + 1e6 * log
    return np.unique(np.concatenate([of_row[kept] for kept in valid.T]), return_inverse=True)[1]


def basis_of(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis (n, r) of what columns (n, k) span."""
    sizes = np.linalg.norm(columns, axis=0)
    if not (sizes > 1e-12).any():
        return columns[:, :0]
    columns = columns[:, sizes > 1e-12] / sizes[sizes > 1e-12]
    values, vectors = np.linalg.eigh(columns.T @ columns)
    kept = values > 1e-9 * values[-1]
    return np.asarray(columns @ (vectors[:, kept] / np.sqrt(values[kept])))


def clustered_std(slopes: np.ndarray, residual: np.ndarray, cluster: np.ndarray,
                  beside: np.ndarray) -> np.ndarray:
    """Return the standard deviations (k,) of values with these slopes (n, k).

    They are those of the jackknife that leaves out a cluster at a time: what a cluster says by
    itself, its residual hides, the more so the fewer clusters there are. `FAR` of them are as
    unlikely as of a normal variable; infinite where all hangs on one cluster.

    Args:
        slopes: of the values that were fitted.
        residual: what the fit leaves, (n,).
        cluster: number of the cluster of each row, (n,).
        beside: orthonormal basis (n, p) of all that was fitted beside.
    """
    own, triangle = np.linalg.qr(slopes - beside @ (beside.T @ slopes))
    fitted = np.column_stack((beside, own))
    order = np.argsort(cluster, kind='stable')
    ends = np.flatnonzero(np.diff(cluster[order])) + 1
    scatter = np.zeros((slopes.shape[1],) * 2)
    for rows in np.split(order, ends):
        part = fitted[rows]
        rest = np.eye(part.shape[1]) - part.T @ part
        try:
            np.linalg.cholesky(rest - ALONE * np.eye(len(rest)))
        except np.linalg.LinAlgError:
            return np.full(slopes.shape[1], np.inf)
        change = np.linalg.solve(rest, part.T @ residual[rows])[-slopes.shape[1]:]
        scatter += np.outer(change, change)
    inverse = np.linalg.pinv(triangle, rcond=1e-10)
    std = np.sqrt(np.diag(inverse @ scatter @ inverse.T))
    weight = np.add.reduceat((own @ inverse.T)[order] ** 2, np.r_[0, ends], axis=0)
    alike = weight.sum(axis=0) ** 2 / np.maximum((weight ** 2).sum(axis=0), 1e-300)
    freedom = np.maximum(alike - 1.0, 1.0)
    return np.asarray(std * scipy.special.stdtrit(freedom, scipy.special.ndtr(FAR)) / FAR)
