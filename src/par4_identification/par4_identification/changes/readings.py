"""Readings of a change: what a mechanic would say has happened, and what it does to parameters."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from par4_dynamics.base_terms import (
    FRICTION,
    HANGING_TERMS,
    INERTIA,
    PLATFORM_MASSES,
    BaseTerm,
)
from par4_dynamics.state import GRAVITY

TURNING, SLIDING = (tuple(term.name for term in HANGING_TERMS[hanging])
                    for hanging in ('turning', 'sliding'))
"""What a load that hangs on an axis does to it."""
SCALE = 'torque_scale'
"""Name of the factor between recorded torque and that of the model."""


@dataclass(frozen=True)
class Parameters:
    """The base parameters that readings change.

    Attributes:
        terms: names of the p parameters.
        values: (..., J, p).
        known: what parameters would follow of the torque that is known beside them, (J, p).
        gains: recorded torque of each joint over its true one, as far as known, (J,), or of all.
    """

    terms: tuple[str, ...]
    values: np.ndarray
    known: np.ndarray
    gains: np.ndarray | float = 1.0

    def with_values(self, values: np.ndarray) -> Parameters:
        """Return the parameters with other values."""
        return replace(self, values=values)

    def recorded(self, added: np.ndarray) -> np.ndarray:
        """Return what joints with such gains record of so much more (...) of a parameter, (..., J).
        """
        return added[..., None] * np.broadcast_to(self.gains, self.values.shape[-2])


@dataclass(frozen=True)
class Moved:
    """One parameter as a reading moves it.

    Attributes:
        parameter: its name; with a joint in brackets where it is that of one joint.
        before: value, of one joint or the mean of all.
        slope: change per unit size of the reading.
        unit: of the value.
    """

    parameter: str
    before: float
    slope: float
    unit: str


@dataclass(frozen=True)
class Reading(ABC):
    """A change of one size.

    Attributes:
        joint: the one that it concerns, None for all.
        least: size that it exceeds on any machine.
    """

    least: ClassVar[float] = -math.inf
    joint: int | None

    @abstractmethod
    def apply(self, now: Parameters, size: np.ndarray) -> np.ndarray:
        """Return the values (..., J, p) of machines after changes of these sizes (...).

        They are linear in the size.
        """

    @abstractmethod
    def moved(self, now: Parameters, terms: Sequence[BaseTerm]) -> tuple[Moved, ...]:
        """Return the parameters that it moves."""

    @property
    def _rows(self) -> slice:
        return slice(None) if self.joint is None else slice(self.joint, self.joint + 1)

    def _label(self, name: str) -> str:
        return name if self.joint is None else f'{name}[{self.joint}]'


@dataclass(frozen=True)
class Added(Reading):
    """Added of one parameter: a payload on a half plate, an inertia, Coulomb friction of a joint.

    Attributes:
        parameter: which; the size has its unit.
    """

    parameter: str

    def apply(self, now: Parameters, size: np.ndarray) -> np.ndarray:
        values = now.values.copy()
        values[..., self._rows, now.terms.index(self.parameter)] += now.recorded(
            size)[..., self._rows]
        return values

    def moved(self, now: Parameters, terms: Sequence[BaseTerm]) -> tuple[Moved, ...]:
        index = now.terms.index(self.parameter)
        before = float(now.values[self._rows, index].mean())
        return (Moved(self._label(self.parameter), before, 1.0, terms[index].unit),)


@dataclass(frozen=True)
class LoadFactor(Reading):
    """The load that hangs on an axis that turns by the factor 1 + size: more mass on its lever.

    The inertia of that mass goes with the square of the lever, which nobody knows; it is a reading
    of its own.
    """

    least: ClassVar[float] = -1.0

    def apply(self, now: Parameters, size: np.ndarray) -> np.ndarray:
        values = now.values.copy()
        for name in TURNING:
            values[..., self._rows, now.terms.index(name)] *= 1.0 + size[..., None]
        return values

    def moved(self, now: Parameters, terms: Sequence[BaseTerm]) -> tuple[Moved, ...]:
        found = []
        for name in TURNING:
            index = now.terms.index(name)
            before = float(now.values[self._rows, index].mean())
            found.append(Moved(self._label(name), before, before, terms[index].unit))
        return tuple(found)


@dataclass(frozen=True)
class SlidingPayload(Reading):
    """A mass, kg, on an axis that slides upright: it is moved and it hangs.

    Attributes:
        side: 1 where positions count upwards, so that the load is positive, else -1.
    """

    side: float

    def apply(self, now: Parameters, size: np.ndarray) -> np.ndarray:
        values = now.values.copy()
        for name, slope in self._slopes(now):
            values[..., self._rows, now.terms.index(name)] += now.recorded(
                slope * size)[..., self._rows]
        return values

    def moved(self, now: Parameters, terms: Sequence[BaseTerm]) -> tuple[Moved, ...]:
        return tuple(
            Moved(self._label(name), float(now.values[self._rows, index].mean()), slope,
                  terms[index].unit)
            for name, slope in self._slopes(now) for index in (now.terms.index(name),))

    def _slopes(self, now: Parameters) -> tuple[tuple[str, float], ...]:
        slopes = ((SLIDING[0], self.side * GRAVITY), (INERTIA, 1.0))
        return tuple((name, slope) for name, slope in slopes if name in now.terms)


@dataclass(frozen=True)
class FrictionFactor(Reading):
    """Friction by one factor, 1 + size: temperature, grease, a brake that rubs.

    Attributes:
        kinds: Coulomb, viscous or both.
    """

    least: ClassVar[float] = -1.0
    kinds: tuple[str, ...]

    def apply(self, now: Parameters, size: np.ndarray) -> np.ndarray:
        values = now.values.copy()
        for kind in self.kinds:
            values[..., self._rows, now.terms.index(kind)] *= 1.0 + size[..., None]
        return values

    def moved(self, now: Parameters, terms: Sequence[BaseTerm]) -> tuple[Moved, ...]:
        found = []
        for kind in self.kinds:
            index = now.terms.index(kind)
            before = float(now.values[self._rows, index].mean())
            found.append(Moved(self._label(kind), before, before, terms[index].unit))
        return tuple(found)


@dataclass(frozen=True)
class GainFactor(Reading):
    """Recorded torque by the factor 1 + size: a gain, the supply, the sensor of the current."""

    least: ClassVar[float] = -1.0

    def apply(self, now: Parameters, size: np.ndarray) -> np.ndarray:
        values, rows = now.values.copy(), self._rows
        values[..., rows, :] += size[..., None, None] * (now.values + now.known)[..., rows, :]
        return values

    def moved(self, now: Parameters, terms: Sequence[BaseTerm]) -> tuple[Moved, ...]:  # noqa: ARG002
        return (Moved(self._label(SCALE), 1.0, 1.0, '1'),)


def mass_on_lever(moment: float, inertia: float) -> tuple[float, float]:
    """Return the mass (kg) and its distance (m) of a point that adds so much to an axis.

    Args:
        moment: m g r, N m, > 0.
        inertia: m r^2, kg m2, > 0.
    """
    distance = GRAVITY * inertia / moment
    return moment / (GRAVITY * distance), distance


def readings_of(terms: Sequence[BaseTerm], joints: int) -> tuple[Reading, ...]:
    """Return all readings; of two that are one, as friction of a single joint, one only."""
    platform = [name for name in PLATFORM_MASSES if name in {term.name for term in terms}]
    own = [term.name for term in terms if term.name not in (*PLATFORM_MASSES, *FRICTION)]
    each = range(joints) if joints > 1 else ()
    found: list[Reading] = [Added(None, name) for name in (*platform, *own)]
    names = {term.name for term in terms}
    if set(TURNING) <= names:
        found.append(LoadFactor(None))
    if set(SLIDING) <= names:
        found += [SlidingPayload(None, side) for side in (1.0, -1.0)]
    found += [GainFactor(None), FrictionFactor(None, FRICTION)]
    found += [FrictionFactor(None, (kind,)) for kind in FRICTION]
    for joint in each:
        found += [GainFactor(joint), FrictionFactor(joint, FRICTION)]
        found += [Added(joint, name) for name in (*own, *FRICTION)]
    return tuple(found)


def applied(readings: Sequence[Reading], sizes: Sequence[float] | np.ndarray, now: Parameters
            ) -> np.ndarray:
    """Return the values (J, p) after several changes; gains act on all that the others make."""
    return applied_sets([readings], np.array(sizes, dtype=float)[None], now)[0]


def applied_sets(sets: Sequence[Sequence[Reading]], sizes: np.ndarray, now: Parameters
                 ) -> np.ndarray:
    """Return the values (m, ..., J, p) after each of m sets of equally many changes, as `applied`.

    Args:
        sets: of readings.
        sizes: of the readings, (m, ..., count).
        now: the parameters before.
    """
    values = np.broadcast_to(now.values, (*sizes.shape[:-1], *now.values.shape)).copy()
    orders = [sorted(range(len(readings)), key=lambda place: isinstance(
        readings[place], GainFactor)) for readings in sets]
    for step in range(sizes.shape[-1]):
        alike: dict[Reading, list[int]] = {}  # sets whose next reading is the same
        for number, readings in enumerate(sets):
            alike.setdefault(readings[orders[number][step]], []).append(number)
        for reading, numbers in alike.items():
            own = sizes[numbers, ..., [orders[number][step] for number in numbers]]
            values[numbers] = reading.apply(now.with_values(values[numbers]), own)
    return values
