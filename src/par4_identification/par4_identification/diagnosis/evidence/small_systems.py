"""Linear systems of a model's columns: put together from products, solved, rounding left out."""

from __future__ import annotations

import numba
import numpy as np
from scipy.linalg import lapack

ROUNDING = 1e-11
"""Eigenvalues of scaled normal equations below which a direction is not told by the data."""
DISTINCT = 1e-7
"""Least square of a pivot of the scaled normal equations that needs no look at their directions."""
LEFT_ROUNDING = 1e-7
"""As `ROUNDING`, for what a projection has left of columns, scaled by their sizes before it."""
LEFT_DISTINCT = 1e-3
"""As `DISTINCT`, for the same."""


@numba.njit(cache=True, error_model='numpy', nogil=True)
def assembled(grams, moments, own, positions, ends, size):
    """Return products of a model's columns (c, c) and with the target (c,), see `pool._Layout`.

    Args:
        grams, moments: products of the columns of a pool, (J, w, w), and with the target, (J, w).
    """
    gram, moment = np.zeros((size, size)), np.zeros(size)
    for joint in range(len(grams)):
        for row in range(ends[joint], ends[joint + 1]):
            moment[positions[row]] += moments[joint, own[row]]
            for column in range(ends[joint], ends[joint + 1]):
                gram[positions[row], positions[column]] += grams[joint, own[row], own[column]]
    return gram, moment


def solved(gram: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return the solution (c,) of scaled normal equations, rounding left out."""
    lower = _triangle(gram)
    if lower is not None:
        return np.asarray(lapack.dpotrs(lower, moment, lower=True)[0])
    values, vectors = directions(gram)
    return vectors @ ((vectors.T @ moment) / values)


def orthonormal(gram: np.ndarray) -> np.ndarray:
    """Return combinations W (c, r) of columns with W^T gram W = 1, rounding left out.

    Of the scaled normal equations only the lower triangle is looked at.
    """
    lower = _triangle(gram)
    if lower is not None:
        return np.asarray(lapack.dtrtri(lower, lower=True)[0].T)
    values, vectors = directions(gram)
    return vectors / np.sqrt(values)


def _triangle(gram: np.ndarray) -> np.ndarray | None:
    """Return the lower triangular root of scaled normal equations; None where it may be rounding.
    """
    lower, failed = lapack.dpotrf(gram, lower=True, clean=True)
    return lower if not failed and lower.diagonal().min() ** 2 > DISTINCT else None


def directions(gram: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues (k,) and vectors (c, k) of scaled normal equations, rounding left out."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > ROUNDING * values[-1]
    return values[kept], vectors[:, kept]


def quadratic(gram: np.ndarray, moment: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return moment^T gram^-1 moment. Directions of gram that are only rounding are left out.

    Args:
        gram: (..., k, k).
        moment: (..., k).
        size: diagonal of gram before a projection made it smaller, (..., k).
    """
    scale = np.sqrt(np.maximum(size, 1e-30))
    gram, moment = gram / (scale[..., :, None] * scale[..., None, :]), moment / scale
    found = np.atleast_1d(_by_cholesky(gram.reshape(-1, *gram.shape[-2:]),
                                       moment.reshape(-1, moment.shape[-1])))
    found = found.reshape(moment.shape[:-1])
    doubtful = np.isnan(found)
    if doubtful.any():
        values, vectors = np.linalg.eigh(gram[doubtful])
        along = np.einsum('...kl,...k->...l', vectors, moment[doubtful])
        kept = values > LEFT_ROUNDING
        found[doubtful] = np.sum(
            np.where(kept, along ** 2, 0.0) / np.where(kept, values, 1.0), axis=-1)
    return found


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _by_cholesky(grams, moments):
    """Return moment^T gram^-1 moment (s,) of grams (s, k, k) whose diagonals are 1 at the most.

    NaN where a pivot is so small that the directions of the gram have to be looked at.
    """
    count, width = moments.shape
    found = np.zeros(count)
    lower, forward = np.empty((width, width)), np.empty(width)
    for number in range(count):
        for row in range(width):
            for column in range(row + 1):
                left = grams[number, row, column]
                for k in range(column):
                    left -= lower[row, k] * lower[column, k]
                if row > column:
                    lower[row, column] = left / lower[column, column]
                else:
                    lower[row, row] = np.sqrt(left) if left > LEFT_DISTINCT else np.nan
            left = moments[number, row]
            for k in range(row):
                left -= lower[row, k] * forward[k]
            forward[row] = left / lower[row, row]
            found[number] += forward[row] ** 2
    return found
