"""The causes that a model has beside its base terms."""

from __future__ import annotations

from collections.abc import Sequence

from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind

Hypotheses = tuple[Hypothesis, ...]
"""What a model has beside its base terms: causes, named and unnamed."""


def names_of(model: Sequence[Hypothesis]) -> frozenset[str]:
    """Return the names of effects and the kinds of unnamed causes in a model."""
    return frozenset(item.effect.name for item in model)


def named_of(model: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the causes with a name."""
    return [item for item in model if not isinstance(item.effect, Kind)]


def unnamed_of(model: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return the causes without a name."""
    return [item for item in model if isinstance(item.effect, Kind)]


def others_of(model: Hypotheses, cause: Hypothesis) -> Hypotheses:
    """Return a model without one of its causes."""
    return tuple(item for item in model if item is not cause)
