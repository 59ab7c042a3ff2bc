"""Parameters of a named effect from fitted coefficients, with standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.effects.effect import EffectParameter, Shape, Values
from par4_dynamics.parameters import Number, Parameter, PerJoint
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import Fit
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind

LASTING = 4.0
"""Time for which a torque is wrong in the same way, s."""
SLOPE = 1e-3
"""Change of a shape, over its size, from which the slope of its torque is computed."""
FINE = 1e-6
"""The same of an order between whole numbers, which many turns of a joint tell to a small share of
it. Of a whole one the wide step stands for what lies beside its line; it is not in doubt itself."""
IMITATED = 1e-10
"""Share of the squares of a column below which the rest of a fit imitates it."""


def effect_parameters(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int,
                      errors: Sequence[np.ndarray] = ()) -> dict[str, Parameter]:
    """Return the parameters of hypothesis number `index` of a fit, as files have them.

    A parameter of the machine is one number, one of joints has a number for each joint of the
    hypothesis, and a parameter of several numbers is a vector. See `estimated` for the arguments.
    """
    values, stds = estimated(evidence, hypothesis, fit, index, errors=errors)
    return {item.name: Parameter(value=_told(hypothesis, item, values),
                                 std=_told(hypothesis, item, stds), unit=item.unit)
            for item in hypothesis.named.parameters}


def variance_of_shape(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int,
                      errors: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """Return the variance that sizes at unit speed have by that of the shape alone.

    They are as long as the parameters are. See `estimated` for the arguments.
    """
    told = [item for item in hypothesis.named.parameters if item.at_unit_speed]
    if not told:
        return {}
    _, whole = estimated(evidence, hypothesis, fit, index, errors=errors)
    _, known = estimated(evidence, hypothesis, fit, index, errors=errors, knows_shape=True)
    return {item.name: np.maximum(
        np.square(_told(hypothesis, item, whole)) - np.square(_told(hypothesis, item, known)), 0.0)
        for item in told}


def told_values(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int
                ) -> dict[str, Parameter]:
    """Return the same parameters without standard deviations, which take far longer to compute."""
    values = hypothesis.named.values(
        fit.coefficients[index][:, _acting(evidence, hypothesis)], hypothesis.shape)
    return {item.name: Parameter(value=_told(hypothesis, item, values), unit=item.unit)
            for item in hypothesis.named.parameters}


def estimated(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int,
              inflation: float = 1.0, errors: Sequence[np.ndarray] = (), knows_shape: bool = False
              ) -> tuple[Values, Values]:
    """Return the values of the parameters of hypothesis number `index` and their deviations.

    The standard deviations follow from the covariance of coefficients and shape together, because
    an error of the shape moves the coefficients, as an error of any other column does. They are
    computed with finite differences of `Effect.values`.

    Args:
        evidence: rows that were fitted.
        hypothesis: the cause.
        fit: of all causes.
        index: of this one.
        inflation: factor of the variances for the errors of the model (`Requirement.inflation`): a
            bound that needs no rows.
        errors: torques by which the model may be wrong, see `torque_errors`; their part of the
            covariance is computed from the rows.
        knows_shape: whether the shape counts as exact.

    Returns:
        values and standard deviations, as `Effect.values` gives them, for the joints of the
        hypothesis, or for all joints if they share the coefficients.
    """
    effect, shape = hypothesis.named, hypothesis.shape
    coefficients = fit.coefficients[index][:, _acting(evidence, hypothesis)]
    knobs = [] if knows_shape else shape_knobs(hypothesis)
    rows = np.arange(len(coefficients))[hypothesis.columns]
    covariance = inflation * _covariance(evidence, hypothesis, fit, index, knobs, errors)
    values = effect.values(coefficients, shape)
    slopes = {name: np.zeros((len(covariance), *np.shape(value)))
              for name, value in values.items()}
    own = len(covariance) - len(knobs)
    for number in range(len(covariance)):
        step = SLOPE * max(float(np.sqrt(covariance[number, number])), 1e-12)
        moved, other = coefficients.copy(), shape
        if number >= own:
            other = turned(shape, knobs[number - own], step)
        elif effect.shared:
            moved[rows[number]] += step
        else:
            joint, row = divmod(number, len(coefficients))
            moved[row, joint] += step
        for name, value in effect.values(moved, other).items():
            slopes[name][number] = (value - values[name]) / step
    return values, {name: np.sqrt(np.maximum(
        np.einsum('c...,cd,d...->...', slope, covariance, slope), 0.0))
        for name, slope in slopes.items()}


def fixed_sizes(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int) -> np.ndarray:
    """Return the fitted coefficients (K, k), on its k joints, of an effect with fixed coefficients.

    The columns contain the nominal friction, so the coefficients are given relative to the refitted
    friction: 1 if the law holds.
    """
    observations, acting = evidence.observations, _acting(evidence, hypothesis)
    nominal = observations.runs[0].state.known.values['coulomb_friction'][acting]
    refitted, = (value for term, value in zip(observations.terms, fit.base)
                 if term.name == 'coulomb_friction')
    return np.asarray(fit.coefficients[index][:, acting] * nominal / refitted)


def _acting(evidence: Evidence, hypothesis: Hypothesis) -> list[int]:
    """Return the joints whose coefficients a hypothesis has."""
    return list(range(evidence.observations.joints) if hypothesis.effect.shared
                else hypothesis.joints)


def _told(hypothesis: Hypothesis, item: EffectParameter, values: Values) -> Number:
    """Return the numbers of a parameter for the joints of a hypothesis, as files have them."""
    value = values[item.name]
    if hypothesis.effect.shared and item.scope == 'joint':
        value = value[list(hypothesis.joints)]
    return _numbers(value, item.per_order, item.scope == 'machine' and item.size == 1)


def _numbers(value: np.ndarray, per_order: bool, single: bool) -> Number:
    """Return values (J,), or (J, K) of K orders, as a parameter has them."""
    if per_order and value.ndim == 2:
        return tuple(_of_joints(part, single or len(part) == 1) for part in value.T)
    return _of_joints(value, single)


def _of_joints(value: np.ndarray, single: bool) -> PerJoint:
    return float(value[0]) if single else tuple(map(float, value))


Knob = tuple[str, int | None]
"""A number of a shape: the parameter, and which of its orders where it has several."""


def shape_knobs(hypothesis: Hypothesis) -> list[Knob]:
    """Return the numbers of a shape."""
    knobs: list[Knob] = []
    for item in hypothesis.named.parameters:
        value = hypothesis.shape.get(item.name)
        if isinstance(value, tuple):
            knobs += [(item.name, index) for index in range(len(value))]
        elif value is not None:
            knobs.append((item.name, None))
    return knobs


def turned(shape: Shape, knob: Knob, step: float) -> Shape:
    """Return a shape of which one number is larger by a step."""
    name, index = knob
    value = shape[name]
    if not isinstance(value, tuple):
        return {**shape, name: value + step}
    return {**shape, name: tuple(own + step * (number == index)
                                 for number, own in enumerate(value))}


def deviations_of_base(evidence: Evidence, fit: Fit, errors: Sequence[np.ndarray]) -> np.ndarray:
    """Return the standard deviations (p,) of the base parameters of a fit.

    Shapes of the causes, and what the model may get wrong, are in doubt as they are for the values
    of the causes.

    Args:
        evidence: rows that were fitted.
        fit: of all causes.
        errors: torques by which the model may be wrong, see `torque_errors`.
    """
    slopes = [shape_slopes(evidence, item, coefficients, knobs)
              for item, coefficients in zip(fit.hypotheses, fit.coefficients)
              if not isinstance(item.effect, Kind) and (knobs := shape_knobs(item))]
    found = _with_slopes(evidence, fit, slopes, errors, slice(0, len(fit.base)))
    return np.sqrt(np.maximum(np.diag(found)[:len(fit.base)], 0.0))


def _covariance(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int,
                knobs: Sequence[Knob], errors: Sequence[np.ndarray]) -> np.ndarray:
    """Return the covariance (c, c) of a hypothesis's coefficients and, behind them, its shape."""
    slopes = [shape_slopes(evidence, hypothesis, fit.coefficients[index], knobs)] if knobs else []
    return _with_slopes(evidence, fit, slopes, errors, fit.slices[index])


def _with_slopes(evidence: Evidence, fit: Fit, slopes: Sequence[np.ndarray],
                 errors: Sequence[np.ndarray], told: slice) -> np.ndarray:
    """Return the covariance (c, c) of some values of a fit and, behind them, of shapes.

    In first order an error of the shape changes the torque by its slope, which is a column like
    any other. To the covariance C of least squares comes that of the torques that the model gets
    wrong: C (sum over blocks u u^T) C, u = X^T e of a block of rows, since such an error lasts
    for a stretch of the motion and rows that follow each other share it. Last comes what a
    correction of the fitted values may get wrong.

    Args:
        evidence: rows that were fitted.
        fit: of all causes.
        slopes: of the torques by the numbers of shapes, (N, k) each.
        errors: torques by which the model may be wrong.
        told: the values, in the order of the design.
    """
    covariance, count = fit.covariance, len(fit.covariance)
    design = evidence.design(fit.hypotheses) if slopes or len(errors) else np.empty((0, count))
    if slopes:
        covariance = _with_columns(covariance, design, np.hstack(slopes))
        design = np.hstack((design, *slopes))
    own = [*range(told.start, told.stop), *range(count, len(covariance))]
    found = covariance[np.ix_(own, own)]
    starts = _stretches(evidence)
    for error in errors:
        sums = np.add.reduceat(design * error[:, None], starts, axis=0) @ covariance[:, own]
        found += sums.T @ sums
    size = told.stop - told.start
    found[:size, :size] += fit.doubt[told, told]
    return found


def _with_columns(covariance: np.ndarray, design: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Return the covariance of least squares once more columns are fitted beside a design.

    What the design imitates but for `IMITATED` counts as told by so little.

    Args:
        covariance: of the coefficients of the design, (c, c).
        design: (n, c).
        columns: (n, k).
    """
    along = covariance @ (design.T @ columns)
    scale = np.maximum(np.linalg.norm(columns, axis=0), 1e-30)
    left = (columns / scale).T @ ((columns - design @ along) / scale)
    values, vectors = np.linalg.eigh(0.5 * (left + left.T))
    root = vectors / np.sqrt(np.maximum(values, IMITATED)) / scale[:, None]
    own = root @ root.T
    return np.block([[covariance + along @ own @ along.T, -along @ own], [-own @ along.T, own]])


def _stretches(evidence: Evidence) -> np.ndarray:
    """Return the first rows of the stretches of `LASTING` seconds of each joint and run."""
    starts = []
    for first in evidence.ends[:-1]:
        for run in evidence.observations.runs:
            seconds = np.floor((run.t - run.t[0]) / LASTING)
            starts.append(first + np.flatnonzero(np.diff(seconds, prepend=-1.0)))
            first += len(run.t)
    return np.concatenate(starts)


def shape_slopes(evidence: Evidence, hypothesis: Hypothesis, coefficients: np.ndarray,
                 knobs: Sequence[Knob]) -> np.ndarray:
    """Return how the whitened torque of a hypothesis changes with numbers of its shape, (N, k).

    Args:
        evidence: the rows.
        hypothesis: the cause.
        coefficients: its own, (K, J).
        knobs: the numbers.
    """
    flat, slopes = hypothesis.stacked(coefficients), []
    orders = [item.name for item in hypothesis.named.parameters if item.per_order]
    for knob in knobs:
        name, number = knob
        value = float(np.atleast_1d(hypothesis.shape[name])[number or 0])
        share = FINE if name in orders and value != round(value) else SLOPE
        step = share * max(abs(value), 1e-6)
        moved = replace(hypothesis, shape=turned(hypothesis.shape, knob, step))
        slopes.append((evidence.columns(moved) - evidence.columns(hypothesis)) @ flat / step)
    return np.stack(slopes, axis=1)
