"""Least squares of any set of causes from products of columns that are computed once.

A pool holds the whitened columns of every hypothesis that has been looked at closely, and the
products of all columns with each other and with the target, on fitted and on held-out rows. A fit
and its error on held-out rows need nothing else. So any model, with or without one of its causes,
on these joints or those, costs a small linear system.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape
from par4_identification.diagnosis.evidence.evidence import Block, Evidence
from par4_identification.diagnosis.evidence.fit import Fit, fit_of, prior_weights
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind, key_of
from par4_identification.diagnosis.evidence.side_by_side import side_by_side
from par4_identification.diagnosis.evidence.small_systems import assembled, directions, solved

MOST_COLUMNS = 512
"""Columns of a pool beyond which it begins anew: most are those of shapes that were tried once."""
_Layout = tuple[np.ndarray, np.ndarray, np.ndarray, int]
"""Which columns of the pool a model has, joint after joint, and where their coefficients are; where
those of each joint begin and, last, their number, (J + 1,); how many coefficients it has."""


@dataclass(frozen=True)
class Fitted:
    """A model fitted to the rows to fit.

    Attributes:
        fit_squares: whitened squares that it leaves of the rows to fit, with those of its prior.
        heldout_squares: whitened squares that it leaves of the rows held out.
    """

    fit_squares: float
    heldout_squares: float

    @property
    def squares(self) -> tuple[float, float]:
        """Sums of squares that the fit leaves, on fitted and on held-out rows."""
        return self.fit_squares, self.heldout_squares


class _Products:
    """Products of the columns of one part of the data, joint by joint."""

    def __init__(self, evidence: Evidence, origin: np.ndarray) -> None:
        self.evidence = evidence
        self._target = evidence.target - evidence.base @ origin
        self._rows = [slice(first, last) for first, last in zip(evidence.ends, evidence.ends[1:])]
        self.count = 0
        self._columns = [np.empty((rows.stop - rows.start, 64), order='F') for rows in self._rows]
        self.gram = np.zeros((len(self._rows), 64, 64))
        self.moment = np.zeros((len(self._rows), 64))
        self.square = float(self._target @ self._target)
        self.add([evidence.base[rows] for rows in self._rows])

    def add(self, columns: Sequence[np.ndarray]) -> slice:
        """Take columns (n_j, k) of each joint in; return where they are."""
        first, last = self.count, self.count + columns[0].shape[1]
        if last > self.moment.shape[1]:
            self._grow(2 * last)
        for joint, own in enumerate(columns):
            buffer = self._columns[joint]
            buffer[:, first:last] = own
            products = buffer[:, :last].T @ own
            self.gram[joint, :last, first:last] = products
            self.gram[joint, first:last, :last] = products.T
            self.moment[joint, first:last] = own.T @ self._target[self._rows[joint]]
        self.count = last
        return slice(first, last)

    def _grow(self, size: int) -> None:
        """Make room for so many columns."""
        count, old, gram, moment = self.count, self._columns, self.gram, self.moment
        self._columns = [np.empty((len(own), size), order='F') for own in old]
        for own, before in zip(self._columns, old):
            own[:, :count] = before[:, :count]
        self.gram = np.zeros((len(old), size, size))
        self.gram[:, :count, :count] = gram[:, :count, :count]
        self.moment = np.zeros((len(old), size))
        self.moment[:, :count] = moment[:, :count]


class Pool:
    """Fits of any model of hypotheses, by small linear systems.

    Args:
        evidence: rows to fit.
        heldout: rows that no fit sees, whitened alike.
        counted_squares: whitened squares by which the error of the model's torque by encoder
            counts exceeds the noise, on the rows to fit.

    Attributes:
        torque_squares: whitened squares of the measured torque without a constant weight, of the
            rows to fit and held out.
        counted_squares: those of the error by counts, of the rows to fit and held out.
        timing_squares: those of the error by the times of readings, alike.
    """

    def __init__(self, evidence: Evidence, heldout: Evidence, counted_squares: float = 0.0
                 ) -> None:
        self.evidence, self.heldout = evidence, heldout
        # products of small numbers: what the base terms alone explain is taken out beforehand
        self._begin()
        self.torque_squares = tuple(
            float(np.sum(part.whitened(part.observations.varying) ** 2))
            for part in (evidence, heldout))
        self.counted_squares = (
            counted_squares, counted_squares * heldout.rows / max(evidence.rows, 1))
        self.timing_squares = tuple(
            part.whitener.timing_squares() for part in (evidence, heldout))
        self._joints = evidence.observations.joints
        self._base = evidence.base.shape[1]
        self._fits: dict[Any, Fitted] = {}

    def _begin(self) -> None:
        """Forget all columns but those of the base terms; what is asked for again comes back."""
        self._parts = tuple(_Products(part, self.evidence.origin)
                            for part in (self.evidence, self.heldout))
        self._places: dict[Any, slice] = {}
        self._columns: dict[Any, np.ndarray] = {}

    def fit(self, model: Sequence[Hypothesis]) -> Fitted:
        """Return base terms and hypotheses fitted together; computed once for a set of them."""
        key = frozenset(item.key for item in model)
        if key not in self._fits:
            self._fits[key] = self._fit(model)
        return self._fits[key]

    def solution(self, model: Sequence[Hypothesis]) -> Fit:
        """Return the same fit with the coefficients of each hypothesis and their covariance."""
        gram, moment, scale, _ = self._system(model)
        values, vectors = directions(gram)
        inverse = (vectors / values) @ vectors.T
        found = inverse @ moment / scale
        found[:self._base] += self.evidence.origin
        return fit_of(self.evidence, model, found, inverse / np.outer(scale, scale))

    def _fit(self, model: Sequence[Hypothesis]) -> Fitted:
        gram, moment, scale, layout = self._system(model)
        values = solved(gram, moment) / scale
        fit, heldout = self._parts
        seen, told = assembled(heldout.gram, heldout.moment, *layout)
        return Fitted(
            fit.square - float(moment * scale @ values),
            heldout.square - 2.0 * float(told @ values) + float(values @ seen @ values))

    def _system(self, model: Sequence[Hypothesis]
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray, _Layout]:
        """Return the normal equations (c, c), (c,) of a model in columns of the size 1, the sizes
        (c,), and which columns they have."""
        if self._parts[0].count > MOST_COLUMNS:
            self._begin()
        layout = self._layout(model)
        gram, moment = assembled(self._parts[0].gram, self._parts[0].moment, *layout)
        diagonal = np.arange(len(moment))
        gram[diagonal, diagonal] += prior_weights(self.evidence, model, len(moment))
        scale = np.sqrt(np.maximum(gram[diagonal, diagonal], 1e-30))
        return gram / np.outer(scale, scale), moment / scale, scale, layout

    def _layout(self, model: Sequence[Hypothesis]) -> _Layout:
        """Return which columns of each joint a model has, and where their coefficients are."""
        own = [[np.arange(self._base)] for _ in range(self._joints)]
        positions = [[np.arange(self._base)] for _ in range(self._joints)]
        size = self._base
        for item in model:
            columns = self.columns_of(item)
            width = len(columns)
            for joint in (range(self._joints) if item.effect.shared else item.joints):
                own[joint].append(columns)
                positions[joint].append(np.arange(size, size + width))
                size += 0 if item.effect.shared else width
            size += width if item.effect.shared else 0
        ends = np.cumsum([0, *(sum(map(len, parts)) for parts in own)])
        return (np.concatenate(list(chain(*own))), np.concatenate(list(chain(*positions))), ends,
                size)

    def columns_of(self, item: Hypothesis) -> np.ndarray:
        """Return which columns of the pool are those of a hypothesis. Missing ones are added."""
        if item.key not in self._columns:
            places = [self._place(item.effect, shape) for shape in item.effect.parts(item.shape)]
            columns = np.concatenate([np.arange(place.start, place.stop) for place in places])
            self._columns[item.key] = columns[item.columns]
        return self._columns[item.key]

    def prepare(self, items: Sequence[Hypothesis]) -> None:
        """Compute the columns of hypotheses side by side, before any of them is fitted."""
        side_by_side(lambda own: own[0].evidence.blocks(own[1].effect, own[1].shape),
                     [(part, item) for item in items for part in self._parts])

    def _place(self, effect: Effect | Kind, shape: Shape) -> slice:
        key = key_of(effect, shape)
        if key not in self._places:
            blocks: list[Block] = [part.evidence.blocks(effect, shape)[0] for part in self._parts]
            places = side_by_side(lambda own: own[0].add(own[1].columns),
                                  zip(self._parts, blocks))
            self._places[key] = places[0]
        return self._places[key]

    def width(self, item: Hypothesis) -> int:
        """Return the number of coefficients of a hypothesis."""
        return len(self.columns_of(item)) * (1 if item.effect.shared else len(item.joints))

    def numbers(self, item: Hypothesis) -> int:
        """Return how many numbers of a hypothesis a fit chooses: coefficients and those of shapes.
        """
        return self.width(item) + (item.named.free_numbers(item.shape) if item.shape else 0)
