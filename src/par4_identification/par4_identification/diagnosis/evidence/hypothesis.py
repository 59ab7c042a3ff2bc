"""An effect or an unnamed cause with its shape, acting on some joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape
from par4_identification.diagnosis.evidence.kind import Kind, key_of


@dataclass(frozen=True)
class Hypothesis:
    """An effect with its shape, or a kind of unnamed cause, acting on some joints.

    Attributes:
        effect: or kind.
        shape: of its columns.
        joints: where it acts; of a shared effect those whose parameters are not zero.
        sets: which of the `Effect.separable` sets of a shared effect it has; None for all.
    """

    effect: Effect | Kind
    shape: Shape
    joints: tuple[int, ...]
    sets: tuple[int, ...] | None = None

    @property
    def columns(self) -> list[int] | slice:
        """Which columns of its effect it has."""
        if self.sets is None:
            return slice(None)
        return sorted({column for number in self.sets for column in self.effect.separable[number]})

    def width(self, of_effect: int) -> int:
        """Return how many columns it has on a joint, of so many that its effect has."""
        return len(range(of_effect)[self.columns] if isinstance(self.columns, slice)
                   else self.columns)

    @property
    def named(self) -> Effect:
        """The effect, where this is one of the catalogue's.

        Raises:
            TypeError: it is a kind of unnamed cause.
        """
        if isinstance(self.effect, Kind):
            raise TypeError(f'{self.effect.name} is a kind of unnamed cause, not an effect')
        return self.effect

    def stacked(self, coefficients: np.ndarray) -> np.ndarray:
        """Return coefficients (K, J) in the order of this hypothesis's stacked columns."""
        return (coefficients[self.columns, 0] if self.effect.shared
                else coefficients[:, list(self.joints)].T.ravel())

    @property
    def label(self) -> str:
        """Name with shape, for messages."""
        shape = ', '.join(f'{name} {_shown(value)}' for name, value in self.shape.items())
        return f'{self.effect.name} ({shape})' if shape else self.effect.name

    @cached_property
    def key(self) -> tuple[object, ...]:
        """A key that no other hypothesis has."""
        return *key_of(self.effect, self.shape), self.joints, self.sets


def _shown(value: float | tuple[float, ...]) -> str:
    return (' + '.join(map(_shown, value)) if isinstance(value, tuple) else
            f'{value:.0f}' if value == int(value) else f'{value:.4g}')
