"""Names that are not told because something else explains more in their place.

If a machine has a cause that is in no library, the nearest name is wrong: it explains a part of
what an unnamed function explains. On a Par4 it is enough to compare each name with the unnamed
functions, because its motion excites all that they have in common with effects, and to look whether
a name has one size everywhere. An axis may be any machine on any motion, so its names are also
judged together, its delays beside unnamed causes, and others beside series that go on. A name
falls, too, if another that was rejected explains more in its place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.base_terms import INERTIA
from par4_dynamics.effects.cogging import Cogging
from par4_identification.diagnosis.evidence.fit import residuals, rms_of, solve
from par4_identification.diagnosis.evidence.holdout import blocks_of_runs
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.nominal.gate import is_vague
from par4_identification.diagnosis.search.causes import Hypotheses, named_of, others_of, unnamed_of
from par4_identification.diagnosis.search.rules import OF_PAR4, Rules
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.verdict.constancy import followed_by

Doubt = Callable[[Search, Hypothesis, Hypotheses], Hypotheses | None]
"""Of a name in a model: returns the model without it if the name is doubtful."""
POSITION, PERIODIC = 'position', 'periodic'
"""Kinds of unnamed causes that are smooth functions and sums of waves of the position."""
MOST_LEFT = 0.5
"""Largest ratio of the error with the names to that without them, on held-out rows, with which they
are told although what they leave is no noise."""
NO_NOISE = 5.0
"""Ratio of an error to the white noise of the rows above which it is no noise."""
KNOWN_NOISE = 2.0
"""The same where the noise is all that is known of: what the noise of positions makes, too."""
LARGEST = 0.15
"""Share of the measured torque (rms) beyond which noise is part of what the machine does."""
CHANCE = 0.025
"""Largest probability, over draws of parts of the motion, that the error on held-out rows is no
smaller with the names."""
MOST = 1.0
"""Largest relative change of a delay or lag by unnamed causes beside it. Every faulty model leaves
something that looks like a torque at another time."""


def without_doubtful_names(search: Search, model: Hypotheses, floor: np.ndarray) -> Hypotheses:
    """Return the model of an axis without doubtful names.

    `floor` (J,), N m, is that of the noise on held-out rows.

    A name is doubtful if an unnamed function explains far more in its place, or if more terms of a
    series do as well, or if the motion does not tell it from an inertia. A delay or a lag is
    doubtful if its time changes much with the unnamed causes beside it. All names are doubtful if
    together they leave most of an error that is no noise, or if they do not lower the error on
    held-out rows by more than chance.
    """
    if {Cogging.name, PERIODIC} <= {item.effect.name for item in model}:
        # its waves may be orders of the cogging that were lost beside other causes
        model = search.tested(tuple(item for item in model if item.effect.name != PERIODIC))
    while True:
        reason = _doubt_of_all(search, model, floor)
        if reason is not None:
            for item in named_of(model):
                search.journal.reject(item, reason)
            return search.with_nameless(()) or tuple(unnamed_of(model))
        less = _without(search, model, _continued, _replaced, _outdone, _inertial,
                        _timed_otherwise, _inconstant)
        if less is model:
            return model
        model = less  # those that are left are judged together, too


def without_replaceable_names(search: Search, model: Hypotheses) -> Hypotheses:
    """Return the model of a Par4 without names that something else explains better.

    That is another cause in the place of a name, or a size that is not the same everywhere.
    """
    return _without(search, model, _replaced, _outdone, _inconstant)


def is_no_noise(heldout: Observations, left: Sequence[np.ndarray], torque: Sequence[np.ndarray],
                named: Sequence[Hypothesis], floor: np.ndarray, rules: Rules) -> bool:
    """Return whether what a model of an axis leaves is too much for noise.

    Noise may be `NO_NOISE` times as large as its floor says, and so may the error of the measured
    torque. A share of the torque of the names may be wrong, too: that of laws which an axis may
    follow less closely than a Par4. A series has no such law, but as many terms as the data carry,
    and a constant torque has none either.

    Args:
        heldout: rows that were held out.
        left: what the model leaves of them, (m, J) of each run, N m.
        torque: of the names there, the same.
        named: these.
        floor: of the noise, (J,) N m.
        rules: say how much of each torque may be wrong.
    """
    measured = rms_of(heldout, heldout.varying)
    error = np.hypot(np.sqrt(np.mean(floor ** 2)), rules.base_error * measured)
    exact = all(item.named.is_series or item.named.variables == 0 for item in named)
    share = (OF_PAR4 if exact else rules).named_error
    limit = np.hypot(NO_NOISE * error, share * rms_of(heldout, torque))
    return bool(rms_of(heldout, left) > limit)


def is_most_of_it(heldout: Observations, left: Sequence[np.ndarray], floor: np.ndarray,
                  rules: Rules) -> bool:
    """Return whether what a model leaves is beyond the noise floor and a large part of the torque.

    It may wander as noise does: a model that does not know so much of a machine is none of it.
    """
    rest = rms_of(heldout, left)
    return bool(rest > rules.floor_excess * np.sqrt(np.mean(floor ** 2))
                and rest > LARGEST * rms_of(heldout, heldout.varying))


def _without(search: Search, model: Hypotheses, *doubts: Doubt) -> Hypotheses:
    """Return a model without names that are doubtful, one after the other."""
    for item in named_of(model):
        for doubt in doubts:
            trial = doubt(search, item, model)
            if trial is not None:
                return _without(search, trial, *doubts)
    return model


def _continued(search: Search, item: Hypothesis, model: Hypotheses) -> Hypotheses | None:
    """Return the model without a name, if a series that goes on does as well in its place.

    What a series leaves that ends too early looks like something else: a magnet beside the
    polynomials of its field like waves. With as many more terms as the name has numbers the series
    must do worse than the name by what any cause must gain.
    """
    others = others_of(model, item)
    numbers = search.pool.numbers(item)
    for series in named_of(others):
        shape = series.named.with_more_terms(series.shape, numbers)
        if shape is None:
            continue
        longer = tuple(replace(series, shape=shape) if other is series else other
                       for other in others)
        lost = [0.5 * (there - here) for there, here in zip(
            search.pool.fit(longer).squares, search.pool.fit(model).squares)]
        needed = search.weighing.requirement(model, item)
        if lost[0] <= needed.fit or lost[1] <= needed.heldout:
            search.journal.reject(item, f'{series.label} explains as much with more terms')
            return longer
    return None


def _replaced(search: Search, item: Hypothesis, model: Hypotheses) -> Hypotheses | None:
    """Return the model with an unnamed function in the place of a name, if it explains far more."""
    others = others_of(model, item)
    best = next(iter(_nameless(search, item, others)), None)
    if best is None or -best[1] <= _law_may_lose(search, item, best[0], others):
        return None
    kind, margin = best
    search.journal.reject(item, f'{kind.effect.phrase} explains {-margin:.0f} more in its '
                                f'place on rows held out')
    return (*others, kind)


def _outdone(search: Search, item: Hypothesis, model: Hypotheses) -> Hypotheses | None:
    """Return the model without a name, if a name that was rejected explains far more in its place.

    That one takes its place if it is a cause beside the others. It may also have been rejected
    because all its values may as well be zero. A name that is so far behind one that is no cause
    has no better claim.
    """
    others = others_of(model, item)
    rival = next((rival for rival in search.rivals(item, others) if rival.believable
                  and rival.hypothesis is not None
                  and not isinstance(rival.hypothesis.effect, Kind)), None)
    if rival is None or rival.hypothesis is None or (
            -rival.margin <= _law_may_lose(search, item, rival.hypothesis, others)):
        return None
    reason = f'{rival.hypothesis.label} explains {-rival.margin:.0f} more in its place'
    if search.weighing.standing(rival.hypothesis, others) > 1.0:
        search.journal.reject(item, f'{reason} on rows held out')
        return (*others, rival.hypothesis)
    search.journal.reject(item, f'{reason} on rows held out, and is no cause itself')
    return search.with_nameless(others)


def _inconstant(search: Search, item: Hypothesis, model: Hypotheses) -> Hypotheses | None:
    """Return the model without a name whose size is not the same everywhere.

    Its torque is there, whatever it is: if no unnamed cause is found that explains it well enough
    to be told by itself, the one that comes nearest is told.
    """
    others = others_of(model, item)
    what = followed_by(search, item, others)
    if what is None:
        return None
    search.journal.reject(item, f'its size changes with {what}, and that of such a cause does not')
    without = search.with_nameless(search.tested(others))
    nearest = _nameless(search, item, others)[:1]
    return without if unnamed_of(without) else (*others, *(kind for kind, _ in nearest))


def _inertial(search: Search, item: Hypothesis, model: Hypotheses) -> Hypotheses | None:
    """Return the model without a name that takes the place of an inertia which is told without it.

    On a single sine the acceleration is the position with another sign, so that a spring that
    pushes away explains all that the inertia does, on rows held out of the same sine, too.
    """
    others = others_of(model, item)
    (value, std), (beside, std_beside) = (_inertia_beside(search, part) for part in (others, model))
    if value <= 0.0 or is_vague(value, std) or not is_vague(beside, std_beside):
        return None
    search.journal.reject(item, 'the motion does not tell it from the inertia')
    return search.with_nameless(others)


def _inertia_beside(search: Search, model: Hypotheses) -> tuple[float, float]:
    """Return the inertia of an axis beside causes and its deviation; zeros where it is not fitted.
    """
    names = [term.name for term in search.pool.evidence.observations.terms]
    if INERTIA not in names:
        return 0.0, 0.0
    place, fit = names.index(INERTIA), solve(search.pool.evidence, model)
    return float(fit.base[place]), float(np.sqrt(fit.covariance[place, place]))


def _timed_otherwise(search: Search, item: Hypothesis, model: Hypotheses) -> Hypotheses | None:
    """Return the model without a delay or lag whose time changes much beside unnamed causes."""
    others = others_of(model, item)
    if unnamed_of(model) and item.named.retimes:
        named = tuple(named_of(model))
        alone, beside = (
            search.pool.solution(part).coefficients[part.index(item)] for part in (named, model))
        if np.linalg.norm(alone - beside) > MOST * min(map(np.linalg.norm, (alone, beside))):
            search.journal.reject(item, 'its time depends on what unnamed causes have beside it')
            return others
    return None


def _law_may_lose(search: Search, item: Hypothesis, rival: Hypothesis, others: Hypotheses) -> float:
    """Return by how much a rival may explain more than a name that is right.

    The law of a name may be wrong by a share of its torque, and a rival with many coefficients can
    follow what other causes leave. In a long log with little noise both are worth much
    log-likelihood. An unnamed cause that can imitate the name may leave little of its worth to be
    seen: what it is worth beside the other names counts as well.
    """
    rules = search.rules
    alone = search.weighing.gains(item, tuple(named_of(others)))[1]
    return max(rules.better, rules.twin,
               rules.unnamed_error * search.weighing.gains(rival, others)[1],
               rules.unnamed_error ** 2 * alone)


def _nameless(search: Search, item: Hypothesis, others: Hypotheses
              ) -> list[tuple[Hypothesis, float]]:
    """Return unnamed causes that could stand in the place of a name, and its margin over each.

    The strongest come first. For a series over the position, smooth functions and waves of the
    position are left out, because they say the same.
    """
    return [(rival.hypothesis, rival.margin) for rival in search.rivals(item, others)
            if rival.hypothesis is not None and isinstance(rival.hypothesis.effect, Kind)
            and not _has(rival.hypothesis.effect, item)
            and not (item.named.is_series and rival.hypothesis.effect.name in (POSITION, PERIODIC))]


def _has(kind: Kind, item: Hypothesis) -> bool:
    """Return whether a kind has the torque of a name in it: what follows from the nominal torque.

    The rate of that torque has it only of a name that is a torque at another time.
    """
    return kind.needs_nominal and (not kind.left_by_filters or item.named.retimes)


def _doubt_of_all(search: Search, model: Hypotheses, floor: np.ndarray) -> str | None:
    """Return why the names of a model are doubtful together; None if they are not."""
    named = tuple(named_of(model))
    if not named:
        return None
    heldout = search.pool.heldout.observations
    before, after = (residuals(heldout, part, search.pool.solution(part)) for part in ((), named))
    old, new = rms_of(heldout, before), rms_of(heldout, after)
    white = np.mean([run.noise_floor ** 2 for run in heldout.runs])
    noise = np.sqrt(max(NO_NOISE ** 2 * white, KNOWN_NOISE ** 2 * np.mean(floor ** 2)))
    if new > MOST_LEFT * old and new > noise:
        return 'the names together leave most of an error that is no noise'
    blocks = blocks_of_runs([run.t for run in heldout.runs], [run.valid for run in heldout.runs])
    gone = (blocks.draws @ (blocks.sums(before) - blocks.sums(after))).sum(axis=1)
    if np.quantile(gone, CHANCE) <= 0.0:
        return 'with the names the error on rows held out is no smaller than chance makes it'
    return None
