"""What a design leaves of the target, and what more columns explain beside it.

All of it follows from products of columns that the evidence keeps, by small linear systems. Nothing
but `rest` and `residual` looks at rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape
from par4_identification.diagnosis.evidence.evidence import (
    BASE,
    Evidence,
    stack_key,
)
from par4_identification.diagnosis.evidence.fit import prior_weights
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Key, Kind, key_of
from par4_identification.diagnosis.evidence.small_systems import orthonormal, quadratic


@dataclass(frozen=True)
class _Part:
    """Columns of a design.

    Attributes:
        key: of the columns that they are chosen from.
        columns: which of them, a slice where it is all.
        places: where their coefficients are in the design, by the joint on which they act.
    """

    key: Key
    columns: np.ndarray | slice
    places: dict[int, slice]


@dataclass(frozen=True)
class Projection:
    """What a design leaves of the target. Each part is computed when it is asked for.

    The prior of unnamed causes counts as additional rows, in which all other columns are zero.

    Attributes:
        evidence: has the target and the columns.
        hypotheses: of the design, which also has the base columns.
    """

    evidence: Evidence
    hypotheses: tuple[Hypothesis, ...]

    @cached_property
    def _parts(self) -> list[_Part]:
        """The base columns and those of the hypotheses, in the order of the design."""
        size = self.evidence.base.shape[1]
        joints = range(self.evidence.observations.joints)
        parts = [_Part(BASE, slice(None), {joint: slice(0, size) for joint in joints})]
        for item in self.hypotheses:
            shared = item.effect.shared
            acting = list(joints if shared else item.joints)
            widths = [block.gram.shape[-1]
                      for block in self.evidence.blocks(item.effect, item.shape)]
            chosen = np.arange(sum(widths))[item.columns]
            first = 0  # of the part's columns among those of the effect
            for shape, width in zip(item.effect.parts(item.shape), widths):
                own = (chosen >= first) & (chosen < first + width)
                before, count = int(np.sum(chosen < first)), int(own.sum())
                starts = [size + before + (0 if shared else number * len(chosen))
                          for number in range(len(acting))]
                columns = slice(None) if count == width else chosen[own] - first
                parts.append(_Part(key_of(item.effect, shape), columns, {
                    joint: slice(start, start + count) for joint, start in zip(acting, starts)}))
                first += width
            size += len(chosen) * (1 if shared else len(acting))
        return parts

    @cached_property
    def _directions(self) -> np.ndarray:
        """Combinations W (c, r) of the columns D of the design that are orthonormal: with the
        prior's squares P, W^T (D^T D + P) W = 1. Directions that are only rounding are left out."""
        size = max(place.stop for part in self._parts for place in part.places.values())
        gram = np.zeros((size, size))
        for row, part in enumerate(self._parts):
            for other in self._parts[:row + 1]:
                products = self.evidence.products(part.key, other.key)
                for joint, place in part.places.items():
                    if joint in other.places:  # only the lower triangle is looked at
                        gram[place, other.places[joint]] += (
                            products[joint][part.columns][:, other.columns])
        gram[np.diag_indices(size)] += prior_weights(self.evidence, self.hypotheses, size)
        scale = np.sqrt(np.maximum(gram.diagonal(), 1e-30))
        return orthonormal(gram / np.outer(scale, scale)) / scale[:, None]

    @cached_property
    def _target_moment(self) -> np.ndarray:
        """Products (c,) of the design with what base terms alone leave of the target."""
        moment = np.zeros(len(self._directions))
        for part in self._parts:
            products = self.evidence.moments(part.key)
            for joint, place in part.places.items():
                moment[place] += products[joint][part.columns]
        return moment

    @cached_property
    def _values(self) -> np.ndarray:
        """Coefficients (c,) of the design, fitted to what base terms alone leave."""
        return self._directions @ (self._directions.T @ self._target_moment)

    @cached_property
    def _of_joints(self) -> list[tuple[list[tuple[int, np.ndarray | slice]], np.ndarray,
                                       np.ndarray]]:
        """Of each joint: which parts act on it and by which of their columns, the directions (r, c)
        of these columns and their coefficients (c,)."""
        found = []
        for joint in range(self.evidence.observations.joints):
            acting = [(number, part) for number, part in enumerate(self._parts)
                      if joint in part.places]
            rows = np.concatenate([np.arange(part.places[joint].start, part.places[joint].stop)
                                   for _, part in acting])
            found.append(([(number, part.columns) for number, part in acting],
                          self._directions[rows].T, self._values[rows]))
        return found

    @cached_property
    def squares(self) -> float:
        """Whitened squares that the fit leaves of the target, with those of its prior."""
        left = self.evidence.target_left
        return float(left @ left - self._target_moment @ self._values)

    @property
    def last_gains(self) -> list[float]:
        """Twice the gain in log-likelihood of each part of the last hypothesis beside all else."""
        last = self.hypotheses[-1]
        gains = []
        for part in self._parts[-len(last.effect.parts(last.shape)):]:
            own = np.unique(np.concatenate([
                np.arange(place.start, place.stop) for place in part.places.values()]))
            directions, values = self._directions[own], self._values[own]
            gains.append(float(values @ np.linalg.lstsq(
                directions @ directions.T, values, rcond=1e-9)[0]))
        return gains

    @cached_property
    def design(self) -> np.ndarray:
        """The columns, (N, c)."""
        return self.evidence.design(self.hypotheses)

    @cached_property
    def residual(self) -> np.ndarray:
        """What is left of the target, (N,)."""
        left = self.evidence.target_left.copy()
        for joint, (acting, _, values) in enumerate(self._of_joints):
            own, first = left[self.evidence.ends[joint]:self.evidence.ends[joint + 1]], 0
            for number, columns in acting:
                part = self.evidence.columns_of_joint(self._parts[number].key, joint)[:, columns]
                own -= part @ values[first:first + part.shape[1]]
                first += part.shape[1]
        return left

    def gains(self, effect: Effect | Kind, shapes: Sequence[Shape]) -> np.ndarray:
        """Return twice the gain in log-likelihood by an effect on all joints at each shape, (s,).

        The columns of an effect on different joints have no rows in common, so the algebra is that
        of small matrices, joint by joint; only the design connects them.
        """
        size, gram, moment = self._normal_equations(effect, shapes)
        return quadratic(gram, moment, size)

    def gains_apart(self, effect: Effect, shapes: Sequence[Shape]) -> np.ndarray:
        """Return the same of shapes with one part each that are seldom asked for together.

        Their products are kept shape by shape.
        """
        blocks = [self.evidence.blocks(effect, shape)[0] for shape in shapes]
        size, gram, moment = self._normal_equations_of(
            effect, [key_of(effect, shape) for shape in shapes],
            np.stack([block.gram for block in blocks]))
        return quadratic(gram, moment, size)

    def gain(self, effect: Effect | Kind, shape: Shape) -> float:
        """Return twice the gain in log-likelihood by adding an effect on all joints."""
        return float(self.gains(effect, (shape,))[0])

    def estimate(self, effect: Effect | Kind, shape: Shape) -> np.ndarray:
        """Return the coefficients of an added effect, in the order of its stacked columns."""
        _, gram, moment = self._normal_equations(effect, (shape,))
        return np.linalg.lstsq(gram[0], moment[0], rcond=1e-9)[0]

    def beside(self, hypothesis: Hypothesis) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the normal equations of a hypothesis beside the design.

        Returns:
            Squares (k,) of its columns, products (k, k) of what the design leaves of them, and the
            products (k,) of these with the residual.
        """
        effect = hypothesis.effect
        size, gram, moment = (part[0] for part in self._normal_equations(
            effect, (hypothesis.shape,)))
        width = len(size) if effect.shared else len(size) // self.evidence.observations.joints
        first = (0,) if effect.shared else tuple(joint * width for joint in hypothesis.joints)
        own = np.concatenate([start + np.arange(width)[hypothesis.columns] for start in first])
        return size[own], gram[np.ix_(own, own)], moment[own]

    def _normal_equations(self, effect: Effect | Kind, shapes: Sequence[Shape]
                          ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the squares (s, k) of columns, the products (s, k, k) of what the design leaves
        of them, and their products (s, k) with the residual.

        The columns are those of each shape, stacked over the joints where they share none.
        """
        return self._normal_equations_of(effect, *self._columns(effect, shapes))

    def _normal_equations_of(self, effect: Effect | Kind, keys: Sequence[Key], grams: np.ndarray
                             ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the same of columns by their keys and their products (s, J, k, k)."""
        count, joints, width = grams.shape[:3]
        moments = [self.evidence.moments(key) for key in keys]
        of_parts = [[self.evidence.products(part.key, key) for key in keys]
                    for part in self._parts]
        inside, moment = [], []
        for joint, (acting, directions, values) in enumerate(self._of_joints):
            told = _joined([part[joint] for part in moments])
            products = _joined([
                _joined([part[joint] for part in of_parts[number]], axis=1)[columns]
                for number, columns in acting])
            inside.append((directions @ products).reshape(-1, count, width).transpose(1, 0, 2))
            moment.append((told - products.T @ values).reshape(count, width))
        if effect.shared:
            gram, along, left = grams.sum(axis=1), np.sum(inside, axis=0), np.sum(moment, axis=0)
        else:
            gram = np.zeros((count, joints * width, joints * width))
            for joint in range(joints):
                own = slice(joint * width, (joint + 1) * width)
                gram[:, own, own] = grams[:, joint]
            along, left = np.concatenate(inside, axis=2), np.concatenate(moment, axis=1)
        return (np.einsum('skk->sk', gram).copy(), gram - along.transpose(0, 2, 1) @ along, left)

    def _columns(self, effect: Effect | Kind, shapes: Sequence[Shape]
                 ) -> tuple[list[Key], np.ndarray]:
        """Return the keys of the columns at some shapes, and their products (s, J, k, k)."""
        if len(shapes) > 1:
            return [stack_key(effect, shapes)], self.evidence.stack(effect, shapes).gram
        keys = [key_of(effect, part) for part in effect.parts(shapes[0])]
        blocks = self.evidence.blocks(effect, shapes[0])
        if len(keys) == 1:
            return keys, blocks[0].gram[None]
        grams = [np.block([[self.evidence.products(row, column)[joint] for column in keys]
                           for row in keys]) for joint in range(len(blocks[0].gram))]
        return keys, np.stack(grams)[None]

    def rest(self, columns: np.ndarray) -> np.ndarray:
        """Return the part of columns (N, ...) that is orthogonal to the design."""
        inside = self._directions.T @ (self.design.T @ columns)
        return columns - self.design @ (self._directions @ inside)

    def left_share(self, columns: np.ndarray, coefficients: np.ndarray) -> float:
        """Return the share (rms) of columns @ coefficients that the design cannot imitate."""
        signal = columns @ coefficients
        return float(np.linalg.norm(self.rest(signal))) / max(
            float(np.linalg.norm(signal)), 1e-30)


def _joined(parts: Sequence[np.ndarray], axis: int = 0) -> np.ndarray:
    """Return arrays behind or beside each other; most often there is one."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=axis)


KEPT = 16
"""Projections that are kept; each may hold a design."""


class Projections:
    """The projections of the target of one evidence; the last few are kept."""

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence
        self._kept: dict[frozenset[tuple[object, ...]], Projection] = {}

    def beside(self, hypotheses: Sequence[Hypothesis]) -> Projection:
        """Return what base columns and hypotheses leave of the target."""
        key = frozenset(item.key for item in hypotheses)
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = project(self._evidence, hypotheses)
        return self._kept[key]


def project(evidence: Evidence, hypotheses: Sequence[Hypothesis]) -> Projection:
    """Return the projection of the target out of base columns and hypotheses."""
    return Projection(evidence, tuple(hypotheses))
