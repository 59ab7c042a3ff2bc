"""How much a cause must gain: chance, and what the model may get wrong of torques it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.diagnosis.evidence.evidence import Hypothesis
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.unnamed import Kind
from par4_identification.diagnosis.search.rules import Rules


@dataclass(frozen=True)
class Requirement:
    """What a gain in log-likelihood must exceed beside a model.

    No torque is known exactly. The rows' covariance has, beside the measured noise, a part that
    grows with the squares of each torque that the model has: of the measured one, of named causes
    and of unnamed ones. Such an error follows the motion and does not average out over rows; of a
    log of any length it may look like a cause that explains that share of the squares.

    Attributes:
        fit: on the rows to fit.
        heldout: on rows that no fit has seen.
        inflation: of the variances of fitted values, by the errors of the causes' torques.
    """

    fit: float
    heldout: float
    inflation: float


def requirement_of(pool: Pool, model: Sequence[Hypothesis], rules: Rules,
                   cause: Hypothesis | None = None) -> Requirement:
    """Return what a cause must gain as one of the causes of a model.

    Args:
        pool: fits.
        model: causes, the one in question among them.
        rules: how much of each torque may be wrong.
        cause: the one in question. What an unnamed cause gets wrong is like what it has in common
            with a name: that much of its error counts as the name loses beside it.
    """
    named = [item for item in model if not isinstance(item.effect, Kind)]
    base, only_named, whole = (pool.fit(part) for part in ((), named, model))
    common = _common(pool, model, cause)
    parts, causes = [], []
    for torque, rows, squares in zip(
            pool.torque_squares, (pool.evidence.rows, pool.heldout.rows), (
                [fit.fit_squares for fit in (base, only_named, whole)],
                [fit.heldout_squares for fit in (base, only_named, whole)])):
        by_unnamed = max(squares[1] - squares[2], 0.0)
        by_named = max(squares[0] - squares[2] - by_unnamed, 0.0)
        causes.append(0.5 * (rules.named_error ** 2 * by_named
                             + (common * rules.unnamed_error) ** 2 * by_unnamed))
        parts.append(causes[-1] + 0.5 * (rules.base_error ** 2 * torque
                                         + rules.noise_error * rows))
    return Requirement(rules.evidence + parts[0], rules.margin + parts[1],
                       1.0 + causes[0] / rules.evidence)


def torque_errors(pool: Pool, named: Sequence[Hypothesis], unnamed: Sequence[Hypothesis],
                  rules: Rules) -> list[np.ndarray]:
    """Return the torques by which a model may be wrong, on the whitened rows to fit, (N,) each.

    They are the shares that `Rules` gives: of the measured torque, of that of the named causes and
    of that of the unnamed ones.
    """
    evidence = pool.evidence
    fit = pool.solution([*named, *unnamed])
    torques = [evidence.columns(item) @ item.stacked(coefficients)
               for item, coefficients in zip(fit.hypotheses, fit.coefficients)]
    count = len(named)
    measured = evidence.whitened([run.tau for run in evidence.observations.runs])
    shares = ((rules.base_error, [measured]), (rules.named_error, torques[:count]),
              (rules.unnamed_error, torques[count:]))
    return [share * sum(parts) for share, parts in shares if parts]


def _common(pool: Pool, model: Sequence[Hypothesis], cause: Hypothesis | None) -> float:
    """Return the share of what a name explains that it loses beside the unnamed causes."""
    if cause is None or isinstance(cause.effect, Kind):
        return 1.0
    names = [item for item in model
             if item is not cause and not isinstance(item.effect, Kind)]
    others = [item for item in model if item is not cause]
    alone, beside = (pool.fit(part).fit_squares - pool.fit([*part, cause]).fit_squares
                     for part in (names, others))
    return float(np.clip(1.0 - beside / max(alone, 1e-30), 0.0, 1.0))
