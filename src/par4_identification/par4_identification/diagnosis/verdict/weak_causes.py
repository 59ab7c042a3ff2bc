"""Standard deviations that allow for weak causes, which have too little evidence for a name.

The values of causes are right if nothing else acts on the machine. On most machines more does:
effects that gain more than their numbers would by chance (Akaike), and less than a name needs. The
values with one of these in the model are as good as the told ones, and the truth lies anywhere
between. So the variance grows by a third of the square of the difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from par4_identification.diagnosis.evidence.doubt import with_doubt
from par4_identification.diagnosis.evidence.estimates import told_values
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.candidates import price_of_shapes
from par4_identification.diagnosis.search.causes import Hypotheses, named_of, names_of
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.simplicity import BY_CHANCE
from par4_identification.diagnosis.verdict.answer import Cause

SHARE = 3.0 ** -0.5
"""Root of the mean square of what is as likely as anything between 0 and 1."""


def weak_causes(search: Search, model: Hypotheses) -> list[Hypothesis]:
    """Return the effects that may act beside a model, although they are not named in it.

    A machine can have them, and they gain more than chance gives to so many numbers and to the best
    of so many shapes. The list is empty if the model has no name. A lag beside a delay is none of
    them: both are the same torque but for what the twin's margin tells, and either can stand for
    any part of the other.
    """
    found: list[Hypothesis] = []
    if not named_of(model):
        return found
    retimed = any(cause.named.retimes for cause in named_of(model))
    for item in search.candidates.all_of(search.weighing.beside(model), set(names_of(model)),
                                         wanted=0.0):
        hypothesis = item.hypothesis
        by_chance = BY_CHANCE * search.pool.numbers(hypothesis) + price_of_shapes(item)
        if (item.gain > by_chance and not (retimed and hypothesis.named.retimes)
                and search.belief.objection(hypothesis, model) is None
                and search.weighing.sound_gains(hypothesis, model)[0] > by_chance):
            found.append(hypothesis)
    return found


def widened(search: Search, cause: Cause, hypothesis: Hypothesis, model: Hypotheses,
            weak: Sequence[Hypothesis]) -> Cause:
    """Return a cause with deviations that include what each weak cause would change.

    Weak causes change how large a cause is, not whether it is one, so it keeps its name.

    Args:
        search: of the causes.
        cause: with its values beside the others of the model.
        hypothesis: of this cause.
        model: all that were fitted together.
        weak: see `weak_causes`.
    """
    parameters = cause.parameters
    for item in weak:
        fit = search.weighing.corrected(search.pool.solution((*model, item)))
        parameters = with_doubt(parameters, told_values(
            search.pool.evidence, hypothesis, fit, model.index(hypothesis)), SHARE)
    return replace(cause, parameters=parameters)
