"""A parameter of a model: one number for all joints or one a joint, with standard deviation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from par4_kinematics.files import FileModel


def _only_numbers(value: object, depth: int = 2) -> object:
    """Refuse what is neither a number nor a list of numbers, or of lists of them."""
    if isinstance(value, list | tuple) and value and depth:
        for part in value:
            _only_numbers(part, depth - 1)
    elif isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
        raise ValueError('expected a finite number, one a joint, or such for each order, without '
                         'quotes')
    return value


PerJoint = float | Annotated[tuple[float, ...], Field(min_length=1)]
"""One number for all joints, or one a joint."""
Number = Annotated[float | Annotated[tuple[PerJoint, ...], Field(min_length=1)],
                   BeforeValidator(_only_numbers)]
"""The same, or one entry for each order of a periodic torque."""


class Parameter(FileModel):
    """Value and standard deviation in `unit`, as in `model.yaml`."""

    value: Number
    std: Number | None = None
    unit: str = ''

    @model_validator(mode='after')
    def _std_matches(self) -> Parameter:
        if self.std is not None:
            if not _fits(self.std, self.value):
                raise ValueError('std must have as many numbers as value')
            if min(_flat(self.std)) < 0:
                raise ValueError(f'std must not be negative, found {self.std}')
        return self

    @property
    def number(self) -> float:
        """The value of a parameter that has one for the whole machine.

        Raises:
            TypeError: it has several.
        """
        return _one(self.value)

    @property
    def deviation(self) -> float:
        """The standard deviation of a parameter that has one for the whole machine.

        Raises:
            TypeError: it has several, or none.
        """
        return _one(self.std)

    def per_joint(self, joints: int) -> np.ndarray:
        """Return the value for each of `joints` joints, (joints,)."""
        return np.broadcast_to(np.asarray(self.value, dtype=float), (joints,))


def parts_of_orders(number: Number | None) -> tuple[PerJoint, ...]:
    """Return what is told of each order of a periodic torque.

    Raises:
        TypeError: one number for all of them, or none.
    """
    if not isinstance(number, tuple):
        raise TypeError(f'a value an order expected, found {number}')
    return number


def _one(number: Number | None) -> float:
    if number is None or isinstance(number, tuple):
        raise TypeError(f'one number expected, found {number}')
    return number


def _fits(std: Number, value: Number) -> bool:
    """Return whether a standard deviation is one number or has the parts that the value has."""
    if not isinstance(std, tuple):
        return True
    return (isinstance(value, tuple) and len(std) == len(value)
            and all(map(_fits, std, value)))


def _flat(number: Number) -> Iterator[float]:
    """Yield the numbers of a number, of a tuple or of tuples."""
    if isinstance(number, tuple):
        for part in number:
            yield from _flat(part)
    else:
        yield number
