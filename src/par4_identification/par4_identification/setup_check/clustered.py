"""Standard deviations of fitted values by clusters of rows.

What a model misses lasts: rows that follow each other share it, and least squares that take them
for independent are too sure (Liang and Zeger 1986). Of few clusters the fit follows each so far
that what it leaves is too small; the jackknife over clusters is not deceived by that (Bell and
McCaffrey 2002).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

CLUSTER = 0.5
"""Length of a cluster, s."""
FAR = 4.0
"""Standard deviations at which few clusters are made up for: Student's distribution, of as many
degrees of freedom as clusters of equal weight would have."""
FEW = 4.0
"""Clusters of equal weight below which the heaviest one counts as a disagreement with the others.
"""
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
    unlikely as of a normal variable; infinite where all hangs on one cluster. Where one cluster
    outweighs the others, and these tell the value by themselves, its deviation is theirs and by how
    much the heavy one changes it.

    Args:
        slopes: of the values that were fitted.
        residual: what the fit leaves, (n,).
        cluster: number of the cluster of each row, (n,).
        beside: orthonormal basis (n, p) of all that was fitted beside.
    """
    whole = _jackknife(slopes, residual, cluster, beside)
    if whole is None:
        return np.full(slopes.shape[1], np.inf)
    std = whole.std
    for value in np.flatnonzero(whole.clusters < FEW):
        kept = cluster != whole.heaviest[value]
        rest = _jackknife(slopes[kept], (residual - whole.moved[value])[kept], cluster[kept],
                          basis_of(beside[kept]))
        if rest is not None:
            std[value] = min(std[value], np.hypot(rest.std[value], whole.change[value]))
    return std


@dataclass(frozen=True)
class _Jackknife:
    """What leaving out a cluster at a time tells of k values.

    Attributes:
        std: standard deviations, (k,).
        clusters: how many of equal weight would tell as much, (k,).
        heaviest: number of the cluster that outweighs the others most, (k,).
        change: of each value without that cluster, (k,).
        moved: change of the fitted rows without that cluster, (k, n).
    """

    std: np.ndarray
    clusters: np.ndarray
    heaviest: np.ndarray
    change: np.ndarray
    moved: np.ndarray


def _jackknife(slopes: np.ndarray, residual: np.ndarray, cluster: np.ndarray, beside: np.ndarray
               ) -> _Jackknife | None:
    """Return what leaving out a cluster at a time tells; None where all hangs on one cluster."""
    own, triangle = np.linalg.qr(slopes - beside @ (beside.T @ slopes))
    fitted = np.column_stack((beside, own))
    order = np.argsort(cluster, kind='stable')
    ends = np.flatnonzero(np.diff(cluster[order])) + 1
    parts, residuals = np.split(fitted[order], ends), np.split(residual[order], ends)
    unit = np.eye(fitted.shape[1])
    rest = unit - np.stack([part.T @ part for part in parts])
    try:
        np.linalg.cholesky(rest - ALONE * unit)
    except np.linalg.LinAlgError:
        return None
    moments = np.stack([part.T @ left for part, left in zip(parts, residuals)])
    changes = np.linalg.solve(rest, moments[..., None])[..., 0]
    inverse = np.linalg.pinv(triangle, rcond=1e-10)
    of_values = changes[:, -slopes.shape[1]:] @ inverse.T
    std = np.sqrt(np.sum(of_values ** 2, axis=0))
    weight = np.add.reduceat((own @ inverse.T)[order] ** 2, np.r_[0, ends], axis=0)
    alike = weight.sum(axis=0) ** 2 / np.maximum((weight ** 2).sum(axis=0), 1e-300)
    freedom = np.maximum(alike - 1.0, 1.0)
    heaviest = np.argmax(weight, axis=0)
    return _Jackknife(
        np.asarray(std * scipy.special.stdtrit(freedom, scipy.special.ndtr(FAR)) / FAR), alike,
        cluster[order][np.r_[0, ends]][heaviest],
        np.abs(of_values[heaviest, np.arange(len(std))]),
        -changes[heaviest] @ fitted.T)
