"""Compiled solution of the small linear systems of one sample."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit(cache=True, error_model='numpy')
def solve_in_place(matrix: np.ndarray, columns: np.ndarray) -> float:
    """Solve matrix @ solution = columns by Gaussian elimination; columns become the solution.

    Args:
        matrix: (n, n), destroyed.
        columns: (n, k), overwritten.

    Returns:
        The smallest pivot over the largest, 0 for a singular matrix.
    """
    n = matrix.shape[0]
    k = columns.shape[1]
    largest = 0.0
    smallest = np.inf
    for pivot_row in range(n):
        best = pivot_row
        for row in range(pivot_row + 1, n):
            if abs(matrix[row, pivot_row]) > abs(matrix[best, pivot_row]):
                best = row
        pivot = matrix[best, pivot_row]
        largest = max(largest, abs(pivot))
        smallest = min(smallest, abs(pivot))
        if pivot == 0.0:
            return 0.0
        if best != pivot_row:
            for column in range(n):
                matrix[pivot_row, column], matrix[best, column] = (
                    matrix[best, column], matrix[pivot_row, column])
            for column in range(k):
                columns[pivot_row, column], columns[best, column] = (
                    columns[best, column], columns[pivot_row, column])
        for row in range(pivot_row + 1, n):
            factor = matrix[row, pivot_row] / pivot
            if factor != 0.0:
                for column in range(pivot_row + 1, n):
                    matrix[row, column] -= factor * matrix[pivot_row, column]
                for column in range(k):
                    columns[row, column] -= factor * columns[pivot_row, column]
    for row in range(n - 1, -1, -1):
        for column in range(k):
            total = columns[row, column]
            for other in range(row + 1, n):
                total -= matrix[row, other] * columns[other, column]
            columns[row, column] = total / matrix[row, row]
    return smallest / largest


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def cross(a, b):
    """Return a x b, tuples whose first three entries count."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def dot(a, b):
    """Return a . b, tuples whose first three entries count."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def inverse_columns(a_0, a_1, a_2, a_3, c_0, c_1):
    """Return the four columns of the inverse of J_x at D, rows (a_0, c_0), (a_1, c_1), (a_2, 0),
    (a_3, 0); not finite where it is singular.

    A motion across a_2 and a_3 is one along n = a_2 x a_3, which leaves two equations for it and
    theta. Without pivots: n is small, and det J_x with it, only where J_x is near singular.
    """
    n = cross(a_2, a_3)
    d_0, d_1 = dot(a_0, n), dot(a_1, n)
    reciprocal = 1.0 / (d_0 * c_1 - d_1 * c_0)
    s_0, r_0 = c_1 * reciprocal, -d_1 * reciprocal
    s_1, r_1 = -c_0 * reciprocal, d_0 * reciprocal
    # p_2 moves along a_2 alone by one, p_3 along a_3; what legs 0 and 1 see of that is undone
    square = 1.0 / dot(n, n)
    p_2, p_3 = cross(a_3, n), cross(n, a_2)
    e_20, e_21 = dot(a_0, p_2) * square, dot(a_1, p_2) * square
    e_30, e_31 = dot(a_0, p_3) * square, dot(a_1, p_3) * square
    s_2, r_2 = -e_20 * s_0 - e_21 * s_1, -e_20 * r_0 - e_21 * r_1
    s_3, r_3 = -e_30 * s_0 - e_31 * s_1, -e_30 * r_0 - e_31 * r_1
    return ((s_0 * n[0], s_0 * n[1], s_0 * n[2], r_0),
            (s_1 * n[0], s_1 * n[1], s_1 * n[2], r_1),
            (square * p_2[0] + s_2 * n[0], square * p_2[1] + s_2 * n[1],
             square * p_2[2] + s_2 * n[2], r_2),
            (square * p_3[0] + s_3 * n[0], square * p_3[1] + s_3 * n[1],
             square * p_3[2] + s_3 * n[2], r_3))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def combined(columns, f_0, f_1, f_2, f_3):
    """Return the four columns (tuples of four) times (f_0, f_1, f_2, f_3)."""
    k_0, k_1, k_2, k_3 = columns
    return (k_0[0] * f_0 + k_1[0] * f_1 + k_2[0] * f_2 + k_3[0] * f_3,
            k_0[1] * f_0 + k_1[1] * f_1 + k_2[1] * f_2 + k_3[1] * f_3,
            k_0[2] * f_0 + k_1[2] * f_1 + k_2[2] * f_2 + k_3[2] * f_3,
            k_0[3] * f_0 + k_1[3] * f_1 + k_2[3] * f_2 + k_3[3] * f_3)


@numba.njit(cache=True, error_model='numpy')
def factor_in_place(matrix: np.ndarray) -> None:
    """Replace a symmetric positive definite matrix by its Cholesky factor, lower half.

    The matrix is the first four rows; on the diagonal are the reciprocals of the factor's.
    Written out, because it is in every step.
    """
    r_0 = 1.0 / math.sqrt(matrix[0, 0])
    l_10, l_20, l_30 = matrix[1, 0] * r_0, matrix[2, 0] * r_0, matrix[3, 0] * r_0
    r_1 = 1.0 / math.sqrt(matrix[1, 1] - l_10 * l_10)
    l_21 = (matrix[2, 1] - l_20 * l_10) * r_1
    l_31 = (matrix[3, 1] - l_30 * l_10) * r_1
    r_2 = 1.0 / math.sqrt(matrix[2, 2] - l_20 * l_20 - l_21 * l_21)
    l_32 = (matrix[3, 2] - l_30 * l_20 - l_31 * l_21) * r_2
    r_3 = 1.0 / math.sqrt(matrix[3, 3] - l_30 * l_30 - l_31 * l_31 - l_32 * l_32)
    matrix[0, 0], matrix[1, 1], matrix[2, 2], matrix[3, 3] = r_0, r_1, r_2, r_3
    matrix[1, 0], matrix[2, 0], matrix[3, 0] = l_10, l_20, l_30
    matrix[2, 1], matrix[3, 1], matrix[3, 2] = l_21, l_31, l_32


@numba.njit(cache=True, error_model='numpy')
def solve_factored(factor: np.ndarray, column: np.ndarray) -> None:
    """Overwrite column (4,) with the solution; factor of `factor_in_place`."""
    y_0 = column[0] * factor[0, 0]
    y_1 = (column[1] - factor[1, 0] * y_0) * factor[1, 1]
    y_2 = (column[2] - factor[2, 0] * y_0 - factor[2, 1] * y_1) * factor[2, 2]
    y_3 = (column[3] - factor[3, 0] * y_0 - factor[3, 1] * y_1 - factor[3, 2] * y_2) * factor[3, 3]
    z_3 = y_3 * factor[3, 3]
    z_2 = (y_2 - factor[3, 2] * z_3) * factor[2, 2]
    z_1 = (y_1 - factor[2, 1] * z_2 - factor[3, 1] * z_3) * factor[1, 1]
    z_0 = (y_0 - factor[1, 0] * z_1 - factor[2, 0] * z_2 - factor[3, 0] * z_3) * factor[0, 0]
    column[0], column[1], column[2], column[3] = z_0, z_1, z_2, z_3
