"""The whitened problem: target, base columns, and the columns of every hypothesis, made once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Key, Kind, key_of, shape_key
from par4_identification.diagnosis.evidence.observations import (
    Observations,
    lasting,
    same_scale,
)
from par4_identification.diagnosis.evidence.side_by_side import side_by_side
from par4_identification.diagnosis.evidence.whitener import Whitener


def spread(blocks: list[np.ndarray], joints: tuple[int, ...], shared: bool) -> np.ndarray:
    """Return columns of each joint (n_j, K) stacked over the joints as one matrix.

    Shared coefficients give K columns; otherwise each acting joint has K columns of its own.
    """
    lengths = [len(block) for block in blocks]
    ends = np.cumsum([0, *lengths])
    width = blocks[0].shape[1]
    columns = np.zeros((ends[-1], width if shared else width * len(joints)), order='F')
    for position, joint in enumerate(joints):
        rows = slice(ends[joint], ends[joint + 1])
        first = 0 if shared else position * width
        columns[rows, first:first + width] = blocks[joint]
    return columns


@dataclass(frozen=True)
class Block:
    """Whitened columns of an effect at one shape, all joints.

    Attributes:
        columns: (n_j, K) of each joint.
        gram: columns^T columns of each joint, (J, K, K).
    """

    columns: tuple[np.ndarray, ...]
    gram: np.ndarray


@dataclass(frozen=True)
class Stack:
    """Whitened columns of an effect at s shapes side by side, all joints.

    Attributes:
        columns: (n_j, s K) of each joint.
        gram: those of a shape among each other, (s, J, K, K).
    """

    columns: tuple[np.ndarray, ...]
    gram: np.ndarray


AT_ONCE = 4
"""Torques that are filtered and whitened together."""
Result = TypeVar('Result')
BASE: Key = ('base',)
"""The columns of the base terms."""


@dataclass(frozen=True)
class Evidence:
    """The whitened problem: target and base columns of all joints stacked.

    Products of columns with each other are computed once. All that is asked of any design, of
    what columns explain beside it, follows from them by small linear systems.

    Attributes:
        observations: the rows.
        whitener: noise models.
        target: y, (N,).
        base: (N, p).
        ends: first row of each joint and, last, N, (J + 1,).
    """

    observations: Observations
    whitener: Whitener
    target: np.ndarray
    base: np.ndarray
    ends: np.ndarray
    _kept: dict[Key, Any] = field(default_factory=dict)
    _products: dict[tuple[Key, Key], tuple[np.ndarray, ...]] = field(default_factory=dict)

    def blocks(self, effect: Effect | Kind, shape: Shape) -> list[Block]:
        """Return the whitened columns of the parts of an effect; computed once."""
        parts = effect.parts(shape)
        keys = [key_of(effect, part) for part in parts]
        for key, part in zip(keys, parts):
            if key not in self._kept:
                self.keep(effect, (part,))
        return [self._kept[key] for key in keys]

    def width(self, effect: Effect | Kind, shape: Shape) -> int:
        """Return the number of columns of an effect on a joint."""
        return sum(block.gram.shape[-1] for block in self.blocks(effect, shape))

    def keep(self, effect: Effect | Kind, shapes: Sequence[Shape]) -> None:
        """Compute the whitened columns of an effect at many shapes together, which is quicker."""
        missing = [shape for shape in shapes if key_of(effect, shape) not in self._kept]
        if not missing:
            return
        self.observations.keep(effect, [part for shape in missing for part in effect.parts(shape)])
        rows = [self.observations.effect_rows(effect, shape) for shape in missing]
        white = [np.asfortranarray(part) for part in self.whitener.whiten(
            [np.concatenate(parts, axis=2) for parts in zip(*rows)])]
        width = rows[0][0].shape[2]
        for number, shape in enumerate(missing):
            self._kept[key_of(effect, shape)] = _block(
                [part[:, number * width:(number + 1) * width] for part in white])

    def put(self, effect: Effect | Kind, rows: Sequence[np.ndarray]) -> None:
        """Keep filtered rows (m, J, K) of each run as the columns of an effect without a shape."""
        self._kept[key_of(effect, {})] = _block(self.whitener.whiten(rows))

    def stack(self, effect: Effect | Kind, shapes: Sequence[Shape]) -> Stack:
        """Return the whitened columns of an effect at many shapes, side by side; computed once."""
        keys = [key_of(effect, shape) for shape in shapes]
        key = stack_key(effect, shapes)
        if key not in self._kept:
            self.keep(effect, shapes)
            blocks = [self._kept[name] for name in keys]
            # column by column in memory, so that those of one shape are together there
            stack = Stack(tuple(np.vstack([part.T for part in parts]).T for parts in zip(*(
                block.columns for block in blocks))), np.stack([block.gram for block in blocks]))
            self._kept[key] = stack
            width = blocks[0].gram.shape[-1]
            for number, (name, block) in enumerate(zip(keys, blocks)):  # held once
                own = slice(number * width, (number + 1) * width)
                self._kept[name] = Block(
                    tuple(part[:, own] for part in stack.columns), block.gram)
        return self._kept[key]

    def products(self, first: Key, second: Key) -> tuple[np.ndarray, ...]:
        """Return the products (k, l) of two sets of columns of each joint; computed once.

        The columns of a hypothesis, or of several shapes, must have been made before.
        """
        pair = first, second
        found = self._products.get(pair)
        if found is None:
            turned = self._products.get((second, first))
            found = self._products[pair] = tuple(
                part.T for part in turned) if turned is not None else tuple(
                own.T @ other for own, other in zip(self._of_joints(first),
                                                    self._of_joints(second)))
        return found

    def moments(self, key: Key) -> tuple[np.ndarray, ...]:
        """Return the products (k,) of columns with what base terms alone leave of the target."""
        return tuple(part[:, 0] for part in self.products(key, _TARGET))

    @cached_property
    def origin(self) -> np.ndarray:
        """Base parameters (p,) fitted alone. Products of what they leave lose less by rounding."""
        return np.linalg.lstsq(self.base, self.target, rcond=None)[0]

    @cached_property
    def target_left(self) -> np.ndarray:
        """What base terms alone leave of the target, (N,)."""
        return self.target - self.base @ self.origin

    def _of_joints(self, key: Key) -> tuple[np.ndarray, ...]:
        """Return the columns of each joint."""
        return tuple(self.columns_of_joint(key, joint) for joint in range(len(self.ends) - 1))

    def columns_of_joint(self, key: Key, joint: int) -> np.ndarray:
        """Return columns that have been made before, or those of the base terms, of a joint."""
        if key not in (BASE, _TARGET):
            return self._kept[key].columns[joint]
        columns = self.base if key == BASE else self.target_left[:, None]
        return columns[self.ends[joint]:self.ends[joint + 1]]

    def torques(self, keys: Sequence[Key], torque: Callable[[State, Key], np.ndarray]
                ) -> np.ndarray:
        """Return the whitened, stacked rows (N, k) of torques; each computed once for its key.

        Args:
            keys: an effect and whatever tells its torques apart, k of them.
            torque: of a motion and a key, (n, J), N m.
        """
        missing = [key for key in keys if key not in self._kept]
        for first in range(0, len(missing), AT_ONCE):
            some = missing[first:first + AT_ONCE]
            rows = [run.rows(np.stack(side_by_side(partial(torque, run.state), some), axis=-1))
                    for run in self.observations.runs]
            white = np.concatenate(self.whitener.whiten(rows))
            self._kept.update(zip(some, np.ascontiguousarray(white.T)))
        return np.stack([self._kept[key] for key in keys], axis=1)

    def once(self, key: Key, make: Callable[[], Result]) -> Result:
        """Return what `make` returns; it is called once for each key, an effect and words."""
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    def columns(self, hypothesis: Hypothesis) -> np.ndarray:
        """Return the whitened, stacked columns of a hypothesis."""
        blocks = self.blocks(hypothesis.effect, hypothesis.shape)
        shared = hypothesis.effect.shared
        of_joints = [(parts[0] if len(parts) == 1 else np.hstack(parts))[:, hypothesis.columns]
                     for parts in zip(*(block.columns for block in blocks))]
        return spread(of_joints, tuple(range(len(of_joints))) if shared else hypothesis.joints,
                      shared)

    def design(self, hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        """Return base columns and those of the hypotheses, (N, c)."""
        return np.hstack([self.base, *(self.columns(item) for item in hypotheses)])

    def whitened(self, residuals: Sequence[np.ndarray]) -> np.ndarray:
        """Return residuals (m, J) of each run, N m, whitened and stacked, (N,)."""
        return np.concatenate(self.whitener.whiten([part[..., None] for part in residuals]))[:, 0]

    def sent_back(self, white: np.ndarray) -> list[np.ndarray]:
        """Return values (n, J) at the samples of each run of whitened, stacked rows (N,).

        Their products with columns (n, J), as an effect computes them, are those of the rows with
        the same columns filtered, whitened and stacked, which need not be made (see `Run.adjoint`).
        """
        return [run.adjoint(rows) for run, rows in zip(
            self.observations.runs, self.whitener.adjoint(white))]

    @property
    def rows(self) -> int:
        """Number of rows that count."""
        return int(sum(run.valid.sum() for run in self.whitener.runs))


_TARGET: Key = ('target',)


def _block(columns: Sequence[np.ndarray]) -> Block:
    return Block(tuple(columns), np.stack([part.T @ part for part in columns]))


def stack_key(effect: Effect | Kind, shapes: Sequence[Shape]) -> Key:
    """Return the key of the columns at many shapes side by side."""
    return effect, ('stack', *map(shape_key, shapes))


def gather(observations: Observations, whitener: Whitener, before: Evidence | None = None
           ) -> Evidence:
    """Return the whitened problem of observations.

    Args:
        observations: the rows.
        whitener: noise models.
        before: the problem of the same rows with another nominal torque, whose columns are used
            again where they do not depend on it.
    """
    joints = tuple(range(observations.joints))
    target = whitener.whiten([part[..., None] for part in observations.target])
    base = whitener.whiten(observations.base)
    if before is not None and not same_scale(before.observations.runs, observations.runs):
        before = None
    return Evidence(observations, whitener, np.concatenate(target)[:, 0],
                    spread(base, joints, shared=True),
                    np.cumsum([0, *(len(part) for part in target)]),
                    *(({}, {}) if before is None else (
                        lasting(before._kept), _lasting_products(before._products))))


def _lasting_products(products: dict[tuple[Key, Key], tuple[np.ndarray, ...]]
                      ) -> dict[tuple[Key, Key], tuple[np.ndarray, ...]]:
    """Return those of the products of which neither columns depend on the nominal torque."""
    return {keys: value for keys, value in products.items()
            if not any(getattr(key[0], 'needs_nominal', False) for key in keys)}
