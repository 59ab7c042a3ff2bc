"""Parameters of a named effect from fitted coefficients, with standard deviations."""

from __future__ import annotations

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence import Evidence, Fit, Hypothesis, project


def effect_parameters(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int
                      ) -> dict[str, Parameter]:
    """Return the parameters of hypothesis number `index` of a fit.

    Standard deviations by finite differences of `Effect.values`; those of shape parameters from
    the slope of the columns. One number for a parameter of the machine, else one for each joint of
    the hypothesis; a vector for a parameter that has several numbers.
    """
    effect, shape = hypothesis.effect, hypothesis.shape
    acting = list(range(evidence.observations.joints) if effect.shared else hypothesis.joints)
    coefficients = fit.coefficients[index][:, acting]
    covariance = fit.covariance[fit.slices[index], fit.slices[index]]
    values = effect.values(coefficients, shape)
    slopes = {name: np.empty((len(covariance), len(value))) for name, value in values.items()}
    for number in range(len(covariance)):
        step = 1e-3 * max(float(np.sqrt(covariance[number, number])), 1e-12)
        moved = coefficients.copy()
        if effect.shared:
            moved[number] += step
        else:
            joint, row = divmod(number, len(coefficients))
            moved[row, joint] += step
        for name, value in effect.values(moved, shape).items():
            slopes[name][number] = (value - values[name]) / step
    shape_std = _shape_std(evidence, hypothesis, fit, index)
    result = {}
    for parameter in effect.parameters:
        value, slope = values[parameter.name], slopes[parameter.name]
        std = np.sqrt(np.maximum(np.einsum('ci,cd,di->i', slope, covariance, slope), 0.0))
        if parameter.name in shape:
            std = np.full_like(std, shape_std[parameter.name])
        single = parameter.scope == 'machine' and parameter.size == 1
        result[parameter.name] = Parameter(
            value=float(value[0]) if single else tuple(map(float, value)),
            std=float(std[0]) if single else tuple(map(float, std)), unit=parameter.unit)
    return result


def _shape_std(evidence: Evidence, hypothesis: Hypothesis, fit: Fit, index: int
               ) -> dict[str, float]:
    """Return the standard deviation of each shape parameter from the slope of its columns.

    First order: a shape error d changes the torque by d times the columns' derivative times the
    coefficients; what of that the other columns cannot follow carries the information on d.
    """
    result = {}
    if not hypothesis.shape:
        return result
    projection = project(evidence, [hypothesis])
    flat = hypothesis.stacked(fit.coefficients[index])
    for name, value in hypothesis.shape.items():
        step = 1e-3 * max(abs(value), 1e-6)
        moved = Hypothesis(hypothesis.effect, {**hypothesis.shape, name: value + step},
                           hypothesis.joints)
        slope = (evidence.columns(moved) - evidence.columns(hypothesis)) @ flat / step
        result[name] = float(1.0 / max(np.linalg.norm(projection.rest(slope)), 1e-30))
    return result
