"""Base parameters joint by joint with their joint covariance, of data or of a model file.

Every joint has a value of its own of every base parameter, the platform masses too: a wrong gain of
one drive makes all that its joint tells larger, a payload what all joints tell of one mass, and
only values joint by joint tell the two apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS, BaseTerm
from par4_dynamics.model_file import ModelFile
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.evidence import Evidence, gather, spread
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.evidence.whitener import flat_whitener, whitener_of_residuals
from par4_identification.diagnosis.search.rules import rules_for
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

ROUNDS = 2
"""Fits after the first: the noise is measured on what the one before leaves."""
PRIOR = 1e-4
"""Weight, over the norm of a column, with which a function without a name is held to zero."""
ROUNDING = 1e-12
"""Eigenvalue of the scaled normal equations below which data do not tell a parameter."""


@dataclass(frozen=True)
class JointValues:
    """Base parameters of every joint.

    Attributes:
        terms: of the p parameters.
        values: (J, p), in the units of the terms.
        covariance: of the values joint after joint, (J p, J p).
        known: what base parameters would follow of the torque that is known beside them, (J, p): a
            gain scales that torque too.
        bias: by what the values would be off if a cause that is fitted beside them had been
            there before and its torque taken for theirs; a row a cause, (causes, J p).
        vague: by what unnamed causes that are not fitted beside the values move them; a row or
            none, (0 or 1, J p).
        causes: fitted beside the values, each with its coefficients (K, J).
        gains: recorded torque of each joint over its true one, as far as known, (J,), or of all.
    """

    terms: tuple[BaseTerm, ...]
    values: np.ndarray
    covariance: np.ndarray
    known: np.ndarray
    bias: np.ndarray
    vague: np.ndarray
    causes: tuple[tuple[Hypothesis, np.ndarray], ...] = ()
    gains: np.ndarray | float = 1.0

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the values in the order of the covariance, such as 'arm_gravity[2]'."""
        joints = len(self.values)
        return tuple(term.name if joints == 1 else f'{term.name}[{joint}]'
                     for joint in range(joints) for term in self.terms)

    @property
    def std(self) -> np.ndarray:
        """Standard deviations, (J, p)."""
        return np.sqrt(np.diag(self.covariance)).reshape(self.values.shape)


def torque_of_causes(causes: Sequence[tuple[Hypothesis, np.ndarray]], observations: Observations
                     ) -> list[np.ndarray]:
    """Return what causes with their coefficients (K, J) add to the torque (m, J) of each run, N m.
    """
    torque = [np.zeros_like(target) for target in observations.target]
    for cause, coefficients in causes:
        rows = observations.effect_rows(cause.effect, cause.shape)
        torque = [total + np.einsum('mjk,kj->mj', part, coefficients)
                  for total, part in zip(torque, rows)]
    return torque


def fitted_values(observations: Observations, causes: Sequence[Hypothesis] = (),
                  unnamed: Sequence[Hypothesis] = ()) -> JointValues:
    """Return what rows tell of the base parameters of every joint.

    Generalised least squares with the noise of each joint as an autoregression, fitted to what is
    left. No torque is known exactly: an error of the share `Rules.base_error` of the measured
    torque and `Rules.named_error` of that of the causes, spread evenly over the parameters, widens
    the covariance. An axis, which may be any machine, has larger errors than a Par4.

    Args:
        observations: the rows.
        causes: fitted beside the parameters. Those that show only as differences between joints
            are left out, for they are values of the joints here, and so are those that gain
            less than `Rules.evidence` beside the values: viscous friction of one joint may have
            been named a power of its speed.
        unnamed: causes that are not fitted beside the parameters, as functions so free would take
            what changed for theirs. By how much the parameters would be others beside them is told
            (`JointValues.vague`).

    Raises:
        InputError: data that do not tell the parameters joint by joint.
    """
    causes = [cause for cause in causes
              if isinstance(cause.effect, Kind) or not cause.effect.against_the_others]
    evidence = whitened(observations, causes)
    causes = _worth(evidence, causes)
    design = _design(evidence, causes)
    values, covariance = _solved(design, evidence.target, observations)
    size = observations.joints * len(observations.terms)
    torque = evidence.whitened([run.tau for run in observations.runs])
    by_causes = design[:, size:] @ values[size:]
    rules = rules_for(observations.of_axis)
    wrong = rules.base_error ** 2 * (torque @ torque) + rules.named_error ** 2 * (
        by_causes @ by_causes)
    shape = (observations.joints, len(observations.terms))
    own = covariance[:size, :size]
    known = evidence.whitened([run.tau - target for run, target in zip(
        observations.runs, observations.target)])
    followed = _solved(design[:, :size], known, observations)[0] if known.any() else np.zeros(size)
    return JointValues(
        observations.terms, values[:size].reshape(shape), (1.0 + wrong / size) * own,
        followed.reshape(shape), _bias(design, values, size, causes, observations),
        _moved_by(evidence, design, unnamed, values, size),
        _coefficients(observations, causes, values[size:]))


def _moved_by(evidence: Evidence, design: np.ndarray, unnamed: Sequence[Hypothesis],
              values: np.ndarray, size: int) -> np.ndarray:
    """Return by how much `size` values are others than beside unnamed causes, (0 or 1, size).

    What a function without a name and the values can both follow, the values do.
    """
    if not unnamed:
        return np.zeros((0, size))
    both = np.hstack([design, *(evidence.columns(item) for item in unnamed)])
    scale = np.maximum(np.linalg.norm(both, axis=0), 1e-30)
    prior = np.diag(np.where(np.arange(both.shape[1]) < design.shape[1], 0.0, PRIOR))
    found = np.linalg.lstsq(np.vstack([both / scale, prior]), np.concatenate(
        [evidence.target, np.zeros(len(prior))]), rcond=None)[0] / scale
    return (values - found[:len(values)])[None, :size]


def whitened(observations: Observations, causes: Sequence[Hypothesis] = ()) -> Evidence:
    """Return rows whitened by the noise that causes and values of every joint leave.

    Raises:
        InputError: data that do not tell the parameters joint by joint.
    """
    evidence = gather(observations, flat_whitener(observations, np.ones(observations.joints)))
    for _ in range(ROUNDS):
        design = _design(evidence, causes)
        values, _ = _solved(design, evidence.target, observations)
        size = observations.joints * len(observations.terms)
        left = _residuals(observations, values[:size].reshape(observations.joints, -1),
                          _coefficients(observations, causes, values[size:]))
        if observations.steady:  # rows that do not follow one another in time
            sigma = np.sqrt(sum(np.sum(np.where(run.valid, part, 0.0) ** 2, axis=0) for run, part in
                                zip(observations.runs, left))
                            / max(sum(int(run.valid.sum()) for run in observations.runs)
                                  - design.shape[1], 1))
            return gather(observations, flat_whitener(observations, np.maximum(sigma, 1e-30)))
        evidence = gather(observations, whitener_of_residuals(observations, left, design.shape[1]))
    return evidence


def _design(evidence: Evidence, causes: Sequence[Hypothesis]) -> np.ndarray:
    """Return the whitened base columns of each joint by itself, then those of the causes."""
    blocks = [evidence.base[first:last] for first, last in zip(evidence.ends, evidence.ends[1:])]
    own = spread(blocks, tuple(range(len(blocks))), shared=False)
    return np.hstack([own, *(evidence.columns(cause) for cause in causes)])


def _worth(evidence: Evidence, causes: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the causes without those that gain too little beside values and the others."""
    kept = list(causes)
    while kept:
        squares = [_left(evidence, [other for other in kept if other is not item])
                   for item in (None, *kept)]
        gains = [0.5 * (left - squares[0]) for left in squares[1:]]
        weakest = int(np.argmin(gains))
        if gains[weakest] > rules_for(evidence.observations.of_axis).evidence:
            break
        kept.pop(weakest)
    return kept


def _left(evidence: Evidence, causes: Sequence[Hypothesis]) -> float:
    """Return the whitened squares that values and causes leave."""
    design = _design(evidence, causes)
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
    values = np.linalg.lstsq(design / scale, evidence.target, rcond=1e-10)[0]
    left = evidence.target - (design / scale) @ values
    return float(left @ left)


def _solved(design: np.ndarray, target: np.ndarray, observations: Observations
            ) -> tuple[np.ndarray, np.ndarray]:
    """Return least-squares values and the inverse of the normal equations."""
    scale = np.linalg.norm(design, axis=0)
    if not np.all(scale > 0.0):
        raise InputError(f'{observations.runs[0].name}: not every joint moves; record a richer '
                         f'motion')
    scaled = design / scale
    gram = scaled.T @ scaled
    lowest = float(np.linalg.eigvalsh(gram)[0])
    if lowest < ROUNDING * len(gram):
        raise InputError(f'{observations.runs[0].name}: the motion does not tell the parameters of '
                         f'each joint apart; record a richer motion')
    inverse = np.linalg.inv(gram)
    return (inverse @ (scaled.T @ target)) / scale, inverse / np.outer(scale, scale)


def torque_left(observations: Observations, found: JointValues) -> list[np.ndarray]:
    """Return the measured torque minus that of values and causes, (m, J) of each run, N m."""
    return _residuals(observations, found.values, found.causes)


def _residuals(observations: Observations, values: np.ndarray,
               causes: Sequence[tuple[Hypothesis, np.ndarray]]) -> list[np.ndarray]:
    beside = torque_of_causes(causes, observations)
    return [target - torque - np.einsum('mjp,jp->mj', base, values)
            for target, torque, base in zip(observations.target, beside, observations.base)]


def _coefficients(observations: Observations, causes: Sequence[Hypothesis], values: np.ndarray
                  ) -> tuple[tuple[Hypothesis, np.ndarray], ...]:
    """Return each cause with its coefficients (K, J), zero on joints it does not act on."""
    found, first = [], 0
    for cause in causes:
        rows = observations.effect_rows(cause.effect, cause.shape)[0].shape[2]
        part = values[first:first + _width(observations, cause)]
        full = np.zeros((rows, observations.joints))
        if cause.effect.shared:
            full[cause.columns] = part[:, None]
        else:
            full[:, list(cause.joints)] = part.reshape(-1, rows).T
        found.append((cause, full))
        first += len(part)
    return tuple(found)


def _bias(design: np.ndarray, values: np.ndarray, size: int, causes: Sequence[Hypothesis],
          observations: Observations) -> np.ndarray:
    """Return what the base parameters follow of the torque of each cause, (causes, J p)."""
    found, first = np.zeros((len(causes), size)), size
    for index, cause in enumerate(causes):
        width = _width(observations, cause)
        part = slice(first, first + width)
        found[index] = _solved(design[:, :size], design[:, part] @ values[part], observations)[0]
        first = part.stop
    return found


def _width(observations: Observations, cause: Hypothesis) -> int:
    whole = observations.effect_rows(cause.effect, cause.shape)[0].shape[2]
    return cause.width(whole) * (1 if cause.effect.shared else len(cause.joints))


def values_of_model(model_file: ModelFile, machine: Robot | Axis,
                    terms: Sequence[BaseTerm] = BASE_TERMS) -> JointValues:
    """Return the base parameters of a model as values of every joint.

    A model file gives standard deviations without correlations; what is one number for all joints
    errs alike on all of them.

    Args:
        model_file: of the machine.
        machine: which it is.
        terms: of the parameters; those that the model of an axis does not have are zero.
    """
    joints, terms = len(machine.joint_names), tuple(terms)
    size = len(terms)
    values, covariance = np.zeros((joints, size)), np.zeros((joints * size, joints * size))
    for index, term in enumerate(terms):
        parameter = model_file.parameters.get(term.name, Parameter(value=0.0))
        values[:, index] = parameter.per_joint(joints)
        std = np.broadcast_to(np.asarray(parameter.std or 0.0, dtype=float), (joints,))
        places = np.arange(joints) * size + index
        together = not isinstance(parameter.value, tuple)
        covariance[np.ix_(places, places)] = (np.outer(std, std) if together
                                              else np.diag(std ** 2))
    return JointValues(terms, values, covariance, np.zeros_like(values),
                       np.zeros((0, joints * size)), np.zeros((0, joints * size)))
