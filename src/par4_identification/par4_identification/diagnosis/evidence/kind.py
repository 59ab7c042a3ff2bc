"""A kind of unnamed cause: columns with free coefficients, most often functions of the motion."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.kind_functions import Function, Periods, Ranges

Key = tuple[Any, ...]
"""Names columns: an effect or a kind and its shape, or several shapes, or the base terms."""

PRIOR_ROWS = 3.0
"""Weight of the prior, zero, of a coefficient whose column has the size 1: as that many rows."""


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of unnamed cause: a sum of columns with free coefficients.

    It stands where an effect stands in a hypothesis, with an empty shape.

    Attributes:
        name: of the kind, as `diagnosis.json` and tests know it.
        phrase: what it acts like, in words.
        shared: whether a column has one coefficient on all joints.
        needs_platform: whether only machines with a platform can have it.
        needs_nominal: whether its columns need the nominal torque.
        told_by_speeds: whether it is a function of the joint's speed alone, so that mean torques at
            steady speeds can tell it.
        left_by_filters: whether sampling and filters leave some of it in every record, so that it
            counts only where it explains most of what is left.
    """

    name: str
    phrase: str
    _: KW_ONLY
    shared: bool = False
    separable: ClassVar[Periods] = ()
    variables: ClassVar[int] = 1
    needs_platform: bool = False
    needs_nominal: bool = False
    left_by_filters: bool = False
    told_by_speeds: bool = False

    def parts(self, shape: Shape) -> tuple[Shape, ...]:
        """Return the shape as the only part: a kind has no others."""
        return (shape,)

    def prior(self, squares: np.ndarray, rows: float) -> np.ndarray:
        """Return the weight of the prior, zero, of each coefficient: squares of a row of its own.

        It is that of `PRIOR_ROWS` rows in which a column has its usual size, or that of the
        columns on the average where it is larger: a column that the motion hardly visits must not
        be free to be anything where other motions go.

        Args:
            squares: of the whitened columns, (k,), (g, k) where g joints have their own.
            rows: on which they are.
        """
        return PRIOR_ROWS / max(rows, 1.0) * np.maximum(squares, squares.mean())

    def columns(self, state: State, shape: Shape) -> np.ndarray:  # noqa: ARG002
        """Return its columns (n, J, k), N m per unit coefficient.

        Raises:
            TypeError: they are no function of a motion.
        """
        raise TypeError(f'the columns of the kind {self.name} are no function of a motion')


@dataclass(frozen=True, eq=False)
class FunctionKind(Kind):
    """A kind whose columns are functions of the motion.

    Attributes:
        function: its columns (n, J, k) of a motion, N m per unit coefficient.
        ranges: scales that make it the same function on other data.
    """

    function: Function
    ranges: Ranges | None = None

    def columns(self, state: State, shape: Shape) -> np.ndarray:  # noqa: ARG002
        """Return its columns (n, J, k), N m per unit coefficient.

        Raises:
            TypeError: it has not been scaled to a motion.
        """
        if self.ranges is None:
            raise TypeError(f'the kind {self.name} has not been scaled to a motion')
        return np.ascontiguousarray(self.function(state, self.ranges))


def shape_key(shape: Shape) -> Key:
    """Return a key that no other shape has."""
    return tuple(shape.items()) if len(shape) < 2 else tuple(sorted(shape.items()))


def key_of(effect: Effect | Kind, shape: Shape) -> Key:
    """Return the key of the columns of an effect or a kind at one shape."""
    return effect, shape_key(shape)
