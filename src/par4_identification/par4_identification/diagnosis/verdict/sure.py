"""Names that are not told because something without a name takes their place.

The motion of a Par4 excites all that its effects have in common with unnamed functions. An axis may
be any machine on any motion, with laws that no library has; the nearest name then explains a part
of what a nameless function explains, and is wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.diagnosis.evidence.evidence import Hypothesis, residuals
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.evidence.unnamed import Kind
from par4_identification.diagnosis.search.search import Model, Rival, Search, named_of, others_of
from par4_identification.diagnosis.verdict.judgement import unnamed_of

BETTER = 100.0
"""Log-likelihood on rows that no fit has seen by which a nameless function in the place of a name
explains more, beyond which the name is wrong. Laws that nearly hold lose some tens to it."""
MOST_LEFT = 0.5
"""Error with the names over that without them, on rows held out, up to which they are told although
what they leave is no noise."""
NO_NOISE = 5.0
"""Error over the white noise of the rows from which on it is no noise."""
MOST = 1.0
"""Change of a cause's coefficients by the unnamed causes beside it, over these, at the most."""


def without_doubtful_names(search: Search, model: Model) -> Model:
    """Return a model without the names in whose place a nameless function explains far more.

    Nor has it names beside unnamed causes that make a torque of another size or sign of them, nor
    any names that together leave most of an error that is no noise.
    """
    if _leaves_most(search, model):
        for item in named_of(model):
            search.journal.reject(item, 'the names together leave most of an error that is no '
                                        'noise')
        kinds = _nameless(search, named_of(model)[0], ())
        return tuple(kind.hypothesis for kind in kinds[:1]) or tuple(unnamed_of(model))
    while True:
        for item in named_of(model):
            trial = _replaced(search, item, model)
            if trial is not None:
                model = trial
                break
        else:
            return model


def _replaced(search: Search, item: Hypothesis, model: Model) -> Model | None:
    """Return the model without one of its names if this is doubtful, else None."""
    others = others_of(model, item)
    best = next(iter(_nameless(search, item, others)), None)
    if best is not None and best.margin < -BETTER:
        search.journal.reject(item, f'{best.hypothesis.effect.phrase} explains '
                                    f'{-best.margin:.0f} more in its place on rows held out')
        return (*others, best.hypothesis)
    if unnamed_of(model):
        named = tuple(named_of(model))
        alone, beside = (
            search.pool.solution(part).coefficients[part.index(item)] for part in (named, model))
        if np.linalg.norm(alone - beside) > MOST * min(map(np.linalg.norm, (alone, beside))):
            search.journal.reject(item, 'its size depends on what unnamed causes have beside it')
            return others
    return None


def _nameless(search: Search, item: Hypothesis, others: Model) -> list[Rival]:
    """Return the unnamed causes that could stand in the place of a name, the strongest first."""
    return [rival for rival in search.rivals(item, others)
            if rival.hypothesis is not None and isinstance(rival.hypothesis.effect, Kind)]


def _leaves_most(search: Search, model: Model) -> bool:
    """Return whether the names of a model leave most of the error, and no noise."""
    named = tuple(named_of(model))
    if not named:
        return False
    heldout = search.pool.heldout.observations
    before, after = (_rms(heldout, residuals(heldout, part, search.pool.solution(part)))
                     for part in ((), named))
    floor = np.sqrt(np.mean([run.noise_floor ** 2 for run in heldout.runs]))
    return bool(after > MOST_LEFT * before and after > NO_NOISE * floor)


def _rms(observations: Observations, left: Sequence[np.ndarray]) -> float:
    """Return the rms of residuals (m, J) of each run over the valid rows, N m."""
    kept = np.concatenate([part[run.valid] for run, part in zip(observations.runs, left)])
    return float(np.sqrt(np.mean(kept ** 2))) if len(kept) else 0.0
