"""Standard deviations that allow for the choice among laws that the data do not tell apart.

A cause may follow one of several laws: Stribeck friction dies away as a Gaussian or as an
exponential of the speed. The same rows then give each law a velocity of its own, and the deviation
that least squares computes for one law knows nothing of the others. Model averaging does (Draper
1995; Buckland, Burnham and Augustin 1997): laws with equally many free numbers and equal prior
probability weigh as their likelihoods. The variance about the told value is the weighted mean, over
the laws, of the squared deviation plus the squared distance of the law's value from the told one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.doubt import nested
from par4_identification.diagnosis.evidence.estimates import effect_parameters
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.causes import Hypotheses, others_of
from par4_identification.diagnosis.search.polish import polished_alone
from par4_identification.diagnosis.search.search import Search


def with_doubt_of_law(parameters: dict[str, Parameter], search: Search, cause: Hypothesis,
                      model: Hypotheses, errors: Sequence[np.ndarray]) -> dict[str, Parameter]:
    """Return the parameters of a cause with deviations that allow for the choice of its law.

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
