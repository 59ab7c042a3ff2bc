"""Deviations that also reach to what other readings of the same data say of a cause."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.estimates import effect_parameters
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations


def with_doubt(parameters: dict[str, Parameter], other: dict[str, Parameter]
               ) -> dict[str, Parameter]:
    """Return parameters whose deviations reach to what another fit of the same cause says.

    Beside an unnamed cause the size of a named one depends on which of the two has the torque that
    either could have.
    """
    result = {}
    for name, parameter in parameters.items():
        apart = np.asarray(other[name].value) - np.asarray(parameter.value)
        if name == 'phase':
            apart = np.remainder(apart + np.pi, 2.0 * np.pi) - np.pi
        result[name] = parameter.model_copy(update={
            'std': nested(np.hypot(np.asarray(parameter.std, dtype=float), apart).tolist())})
    return result


def with_doubt_of_time(parameters: dict[str, Parameter], observations: Observations
                       ) -> dict[str, Parameter]:
    """Return the parameters of a periodic torque whose phases hold an unknown delay.

    Of a motion that goes one way at one speed nobody can say when the torque was read: a delay
    turns each phase by order x speed x delay. Positions and torques of one message are read within
    a sample of each other, as likely at any time.
    """
    if not {'phase', 'periods'} <= set(parameters):
        return parameters
    run = max(observations.runs, key=lambda run: len(run.t))
    late = run.period / np.sqrt(3.0)
    speed = float(np.median(np.abs(run.speed[run.valid])))
    phase = parameters['phase']
    std = np.asarray(phase.std, dtype=float)
    orders = np.asarray(parameters['periods'].value, dtype=float)
    turned = np.reshape(orders * speed * late, (-1,) + (1,) * (std.ndim - 1))
    return {**parameters, 'phase': phase.model_copy(update={
        'std': nested(np.hypot(std, turned).tolist())})}


def with_doubt_of_choice(parameters: dict[str, Parameter], evidence: Evidence,
                         hypothesis: Hypothesis, named: Sequence[Hypothesis]
                         ) -> dict[str, Parameter]:
    """Return the parameters of a cause told on some joints or with some of its sets.

    Its values hold if it has no more of them than it needs: the other joints are then alike and the
    other dimensions right. What the data say without this assumption belongs to the deviations.

    Args:
        parameters: of the cause.
        evidence: rows that were fitted.
        hypothesis: the cause.
        named: all that were fitted together.
    """
    effect = hypothesis.named
    joints = tuple(range(evidence.observations.joints))
    rest = [joint for joint in joints if joint not in hypothesis.joints]
    if effect.against_the_others and rest:
        whole = replace(hypothesis, joints=joints)
    elif hypothesis.sets is not None and not hypothesis.shape:
        whole = replace(hypothesis, sets=None, joints=joints)
    else:
        return parameters
    index = list(named).index(hypothesis)
    together = [*named[:index], whole, *named[index + 1:]]
    free = effect_parameters(evidence, whole, solve(evidence, together), index)
    told = {}
    for name, parameter in parameters.items():
        values = np.asarray(free[name].value, dtype=float)
        if effect.against_the_others:
            values = values - values[rest].mean()
        if values.shape != np.shape(parameter.value):
            values = values[list(hypothesis.joints)]
        told[name] = parameter.model_copy(update={'value': nested(values.tolist())})
    return with_doubt(parameters, told)


def nested(values: Any) -> Any:
    """Return lists of lists as tuples of tuples."""
    return tuple(map(nested, values)) if isinstance(values, list) else values
