"""Checked conversion between arrays with any leading axes and the rows the kernels work on.

A kernel over rows that the compiler shall turn into vector instructions has no calls, branches or
inner loops that stay, reads and writes rows by `four` and `put_four`, and few arrays: for each pair
of one written and another it checks at run time that they do not overlap; beyond eight it gives up.
"""

from __future__ import annotations

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core.errors import TypingError
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import ArrayLike

from par4_kinematics.errors import InputError


def as_rows(values: ArrayLike, name: str) -> tuple[np.ndarray, tuple[int, ...]]:
    """Return `values` (..., 4) as contiguous rows (n, 4) and the leading shape.

    Raises:
        InputError: another trailing length, or a value that is not finite.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != 4:
        raise InputError(f'{name}: expected an array of shape (..., 4), found {array.shape}')
    rows = np.ascontiguousarray(array.reshape(-1, 4))
    finite = np.isfinite(rows)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise InputError(f'{name}: expected finite numbers, found {rows[row, column]} in sample '
                         f'{row}, column {column}')
    return rows, array.shape[:-1]


def as_matching_rows(name_to_values: dict[str, ArrayLike]
                     ) -> tuple[list[np.ndarray], tuple[int, ...]]:
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
    leading: tuple[int, ...] = ()
    for name, array in zip(arrays, broadcast, strict=True):
        row, leading = as_rows(array, name)
        rows.append(row)
    return rows, leading


@intrinsic(prefer_literal=True)
def _entry(typing_context, rows, width, row, column):  # noqa: ARG001
    """Return rows[row, column] of rows (n, width); the compiler is told that it lies inside.

    With this, and the distance between rows known, it can compile a loop over rows to vector
    instructions; numba's own indexing leaves it to suspect that addresses wrap around.
    """
    _expect_contiguous(rows)

    def generate(context, builder, signature, arguments):
        return builder.load(_address(context, builder, signature, arguments))

    return rows.dtype(rows, width, types.intp, types.intp), generate


@intrinsic(prefer_literal=True)
def _put_entry(typing_context, rows, width, row, column, value):  # noqa: ARG001
    """Do rows[row, column] = value for rows (n, width), as `_entry` reads them."""
    _expect_contiguous(rows)

    def generate(context, builder, signature, arguments):
        builder.store(arguments[4], _address(context, builder, signature, arguments))
        return context.get_dummy_value()

    return types.void(rows, width, types.intp, types.intp, rows.dtype), generate


def _expect_contiguous(rows):
    if rows.ndim != 2 or rows.layout != 'C':
        raise TypingError(f'rows must be a contiguous array of two axes, found {rows}')


def _address(context, builder, signature, arguments):
    array = make_array(signature.args[0])(context, builder, arguments[0])
    row_type = ir.ArrayType(array.data.type.pointee, signature.args[1].literal_value)
    rows = builder.bitcast(array.data, row_type.as_pointer())
    return builder.gep(rows, arguments[2:4], inbounds=True)


def _plain_entry(rows, _width, row, column):
    """Do what `_entry` does, in Python."""
    return rows[row, column]


def _put_plain_entry(rows, _width, row, column, value):
    """Do what `_put_entry` does, in Python."""
    rows[row, column] = value


if numba.config.DISABLE_JIT:  # for a debugger, and for the test that compares
    _entry, _put_entry = _plain_entry, _put_plain_entry


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def two(rows, row):
    """Return one row of rows (n, 2)."""
    return _entry(rows, 2, row, 0), _entry(rows, 2, row, 1)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def four(rows, row):
    """Return one row of rows (n, 4)."""
    return (_entry(rows, 4, row, 0), _entry(rows, 4, row, 1), _entry(rows, 4, row, 2),
            _entry(rows, 4, row, 3))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def put_four(rows, row, values):
    """Write one row of rows (n, 4)."""
    _put_entry(rows, 4, row, 0, values[0])
    _put_entry(rows, 4, row, 1, values[1])
    _put_entry(rows, 4, row, 2, values[2])
    _put_entry(rows, 4, row, 3, values[3])
