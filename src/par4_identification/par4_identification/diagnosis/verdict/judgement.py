"""How sure each cause is: its margin over rivals, and its twins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.search.causes import Hypotheses, named_of, others_of
from par4_identification.diagnosis.search.search import Rival, Search
from par4_identification.diagnosis.search.simplicity import best_first
from par4_identification.diagnosis.verdict.pair import Pair, name_of

OWN = 0.5
"""Share of what a name explains without unnamed causes, or another would in its place, from which
on what it explains beside them is its own."""


@dataclass(frozen=True)
class Judgement:
    """A named cause, compared with everything that could explain the data in its place.

    Attributes:
        hypothesis: the cause.
        margin: log-likelihood on held-out rows, over the best rival.
        rival: name of the best rival, or what it acts like; None if the best is no cause at all.
        twins: names that explain the fitted rows as well, or all rows: where rows held out speak
            for a name as much as the fitted ones speak against it, neither is told from the other.
            Beside unnamed causes that explain the same, any name would do as well: then they must
            do so without the unnamed causes, too.
        p_value: of its gain on the fitted rows, family-wise over all effects and shapes.
    """

    hypothesis: Hypothesis
    margin: float
    rival: str | None
    twins: tuple[str, ...]
    p_value: float


@dataclass(frozen=True)
class UnnamedCause:
    """A cause without a name.

    Attributes:
        kind: what it acts like, by name.
        phrase: in words.
        joints: on which it acts.
        torque_rms: rms of its torque on held-out rows, over all joints, N m, without what base
            parameters could have of it: a share of the torque and an inertia have much in common,
            and the data do not say whose it is.
        share: part of the squared error explained by all causes that is lost without it.
        margin: log-likelihood that it gains on held-out rows.
    """

    kind: str
    phrase: str
    joints: tuple[int, ...]
    torque_rms: float
    share: float
    margin: float


def judge(search: Search, cause: Hypothesis, model: Hypotheses) -> Judgement:
    """Return how a named cause of a model compares with its rivals."""
    others = others_of(model, cause)
    rivals = [rival for rival in search.rivals(cause, others) if rival.believable]
    twins = _twins_among(search, cause, rivals)
    if own_share(search, cause, others) < OWN:
        without = _twins_among(search, cause, search.rivals(cause, tuple(named_of(others))))
        twins = tuple(name for name in twins if name in without)
    best = rivals[0]
    gain, _ = search.weighing.gains(cause, others)
    p_value = scipy.special.chdtrc(
        search.pool.numbers(cause), 2.0 * max(gain, 0.0))
    rival = None if best.hypothesis is None else name_of(best.hypothesis)
    return Judgement(cause, best.margin, rival, twins,
                     float(min(1.0, p_value * search.candidates.family)))


def _twins_among(search: Search, cause: Hypothesis, rivals: Sequence[Rival]) -> tuple[str, ...]:
    """Return the names among rivals that explain as much as a cause, or retime as it does."""
    return tuple(
        rival.hypothesis.effect.name for rival in rivals
        if rival.believable
        and rival.hypothesis is not None and not isinstance(rival.hypothesis.effect, Kind)
        and (min(rival.fit_margin, rival.fit_margin + rival.margin) < search.rules.twin
             or (rival.hypothesis.named.retimes and cause.named.retimes)))


def own_share(search: Search, cause: Hypothesis, others: Hypotheses) -> float:
    """Return what a name explains beside others over what it does beside those with a name."""
    alone, gain = (search.weighing.gains(cause, part)[0]
                   for part in (tuple(named_of(others)), others))
    return gain / alone if alone > 0.0 else float(np.inf)


def doubt_of(search: Search, cause: Hypothesis, model: Hypotheses) -> Pair | None:
    """Return an unnamed cause and the name that comes nearest to it; None without any name."""
    others = others_of(model, cause)
    found = search.candidates.all_of(search.weighing.beside(others),
                                     {item.effect.name for item in others})
    best = min(found, key=lambda item: best_first(search.pool, item.hypothesis, -item.gain),
               default=None)
    return None if best is None else Pair(cause, best.hypothesis, others, twins=False)


def unnamed_cause(search: Search, cause: Hypothesis, model: Hypotheses) -> UnnamedCause:
    """Return size, share and margin of an unnamed cause."""
    pool, others = search.pool, others_of(model, cause)
    _, margin = search.weighing.gains(cause, others)
    base, here = pool.fit(()), pool.fit(model)
    explained = base.heldout_squares - here.heldout_squares
    coefficients = solve(pool.evidence, model).coefficients[model.index(cause)]
    torque = _beyond_base(pool, cause, coefficients)
    return UnnamedCause(
        cause.effect.name, cause.effect.phrase, cause.joints,
        float(np.sqrt(np.mean(torque ** 2))) if len(torque) else 0.0,
        share_of(2.0 * margin, explained), margin)


def _beyond_base(pool: Pool, cause: Hypothesis, coefficients: np.ndarray) -> np.ndarray:
    """Return the torque of a cause with coefficients (K, J) on held-out rows, (N,) N m.

    What base parameters could have of it, the same on all rows, is taken off.
    """
    parts = [(np.einsum('mjk,kj->mj', columns, coefficients)[run.valid], base[run.valid])
             for rows in (pool.evidence.observations, pool.heldout.observations)
             for run, columns, base in zip(rows.runs, rows.effect_rows(cause.effect, cause.shape),
                                           rows.base)]
    torque, base = (np.concatenate(some) for some in zip(*parts))
    left = torque - base @ np.linalg.lstsq(base, torque, rcond=None)[0]
    return np.asarray(left[-sum(int(run.valid.sum()) for run in pool.heldout.observations.runs):])


def share_of(own: float, explained: float) -> float:
    """Return a cause's share, 0 to 1, of the squares of held-out rows that all causes explain.

    Where these together explain nothing, it has none.
    """
    return float(np.clip(own / explained, 0.0, 1.0)) if explained > 0.0 else 0.0
