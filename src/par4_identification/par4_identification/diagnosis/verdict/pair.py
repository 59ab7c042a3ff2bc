"""Two explanations of the same data, between which a motion may decide."""

from __future__ import annotations

from dataclasses import dataclass

from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind

NOTHING = 'no cause at all'
"""Name of no cause at all."""


@dataclass(frozen=True)
class Pair:
    """Two explanations in a model, beside the same other causes.

    Attributes:
        first: a named or unnamed cause at its best shape.
        second: what else it may be; None for nothing at all.
        others: the other causes.
        twins: whether either may be true. Otherwise only the first counts as true: an unnamed
            cause can be anything that a name is, and a name can always be left out.
    """

    first: Hypothesis
    second: Hypothesis | None
    others: tuple[Hypothesis, ...]
    twins: bool = True

    @property
    def names(self) -> tuple[str, str]:
        """Names of the effects, or in words what an unnamed cause acts like."""
        return name_of(self.first), name_of(self.second)


def name_of(hypothesis: Hypothesis | None) -> str:
    """Return the name of an effect, or in words what an unnamed cause acts like."""
    if hypothesis is None:
        return NOTHING
    effect = hypothesis.effect
    return effect.phrase if isinstance(effect, Kind) else effect.name
