"""Standard deviations that allow for other explanations of the same data."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.estimates import effect_parameters, fixed_sizes
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import Fit, solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.signals.run import longest_motion


def with_doubt(parameters: dict[str, Parameter], other: dict[str, Parameter], share: float = 1.0
               ) -> dict[str, Parameter]:
    """Return parameters whose deviations include the difference to another fit of the same cause.

    Beside an unnamed cause, for example, the size of a named one depends on which of the two gets
    the torque that both could have.

    Args:
        parameters: as told.
        other: of the other fit.
        share: part of the difference that counts as a standard deviation.
    """
    result = {}
    for name, parameter in parameters.items():
        apart = share * distance(name, other[name], parameter)
        result[name] = parameter.model_copy(update={
            'std': nested(np.hypot(np.asarray(parameter.std, dtype=float), apart).tolist())})
    return result


def with_doubt_of_time(parameters: dict[str, Parameter], observations: Observations
                       ) -> dict[str, Parameter]:
    """Return the parameters of a periodic torque with phases that allow for an unknown delay.

    A motion that goes one way at one speed does not show when the torque was read: a delay
    turns each phase by order x speed x delay. Positions and torques of one message are read within
    a sample of each other, as likely at any time.
    """
    if not {'phase', 'periods'} <= set(parameters):
        return parameters
    run = longest_motion(observations.runs)
    late = run.period / np.sqrt(3.0)
    speed = float(np.median(np.abs(run.speed[run.valid])))
    phase = parameters['phase']
    std = np.asarray(phase.std, dtype=float)
    orders = np.asarray(parameters['periods'].value, dtype=float)
    turned = np.reshape(orders * speed * late, (-1,) + (1,) * (std.ndim - 1))
    return {**parameters, 'phase': phase.model_copy(update={
        'std': nested(np.hypot(std, turned).tolist())})}


def with_doubt_of_choice(parameters: dict[str, Parameter], evidence: Evidence,
                         hypothesis: Hypothesis, model: Sequence[Hypothesis],
                         corrected: Callable[[Fit], Fit]) -> dict[str, Parameter]:
    """Return the parameters of a cause with deviations that allow for other joints and parts.

    The values are right if no cause acts on more joints, or has more parts, than the search gave
    it: the other joints are then alike and the other dimensions right. What the data say without
    this assumption is added to the deviations.

    Args:
        parameters: of the cause.
        evidence: rows that were fitted.
        hypothesis: the cause.
        model: all that were fitted together.
        corrected: takes out of a fit what is known to be wrong with it.
    """
    effect = hypothesis.named
    joints = tuple(range(evidence.observations.joints))
    together = [_whole(item, joints) for item in model]
    if all(item is whole for item, whole in zip(model, together)):
        return parameters
    index = list(model).index(hypothesis)
    rest = [joint for joint in joints if joint not in hypothesis.joints]
    free = effect_parameters(evidence, together[index], corrected(solve(evidence, together)),
                             index)
    told = {}
    for name, parameter in parameters.items():
        values = np.asarray(free[name].value, dtype=float)
        if effect.against_the_others and rest:
            values = values - values[rest].mean()
        if values.shape != np.shape(parameter.value):  # the last axis has the joints
            values = values[..., list(hypothesis.joints)].reshape(np.shape(parameter.value))
        told[name] = parameter.model_copy(update={'value': nested(values.tolist())})
    return with_doubt(parameters, told)


def _whole(hypothesis: Hypothesis, joints: tuple[int, ...]) -> Hypothesis:
    """Return a cause on all joints and with all its sets; itself where it has them."""
    if not hypothesis.effect.shared:
        return hypothesis if hypothesis.joints == joints else replace(hypothesis, joints=joints)
    if hypothesis.sets is None or hypothesis.shape:
        return hypothesis
    return replace(hypothesis, sets=None, joints=joints)


def with_doubt_of_size(parameters: dict[str, Parameter], evidence: Evidence,
                       hypothesis: Hypothesis, fit: Fit) -> dict[str, Parameter]:
    """Return the parameters of an effect with fixed coefficients, with deviations for their error.

    On a machine that obeys the law these coefficients are 1. How far they are from 1 shows by which
    share the law, and so its parameters, may be wrong.
    """
    if not hypothesis.named.fixed_coefficients:
        return parameters
    index = fit.hypotheses.index(hypothesis)
    variance = np.mean(np.diag(fit.covariance)[fit.slices[index]])
    squares = np.mean((fixed_sizes(evidence, hypothesis, fit, index) - 1.0) ** 2)
    wrong = np.sqrt(max(float(squares - variance), 0.0))
    return {name: parameter.model_copy(update={'std': nested(np.hypot(
        np.asarray(parameter.std, dtype=float),
        wrong * np.asarray(parameter.value, dtype=float)).tolist())})
        for name, parameter in parameters.items()}


def nested(values: Any) -> Any:
    """Return lists of lists as tuples of tuples."""
    return tuple(map(nested, values)) if isinstance(values, list) else values


def distance(name: str, one: Parameter, other: Parameter) -> np.ndarray:
    """Return the difference of two values of a parameter; phases differ by half a turn at most."""
    apart = np.asarray(one.value, dtype=float) - np.asarray(other.value, dtype=float)
    return np.remainder(apart + np.pi, 2.0 * np.pi) - np.pi if name == 'phase' else apart
