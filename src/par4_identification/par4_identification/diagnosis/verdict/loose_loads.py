"""Loads that rattle beside what a search found, and which names then stay."""

from __future__ import annotations

from par4_dynamics.base_terms import INERTIA
from par4_dynamics.effects.backlash import Backlash
from par4_dynamics.effects.effect import Effect
from par4_dynamics.effects.elastic_transmission import ElasticTransmission
from par4_dynamics.model_file import EffectEntry
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.fit import residuals, solve
from par4_identification.diagnosis.evidence.holdout import Gain
from par4_identification.diagnosis.search.causes import Hypotheses, named_of, names_of, others_of
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.verdict.answer import Cause
from par4_identification.diagnosis.verdict.rattle import WIDTH_ERROR, Rattle, rattle
from par4_identification.diagnosis.verdict.unrelated import left_of, lines_of, swing_of

SMOOTH = 0.5
"""Share of what the names leave beyond which an unnamed cause is the whole of it: no load rattles.
"""
RINGING = 0.3
"""Share of it that twisting transmissions explain, though they are no cause, beyond which they are
nearer than a load that rattles in a gap."""
CHANCE = 1e-3
"""Largest probability that chance makes such bounces."""


def loose_loads(search: Search, model: Hypotheses) -> tuple[Rattle | None, Hypotheses]:
    """Return the loads that rattle, None if none do, and the causes that stand beside them.

    A soft transmission does not: bounces look like a load that swings.
    """
    named = tuple(item for item in named_of(model) if item.effect.name != ElasticTransmission.name)
    found = _rattle(search, model, named)
    if found is None:
        return None, model
    beside = _beside_bounces(search, named)
    return (None, model) if _hums(search, beside) else (found, beside)


def cause_of(effect: Effect, found: Rattle) -> tuple[Cause, EffectEntry]:
    """Return loads that rattle as a cause, whose gain is zero, and as an entry of a model file."""
    parameters = {'gap': Parameter(value=tuple(map(float, found.gap)), unit='rad',
                                   std=tuple(map(float, WIDTH_ERROR * found.gap)))}
    cause = Cause(effect, found.joints, parameters, (), 1.0, found.p_value, 0.0, None,
                  Gain(0.0, 0.0, 0.0), predictable=False)
    return cause, EffectEntry(effect=effect.name, joints=found.joints, parameters=parameters)


def _rattle(search: Search, model: Hypotheses, named: Hypotheses) -> Rattle | None:
    """Return the joints whose loads rattle in a gap, if what the names leave tells of any.

    `named` are those of the model but for soft transmissions.
    """
    library, pool = search.candidates.library, search.pool
    if Backlash.name not in library or Backlash.name in names_of(named):
        return None
    if INERTIA not in {term.name for term in pool.evidence.observations.terms}:
        return None  # nothing is known to rattle
    left, rest = pool.fit(named).heldout_squares, pool.fit(model).heldout_squares
    if rest < (1.0 - SMOOTH) * left or _rings(search, model, named):
        return None
    fit = solve(pool.evidence, named)
    found = rattle([(part.observations, residuals(part.observations, named, fit))
                    for part in (pool.evidence, pool.heldout)])
    return found if found is not None and found.p_value < CHANCE else None


def _beside_bounces(search: Search, named: Hypotheses) -> Hypotheses:
    """Return the names that explain more than bounces of a load may look like.

    What the names leave is then the torque of the bounces. They are no function of the motion, and
    as little known as an unnamed cause.
    """
    left, share = search.pool.fit(named), 0.5 * search.rules.unnamed_error ** 2
    kept = []
    for item in named:
        needed = search.weighing.requirement(named, item)
        fit_gain, gain = search.weighing.gains(item, others_of(named, item))
        if (fit_gain > needed.fit + share * left.fit_squares
                and gain > needed.heldout + share * left.heldout_squares):
            kept.append(item)
    return tuple(kept)


def _hums(search: Search, model: Hypotheses) -> bool:
    """Return whether what a model leaves has frequencies of its own, which bounces have not."""
    evidence = search.pool.evidence
    base_only, fit = solve(evidence, ()), solve(evidence, model)
    left = [left_of(part.observations, model, base_only, fit, search.rules)
            for part in (evidence, search.pool.heldout)]
    return bool(lines_of(*left)) or swing_of(left) is not None


def _rings(search: Search, model: Hypotheses, named: Hypotheses) -> bool:
    """Return whether transmissions that twist explain much of what the other names leave.

    They do so as the model has them, or as a search finds them that are no cause.
    """
    effect = search.candidates.library.get(ElasticTransmission.name)
    if effect is None:
        return False
    if ElasticTransmission.name in names_of(model):
        left, rest = (search.pool.fit(names).heldout_squares
                      for names in (named, tuple(named_of(model))))
        return rest < (1.0 - RINGING) * left
    projection = search.weighing.beside(named)
    candidate = search.candidates.best(effect, projection)
    return candidate is not None and 2.0 * candidate.gain > RINGING * projection.squares
