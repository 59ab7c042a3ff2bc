"""Compiled solution of the small linear systems of one sample."""

from __future__ import annotations

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
