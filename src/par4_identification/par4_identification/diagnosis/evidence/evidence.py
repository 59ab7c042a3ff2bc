"""Whitened linear algebra: what a block of columns explains beyond those already in the model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.observations import Observations, lasting
from par4_identification.diagnosis.evidence.unnamed import PRIOR_ROWS, Kind
from par4_identification.signals.noise import ArNoise, Whitening, fit_noise


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

    @property
    def key(self) -> tuple:
        """A key that no other hypothesis has."""
        return self.effect, tuple(sorted(self.shape.items())), self.joints, self.sets


def _shown(value: float | tuple[float, ...]) -> str:
    return (' + '.join(map(_shown, value)) if isinstance(value, tuple) else
            f'{value:.0f}' if value == int(value) else f'{value:.4g}')


@dataclass(frozen=True)
class Whitener:
    """Standardises rows by the noise of their joint; invalid rows become zero.

    Attributes:
        noise: of each joint.
        valid: (m, J) of each run.
    """

    noise: tuple[ArNoise, ...]
    valid: tuple[np.ndarray, ...]

    def whiten(self, rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return for each joint the whitened rows (n, k) of all runs, (m, J, k) a run."""
        return [np.concatenate([whitening.of(part[:, joint])
                                for part, whitening in zip(rows, of_runs)])
                for joint, of_runs in enumerate(self._whitenings)]

    @cached_property
    def _whitenings(self) -> list[list[Whitening]]:
        """The filter of each joint for each run."""
        return [[noise.whitening(valid[:, joint]) for valid in self.valid]
                for joint, noise in enumerate(self.noise)]


def whitener_of_residuals(observations: Observations, residuals: Sequence[np.ndarray],
                          parameters: int) -> Whitener:
    """Return the whitener whose noise model fits residuals (m, J) of each run."""
    valid = tuple(run.valid for run in observations.runs)
    joints = observations.joints
    noise = tuple(
        fit_noise([part[:, joint] for part in residuals], [mask[:, joint] for mask in valid],
                  parameters / joints)
        for joint in range(joints))
    return Whitener(noise, valid)


def flat_whitener(observations: Observations, sigma: np.ndarray) -> Whitener:
    """Return a whitener for white noise of standard deviation sigma (J,)."""
    noise = tuple(ArNoise(np.zeros(1), float(value) ** 2) for value in sigma)
    return Whitener(noise, tuple(run.valid for run in observations.runs))


def spread(blocks: list[np.ndarray], joints: tuple[int, ...], shared: bool) -> np.ndarray:
    """Return columns of each joint (n_j, K) stacked over the joints as one matrix.

    Shared coefficients give K columns; otherwise each acting joint has K columns of its own.
    """
    lengths = [len(block) for block in blocks]
    ends = np.cumsum([0, *lengths])
    width = blocks[0].shape[1]
    columns = np.zeros((ends[-1], width if shared else width * len(joints)))
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


@dataclass(frozen=True)
class Evidence:
    """The whitened problem: target and base columns of all joints stacked.

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
    _kept: dict = field(default_factory=dict)

    def block(self, effect: Effect | Kind, shape: Shape) -> Block:
        """Return the whitened columns of an effect; computed once."""
        key = (effect, tuple(sorted(shape.items())))
        if key not in self._kept:
            parts = effect.parts(shape)
            if len(parts) > 1:
                blocks = [self.block(effect, part) for part in parts]
                columns = tuple(np.hstack(part) for part in zip(*(
                    block.columns for block in blocks)))
                self._kept[key] = Block(columns, np.stack([part.T @ part for part in columns]))
            else:
                self.keep(effect, (shape,))
        return self._kept[key]

    def keep(self, effect: Effect, shapes: Sequence[Shape]) -> None:
        """Compute the whitened columns of an effect at many shapes together, which is quicker."""
        missing = [shape for shape in shapes
                   if (effect, tuple(sorted(shape.items()))) not in self._kept]
        if not missing:
            return
        self.observations.keep(effect, missing)
        rows = [self.observations.effect_rows(effect, shape) for shape in missing]
        white = self.whitener.whiten([np.concatenate(parts, axis=2) for parts in zip(*rows)])
        width = rows[0][0].shape[2]
        for number, shape in enumerate(missing):
            columns = tuple(part[:, number * width:(number + 1) * width] for part in white)
            self._kept[effect, tuple(sorted(shape.items()))] = Block(
                columns, np.stack([part.T @ part for part in columns]))

    def stack(self, effect: Effect, shapes: Sequence[Shape]) -> Stack:
        """Return the whitened columns of an effect at many shapes, side by side; computed once."""
        names = tuple(tuple(sorted(shape.items())) for shape in shapes)
        key = effect, ('stack', *names)
        if key not in self._kept:
            self.keep(effect, shapes)
            blocks = [self._kept[effect, name] for name in names]
            stack = Stack(tuple(np.hstack(parts) for parts in zip(*(
                block.columns for block in blocks))), np.stack([block.gram for block in blocks]))
            if len(blocks) == 1:
                return stack
            self._kept[key] = stack
            width = blocks[0].gram.shape[-1]
            for number, (name, block) in enumerate(zip(names, blocks)):  # held once
                own = slice(number * width, (number + 1) * width)
                self._kept[effect, name] = Block(
                    tuple(part[:, own] for part in stack.columns), block.gram)
        return self._kept[key]

    def torque(self, key: tuple, torque: Callable[[State], np.ndarray]) -> np.ndarray:
        """Return the whitened, stacked rows (N,) of a torque; computed once for a key.

        Args:
            key: an effect's name and whatever tells its torques apart.
            torque: of a motion, (n, J), N m.
        """
        if key not in self._kept:
            self._kept[key] = self.whitened([run.rows(torque(run.state))
                                             for run in self.observations.runs])
        return self._kept[key]

    def columns(self, hypothesis: Hypothesis) -> np.ndarray:
        """Return the whitened, stacked columns of a hypothesis."""
        block = self.block(hypothesis.effect, hypothesis.shape)
        shared = hypothesis.effect.shared
        return spread([part[:, hypothesis.columns] for part in block.columns],
                      tuple(range(len(block.columns))) if shared else hypothesis.joints, shared)

    def design(self, hypotheses: Sequence[Hypothesis]) -> np.ndarray:
        """Return base columns and those of the hypotheses, (N, c)."""
        return np.hstack([self.base, *(self.columns(item) for item in hypotheses)])

    def left(self, hypotheses: Sequence[Hypothesis], fit: Fit) -> np.ndarray:
        """Return the target minus a fit, (N,). The fit may have been made on other rows."""
        values = [fit.base, *(item.stacked(coefficients) for item, coefficients in zip(
            hypotheses, fit.coefficients))]
        return self.target - self.design(hypotheses) @ np.concatenate(values)

    def whitened(self, residuals: Sequence[np.ndarray]) -> np.ndarray:
        """Return residuals (m, J) of each run, N m, whitened and stacked, (N,)."""
        return np.concatenate(self.whitener.whiten([part[..., None] for part in residuals]))[:, 0]

    @property
    def rows(self) -> int:
        """Number of rows that count."""
        return int(sum(valid.sum() for valid in self.whitener.valid))


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
    return Evidence(observations, whitener, np.concatenate(target)[:, 0],
                    spread(base, joints, shared=True),
                    np.cumsum([0, *(len(part) for part in target)]),
                    {} if before is None else lasting(before._kept))


@dataclass(frozen=True)
class Projection:
    """What a design leaves of the target. Each part is computed when it is asked for.

    Attributes:
        evidence: whose target.
        hypotheses: in the design, beside the base columns.
    """

    evidence: Evidence
    hypotheses: tuple[Hypothesis, ...]

    @cached_property
    def basis(self) -> np.ndarray:
        """Orthonormal basis of the design, (N, c).

        The prior of unnamed causes counts as rows of its own, which no other column has.
        """
        design = self.evidence.design(self.hypotheses)
        size = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
        weight = np.sqrt(prior_weights(self.evidence, self.hypotheses, len(size))) / size
        prior = np.diag(weight)[weight > 0.0]
        basis, _ = np.linalg.qr(np.vstack((design / size, prior)))
        return basis[:len(design)]

    @cached_property
    def residual(self) -> np.ndarray:
        """What is left of the target, (N,)."""
        return self.rest(self.evidence.target)

    def gains(self, effect: Effect, shapes: Sequence[Shape]) -> np.ndarray:
        """Return twice the gain in log-likelihood by an effect on all joints at each shape, (s,).

        Linear algebra of small matrices, joint by joint: what a joint's columns do to the others
        goes through the basis alone.
        """
        inside, moment, gram = self._normal_equations(effect, shapes)
        size = np.einsum('skk->sk', gram)
        return quadratic(gram - inside.transpose(0, 2, 1) @ inside, moment, size)

    def gain(self, effect: Effect, shape: Shape) -> float:
        """Return twice the gain in log-likelihood by adding an effect on all joints."""
        return float(self.gains(effect, (shape,))[0])

    def estimate(self, effect: Effect, shape: Shape) -> np.ndarray:
        """Return the coefficients of an added effect, in the order of its stacked columns."""
        inside, moment, gram = self._normal_equations(effect, (shape,))
        return np.linalg.lstsq(gram[0] - inside[0].T @ inside[0], moment[0], rcond=1e-9)[0]

    def _normal_equations(self, effect: Effect, shapes: Sequence[Shape]
                          ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the columns along the basis (s, c, k), their moments (s, k), products (s, k, k).

        They are those of each shape's columns, stacked over the joints where they share none.
        """
        stack = self.evidence.stack(effect, shapes)
        ends, count = self.evidence.ends, len(shapes)
        inside, moment = [], []
        for joint, columns in enumerate(stack.columns):
            rows = slice(ends[joint], ends[joint + 1])
            inside.append((self.basis[rows].T @ columns).reshape(
                self.basis.shape[1], count, -1).transpose(1, 0, 2))
            moment.append((columns.T @ self.residual[rows]).reshape(count, -1))
        if effect.shared:
            return sum(inside), sum(moment), stack.gram.sum(axis=1)
        width = stack.gram.shape[-1]
        gram = np.zeros((count, len(inside) * width, len(inside) * width))
        for joint in range(len(inside)):
            own = slice(joint * width, (joint + 1) * width)
            gram[:, own, own] = stack.gram[:, joint]
        return np.concatenate(inside, axis=2), np.concatenate(moment, axis=1), gram

    def rest(self, columns: np.ndarray) -> np.ndarray:
        """Return the part of columns (N, ...) that is orthogonal to the design."""
        return columns - self.basis @ (self.basis.T @ columns)

    def left_share(self, columns: np.ndarray, coefficients: np.ndarray) -> float:
        """Return the share (rms) of columns @ coefficients that the design cannot imitate."""
        signal = columns @ coefficients
        return float(np.linalg.norm(self.rest(signal)) / max(np.linalg.norm(signal), 1e-30))


def quadratic(gram: np.ndarray, moment: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Return moment^T gram^-1 moment. Directions of gram that are only rounding are left out.

    Args:
        gram: (..., k, k).
        moment: (..., k).
        size: what the diagonal was before anything was taken out, (..., k).
    """
    scale = np.sqrt(np.maximum(size, 1e-30))
    values, vectors = np.linalg.eigh(gram / (scale[..., :, None] * scale[..., None, :]))
    along = np.einsum('...kl,...k->...l', vectors, moment / scale)
    kept = values > 1e-7
    return np.sum(np.where(kept, along ** 2, 0.0) / np.where(kept, values, 1.0), axis=-1)


def project(evidence: Evidence, hypotheses: Sequence[Hypothesis]) -> Projection:
    """Return the projection of the target out of base columns and hypotheses."""
    return Projection(evidence, tuple(hypotheses))


def prior_weights(evidence: Evidence, hypotheses: Sequence[Hypothesis], coefficients: int
                  ) -> np.ndarray:
    """Return the weight (c,) of the prior, zero, of each coefficient: squares of a row of its own.

    Only unnamed causes have one. It is that of `PRIOR_ROWS` rows in which a column has its usual
    size, or that of the cause's columns on the average where it is larger: a column that the
    motion hardly visits must not be free to be anything where other motions go.
    """
    weights = np.zeros(coefficients)
    last = coefficients
    for item in reversed(hypotheses):
        block = evidence.block(item.effect, item.shape)
        squares = np.einsum('jkk->jk', block.gram)
        own = (squares.sum(axis=0)[item.columns] if item.effect.shared
               else squares[list(item.joints)].ravel())
        first = last - len(own)
        if isinstance(item.effect, Kind):
            rows = evidence.rows if item.effect.shared else evidence.rows / len(squares)
            weights[first:last] = PRIOR_ROWS / max(rows, 1.0) * np.maximum(own, own.mean())
        last = first
    return weights


@dataclass(frozen=True)
class Fit:
    """Generalised least squares of base terms and hypotheses.

    Unnamed causes have a prior; their part of the covariance is that of the posterior.

    Attributes:
        base: values (p,).
        coefficients: (K, J) of each hypothesis, zero on joints it does not act on.
        covariance: of everything, in the order of the design, (c, c).
        slices: where the coefficients of each hypothesis are in it.
        hypotheses: that were fitted.
    """

    base: np.ndarray
    coefficients: tuple[np.ndarray, ...]
    covariance: np.ndarray
    slices: tuple[slice, ...]
    hypotheses: tuple[Hypothesis, ...]


def solve(evidence: Evidence, hypotheses: Sequence[Hypothesis]) -> Fit:
    """Return the fit of base terms and hypotheses with its covariance."""
    design = evidence.design(hypotheses)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
    prior = np.diag(prior_weights(evidence, hypotheses, design.shape[1]) / scale ** 2)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale) + prior, rcond=1e-12,
                             hermitian=True)
    values = inverse @ ((design / scale).T @ evidence.target) / scale
    return fit_of(evidence, hypotheses, values, inverse / np.outer(scale, scale))


def fit_of(evidence: Evidence, hypotheses: Sequence[Hypothesis], values: np.ndarray,
           covariance: np.ndarray) -> Fit:
    """Return the fit whose values are (c,), in the order of the design."""
    parameters = evidence.base.shape[1]
    joints = evidence.observations.joints
    coefficients, slices, first = [], [], parameters
    for hypothesis in hypotheses:
        rows = evidence.observations.effect_rows(hypothesis.effect, hypothesis.shape)
        width = rows[0].shape[2]
        full = np.zeros((width, joints))
        if hypothesis.effect.shared:
            span = slice(first, first + len(full[hypothesis.columns]))
            full[hypothesis.columns] = values[span, None]
        else:
            span = slice(first, first + width * len(hypothesis.joints))
            full[:, list(hypothesis.joints)] = values[span].reshape(-1, width).T
        coefficients.append(full)
        slices.append(span)
        first = span.stop
    return Fit(values[:parameters], tuple(coefficients), covariance, tuple(slices),
               tuple(hypotheses))


def residuals(observations: Observations, hypotheses: Sequence[Hypothesis], fit: Fit
              ) -> tuple[np.ndarray, ...]:
    """Return measured minus fitted torque (m, J) of each run of `observations`."""
    results = []
    for index, (target, base) in enumerate(zip(observations.target, observations.base)):
        left = target - base @ fit.base
        for hypothesis, coefficients in zip(hypotheses, fit.coefficients):
            rows = observations.effect_rows(hypothesis.effect, hypothesis.shape)[index]
            left = left - np.einsum('mjk,kj->mj', rows, coefficients)
        results.append(left)
    return tuple(results)
