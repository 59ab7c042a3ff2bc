"""How much a cause must gain, so that neither chance nor an error of the model explains it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import Fit
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.search.causes import named_of
from par4_identification.diagnosis.search.rules import OF_PAR4, Rules


@dataclass(frozen=True)
class Requirement:
    """What the gain of a cause in log-likelihood must exceed, beside the causes of a model.

    No torque is known exactly: neither the measured one nor that of a named or of an unnamed cause,
    nor that which the model computes from encoder counts, nor the times at which it was read.
    The covariance of the rows therefore has two parts. One is the measured noise; the other grows
    with the squares of these torques. An error of a torque follows the motion, so that it does not
    average out over rows. However long the log is, such an error can look like a cause that
    explains the same share of the squares.

    Attributes:
        fit: on the fitted rows, if the error of the named causes looks like the cause in question.
        heldout: the same on held-out rows.
        beside_law_error: the same two, if the error of the named causes is fitted beside them.
        by_causes: what the errors of the causes' torques alone may gain on the fitted rows.
        by_error: what the errors of all torques alone may gain on all rows.
        inflation: factor by which the errors of the causes' torques enlarge the variances of fitted
            values.
    """

    fit: float
    heldout: float
    beside_law_error: tuple[float, float]
    by_causes: float
    by_error: float
    inflation: float


def requirement_of(pool: Pool, model: Sequence[Hypothesis], rules: Rules,
                   cause: Hypothesis | None = None) -> Requirement:
    """Return what a cause must gain as one of the causes of a model.

    Args:
        pool: fits.
        model: causes, the one in question among them.
        rules: how much of each torque may be wrong.
        cause: the one in question. If it is a name, the error of the unnamed causes counts by the
            share of its gain that the name loses beside them, because that error resembles what
            they have in common with the name.
    """
    named = named_of(model)
    base, only_named, whole = (pool.fit(part) for part in ((), named, model))
    common = _common(pool, model, cause)
    parts, causes, by_names = [], [], []
    for torque, counted, timing, rows, squares, error in zip(
            pool.torque_squares, pool.counted_squares, pool.timing_squares,
            (pool.evidence.rows, pool.heldout.rows), (
                [fit.fit_squares for fit in (base, only_named, whole)],
                [fit.heldout_squares for fit in (base, only_named, whole)]),
            _errors_of_named(pool, named, rules)):
        by_unnamed = max(squares[1] - squares[2], 0.0)
        by_named = max(squares[0] - squares[2] - by_unnamed, 0.0)
        by_names.append(0.5 * error ** 2 * by_named)
        causes.append(by_names[-1] + 0.5 * (common * rules.unnamed_error) ** 2 * by_unnamed)
        parts.append(causes[-1] + 0.5 * (rules.base_error ** 2 * torque
                                         + rules.unnamed_error ** 2 * counted + timing
                                         + rules.noise_error * rows))
    fit, heldout = rules.evidence + parts[0], rules.margin + parts[1]
    return Requirement(fit, heldout, (fit - by_names[0], heldout - by_names[1]), causes[0],
                       sum(parts), 1.0 + causes[0] / rules.evidence)


def torque_errors(evidence: Evidence, fit: Fit, rules: Rules) -> list[np.ndarray]:
    """Return the torques by which a model may be wrong, on whitened rows, (N,) each.

    There are up to three: the share of the measured torque, of that of the named causes and of that
    of the unnamed causes that `Rules` says may be wrong; of a constant torque, which has no law, it
    is that of a Par4. The rows may be others than were fitted.
    """
    torques = [evidence.columns(item) @ item.stacked(coefficients)
               for item, coefficients in zip(fit.hypotheses, fit.coefficients)]
    kinds = [isinstance(item.effect, Kind) for item in fit.hypotheses]
    measured = evidence.whitened([run.tau for run in evidence.observations.runs])
    wrong = [(error_of(item, rules) if item.named.variables else _without_law(rules)) * torque
             for item, torque, kind in zip(fit.hypotheses, torques, kinds) if not kind]
    parts = ([rules.base_error * measured], wrong,
             [rules.unnamed_error * torque for torque, kind in zip(torques, kinds) if kind])
    return [np.sum(part, axis=0) for part in parts if part]


def error_of(item: Hypothesis, rules: Rules) -> float:
    """Return the share (rms) of the torque of a named cause that may be wrong.

    An axis may have other laws of friction, springs and gaps than the library. A delay or a lag has
    no such law: on any machine it is the torque at another time. So it has the error of a Par4.
    """
    return _without_law(rules) if item.named.retimes else rules.named_error


def _without_law(rules: Rules) -> float:
    """Return the share that may be wrong of a torque that follows no law of the machine."""
    return min(rules.named_error, OF_PAR4.named_error)


def _errors_of_named(pool: Pool, named: Sequence[Hypothesis], rules: Rules) -> tuple[float, ...]:
    """Return the share (rms) that may be wrong of all that names explain, fitted and held out.

    Each name counts by what it explains beside the others.
    """
    errors = np.array([error_of(item, rules) for item in named])
    if len(set(errors)) < 2:
        error = float(errors[0]) if len(errors) else rules.named_error
        return error, error
    whole = np.array(pool.fit(named).squares)
    own = np.array([np.maximum(pool.fit([other for other in named if other is not item]).squares
                               - whole, 1e-30) for item in named])
    return tuple(map(float, np.sqrt(errors ** 2 @ own / own.sum(axis=0))))


def _common(pool: Pool, model: Sequence[Hypothesis], cause: Hypothesis | None) -> float:
    """Return the share of what a name explains that it loses beside the unnamed causes."""
    if cause is None or isinstance(cause.effect, Kind):
        return 1.0
    others = [item for item in model if item is not cause]
    names = named_of(others)
    alone, beside = (pool.fit(part).fit_squares - pool.fit([*part, cause]).fit_squares
                     for part in (names, others))
    return float(np.clip(1.0 - beside / max(alone, 1e-30), 0.0, 1.0))
