"""Parameters of a named effect from fitted coefficients, with standard deviations."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Shape, Values
from par4_dynamics.parameters import Number, Parameter
from par4_identification.diagnosis.evidence.evidence import Evidence, Fit, Hypothesis

SLOPE = 1e-3
"""Change of a shape, over its size, from which the slope of its torque is computed."""


def effect_parameters(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int,
                      inflation: float = 1.0) -> dict[str, Parameter]:
    """Return the parameters of hypothesis number `index` of a fit, as files have them.

    One number for a parameter of the machine, else one for each joint of the hypothesis; a vector
    for a parameter that has several numbers. See `estimated` for the arguments.
    """
    values, stds = estimated(evidence, hypothesis, fit, index, inflation)
    result = {}
    for parameter in hypothesis.effect.parameters:
        value, std = values[parameter.name], stds[parameter.name]
        single = parameter.scope == 'machine' and parameter.size == 1
        result[parameter.name] = Parameter(value=_numbers(value, parameter.per_order, single),
                                           std=_numbers(std, parameter.per_order, single),
                                           unit=parameter.unit)
    return result


def estimated(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int,
              inflation: float = 1.0) -> tuple[Values, Values]:
    """Return the values of the parameters of hypothesis number `index` and their deviations.

    The standard deviations are those of coefficients and shape together: an error of the shape
    moves the coefficients, and so does one of the other columns. They follow by finite differences
    of `Effect.values`.

    Args:
        evidence: rows that were fitted.
        hypothesis: the cause.
        fit: of all causes.
        index: of this one.
        inflation: of the variances, by what the model may get wrong (`Requirement.inflation`).

    Returns:
        Two of the shapes that `Effect.values` gives for the joints of the hypothesis.
    """
    effect, shape = hypothesis.effect, hypothesis.shape
    acting = list(range(evidence.observations.joints) if effect.shared else hypothesis.joints)
    coefficients = fit.coefficients[index][:, acting]
    knobs = _knobs(hypothesis)
    covariance = inflation * _with_shapes(evidence, hypothesis, fit, index, knobs)
    values = effect.values(coefficients, shape)
    slopes = {name: np.zeros((len(covariance), *np.shape(value)))
              for name, value in values.items()}
    own = len(covariance) - len(knobs)
    for number in range(len(covariance)):
        step = SLOPE * max(float(np.sqrt(covariance[number, number])), 1e-12)
        moved, other = coefficients.copy(), shape
        if number >= own:
            other = _turned(shape, knobs[number - own], step)
        elif effect.shared:
            moved[number] += step
        else:
            joint, row = divmod(number, len(coefficients))
            moved[row, joint] += step
        for name, value in effect.values(moved, other).items():
            slopes[name][number] = (value - values[name]) / step
    return values, {name: np.sqrt(np.maximum(
        np.einsum('c...,cd,d...->...', slope, covariance, slope), 0.0))
        for name, slope in slopes.items()}


def _numbers(value: np.ndarray, per_order: bool, single: bool) -> Number:
    """Return values (J,), or (J, K) of K orders, as a parameter has them."""
    if per_order and value.ndim == 2:
        return tuple(_numbers(part, False, single or len(part) == 1) for part in value.T)
    return float(value[0]) if single else tuple(map(float, value))


def _knobs(hypothesis: Hypothesis) -> list[tuple[str, int | None]]:
    """Return the numbers of a shape: parameter, and which of its orders where it has several."""
    knobs: list[tuple[str, int | None]] = []
    for item in hypothesis.effect.parameters:
        value = hypothesis.shape.get(item.name)
        if isinstance(value, tuple):
            knobs += [(item.name, index) for index in range(len(value))]
        elif value is not None:
            knobs.append((item.name, None))
    return knobs


def _turned(shape: Shape, knob: tuple[str, int | None], step: float) -> Shape:
    """Return a shape of which one number is larger by a step."""
    name, index = knob
    value = shape[name]
    if index is None:
        return {**shape, name: value + step}
    return {**shape, name: (*value[:index], value[index] + step, *value[index + 1:])}


def _with_shapes(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int,
                 knobs: list[tuple[str, int | None]]) -> np.ndarray:
    """Return the covariance (c, c) of a hypothesis's coefficients and, behind them, its shapes.

    In first order an error d of a shape changes the torque by d times the slope of the columns
    times the coefficients. With C the covariance of everything at a fixed shape, S the slopes'
    moments with all columns and F what the columns leave of the slopes, the shape has the
    covariance F^-1 and the coefficients C + (C S) F^-1 (C S)^T.
    """
    span = fit.slices[index]
    own = fit.covariance[span, span]
    if not knobs:
        return own
    flat = hypothesis.stacked(fit.coefficients[index])
    slopes = []
    for knob in knobs:
        name, index = knob
        value = hypothesis.shape[name]
        step = SLOPE * max(abs(value if index is None else value[index]), 1e-6)
        moved = Hypothesis(hypothesis.effect, _turned(hypothesis.shape, knob, step),
                           hypothesis.joints)
        slopes.append((evidence.columns(moved) - evidence.columns(hypothesis)) @ flat / step)
    slope = np.stack(slopes, axis=1)
    shift = fit.covariance @ (evidence.design(fit.hypotheses).T @ slope)
    left = slope.T @ slope - (evidence.design(fit.hypotheses).T @ slope).T @ shift
    shapes = np.linalg.pinv(left, rcond=1e-9, hermitian=True)
    cross = -shift[span] @ shapes
    return np.block([[own + shift[span] @ shapes @ shift[span].T, cross], [cross.T, shapes]])
