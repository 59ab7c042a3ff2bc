"""Which of two explanations is the simpler, where the data do not tell which is the better."""

from __future__ import annotations

from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.pool import Pool

BY_CHANCE = 1.0
"""Log-likelihood that one coefficient gains by chance (Akaike 1974). A smaller difference tells no
two explanations apart."""
DIGITS = 1
"""Of a log-likelihood that are compared; the others may be rounding, which must not decide between
twins."""


def simplest_first(pool: Pool, hypothesis: Hypothesis | None, loss: float
                   ) -> tuple[int, int, float, str]:
    """Return a key that sorts explanations by what they are, the simplest first.

    The fewest numbers come first; of equally many, those of the law with the fewest variables; of
    these the best. The name, which comes last, puts in order what nothing else does. Where an
    effect stands in its library does not count.

    Args:
        pool: fits.
        hypothesis: the explanation; None for no cause.
        loss: what it explains less than another, in log-likelihood.
    """
    if hypothesis is None:
        return 0, 0, round(loss, DIGITS), ''
    effect = hypothesis.effect
    return pool.numbers(hypothesis), effect.variables, round(loss, DIGITS), effect.name


def best_first(pool: Pool, hypothesis: Hypothesis | None, loss: float
               ) -> tuple[float, tuple[int, int, float, str]]:
    """Return a key that sorts explanations by their loss, the least first, of equals the simplest.
    """
    return round(loss, DIGITS), simplest_first(pool, hypothesis, loss)
