"""Checked conversion between arrays with any leading axes and the rows the kernels work on."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.errors import InputError


def as_rows(values: ArrayLike, name: str, width: int = 4) -> tuple[np.ndarray, tuple[int, ...]]:
    """Return `values` (..., width) as contiguous rows (n, width) and the leading shape.

    Raises:
        InputError: another trailing length, or a value that is not finite.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != width:
        raise InputError(f'{name}: expected an array of shape (..., {width}), found {array.shape}')
    rows = np.ascontiguousarray(array.reshape(-1, width))
    finite = np.isfinite(rows)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise InputError(f'{name}: expected finite numbers, found {rows[row, column]} in sample '
                         f'{row}, column {column}')
    return rows, array.shape[:-1]


def as_matching_rows(name_to_values: dict[str, ArrayLike]) -> tuple[list[np.ndarray], tuple]:
    """Return several arrays (..., 4), broadcast to one leading shape, as rows, and that shape.

    Raises:
        InputError: shapes that do not broadcast, or what `as_rows` raises.
    """
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in name_to_values.items()}
    try:
        broadcast = np.broadcast_arrays(*arrays.values())
    except ValueError:
        shapes = ', '.join(f'{name} {array.shape}' for name, array in arrays.items())
        raise InputError(f'expected arrays of matching shape, found {shapes}') from None
    rows = []
    leading: tuple = ()
    for name, array in zip(arrays, broadcast, strict=True):
        row, leading = as_rows(array, name)
        rows.append(row)
    return rows, leading
