"""Deviations that hold which law of a cause is true, where the data do not tell.

A cause may follow one of several laws: Stribeck friction dies away as a Gaussian or as an
exponential of the speed. The same rows then give each law a velocity of its own, and the deviation
that least squares computes for one law knows nothing of the others. Model averaging does (Draper
1995; Buckland, Burnham and Augustin 1997): laws of as many free numbers, likely alike beforehand,
weigh as their likelihoods, and the variance about the told value is the mean over the laws of the
squared deviation and of the squared distance of what each says.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.doubt import nested
from par4_identification.diagnosis.evidence.estimates import effect_parameters
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.causes import Model, others_of
from par4_identification.diagnosis.search.polish import polished_alone
from par4_identification.diagnosis.search.search import Search


def with_doubt_of_law(parameters: dict[str, Parameter], search: Search, cause: Hypothesis,
                      model: Model, errors: Sequence[np.ndarray]) -> dict[str, Parameter]:
    """Return the parameters of a cause with deviations that hold the choice of its law.

    Args:
        parameters: as told, by the law of the cause.
        search: of the causes.
        cause: one of the model.
        model: all causes.
        errors: torques by which the model may be wrong, see `torque_errors`. What they can make
            of a likelihood tells no laws apart (`Requirement.inflation`).
    """
    others, pool = others_of(model, cause), search.pool
    laws = [polished_alone(search, item, others) for item in search.candidates.by_other_laws(
        cause, search.weighing.beside(others))]
    laws = [item for item in laws if search.belief.objection(item, others) is None]
    if not laws:
        return parameters
    weighing = search.weighing
    gains = np.array([weighing.gains(item, others)[0] for item in (cause, *laws)])
    weights = np.exp((gains - gains.max()) / weighing.requirement(model, cause).inflation)
    weights /= weights.sum()
    told = [effect_parameters(
        pool.evidence, item, weighing.corrected(pool.solution((*others, item))), len(others),
        errors) for item in laws]
    return {name: parameter.model_copy(update={'std': _spread(
        parameter, [other[name] for other in told], weights)})
        for name, parameter in parameters.items()}


def _spread(own: Parameter, others: Sequence[Parameter], weights: np.ndarray) -> object:
    """Return the deviation of a value over laws of these weights, the first its own."""
    value = np.asarray(own.value, dtype=float)
    squares = sum(weight * (np.asarray(item.std, dtype=float) ** 2
                            + (np.asarray(item.value, dtype=float) - value) ** 2)
                  for weight, item in zip(weights, (own, *others)))
    return nested(np.sqrt(squares).tolist())
