"""Standard deviations that allow for the disagreement between held-out and fitted rows.

What a law leaves out depends on the motion, so another motion of the same machine gives other
values. If two estimates lie farther apart than their deviations allow, the deviations are too
small, by the root of the mean square of the differences over their own deviation (Birge 1932).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.doubt import distance, nested
from par4_identification.diagnosis.evidence.estimates import effect_parameters, shape_knobs
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.polish import is_usual, shape_step, stepped
from par4_identification.diagnosis.search.shapes import order_name

LARGEST = 0.5
"""Step of a number of a shape, over the number, that its slope still tells."""


def with_disagreement(parameters: dict[str, Parameter], fitted: dict[str, Parameter],
                      other: dict[str, Parameter]) -> dict[str, Parameter]:
    """Return parameters with deviations enlarged by the disagreement of two estimates.

    Args:
        parameters: whose deviations are enlarged.
        fitted: by least squares on the fitted rows.
        other: by least squares on other rows.
    """
    squares = []
    for name, one in fitted.items():
        apart = distance(name, one, other[name])
        variance = (np.asarray(one.std, dtype=float) ** 2
                    + np.asarray(other[name].std, dtype=float) ** 2)
        told = np.ravel(variance > 0.0) & np.ravel(apart != 0.0)  # not what both share
        squares.append(np.ravel(apart ** 2)[told] / np.ravel(variance)[told])
    ratios = np.concatenate(squares)
    ratio = float(np.sqrt(np.mean(ratios))) if len(ratios) else 1.0
    if ratio <= 1.0:
        return parameters
    return {name: parameter.model_copy(update={
        'std': nested((ratio * np.asarray(parameter.std, dtype=float)).tolist())})
        for name, parameter in parameters.items()}


def parameters_by(evidence: Evidence, hypotheses: Sequence[Hypothesis], index: int,
                  errors: Sequence[np.ndarray] = ()) -> dict[str, Parameter]:
    """Return the parameters of one of several causes by other rows, its shape moved by one step.

    Orders of periodic torques stay whole numbers, and a shape that is told as usual, such as the
    square of a speed, stays as it is.

    Args:
        evidence: the rows.
        hypotheses: all causes, named or not.
        index: of the one.
        errors: torques by which the model may be wrong on these rows.
    """
    hypotheses = list(hypotheses)
    fit = solve(evidence, hypotheses)
    item = hypotheses[index]
    if shape_knobs(item) and order_name(item.named) is None and not is_usual(item):
        hypotheses[index] = stepped(item, shape_step(evidence, fit, index)[0], LARGEST)
        fit = solve(evidence, hypotheses)
    return effect_parameters(evidence, hypotheses[index], fit, index, errors)
