"""Names that hold once their values are told: a name that may be nothing is taken back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.doubt import (
    with_doubt,
    with_doubt_of_choice,
    with_doubt_of_size,
    with_doubt_of_time,
)
from par4_identification.diagnosis.evidence.estimates import (
    effect_parameters,
    variance_of_shape,
)
from par4_identification.diagnosis.evidence.fit import Fit, left_by, solve, with_coefficients
from par4_identification.diagnosis.evidence.holdout import Blocks, blocks_of_runs
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.search.candidates import goes_both_ways
from par4_identification.diagnosis.search.causes import (
    Hypotheses,
    named_of,
    names_of,
    others_of,
    unnamed_of,
)
from par4_identification.diagnosis.search.joints import without_joints
from par4_identification.diagnosis.search.polish import polished
from par4_identification.diagnosis.search.requirement import torque_errors
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.verdict.agreement import parameters_by, with_disagreement
from par4_identification.diagnosis.verdict.answer import Cause
from par4_identification.diagnosis.verdict.choice_of_law import with_doubt_of_law
from par4_identification.diagnosis.verdict.judgement import OWN, judge, own_share
from par4_identification.diagnosis.verdict.loose_loads import loose_loads
from par4_identification.diagnosis.verdict.rattle import Rattle
from par4_identification.diagnosis.verdict.sure import (
    without_doubtful_names,
    without_replaceable_names,
)
from par4_identification.diagnosis.verdict.swinging_loads import (
    with_doubt_of_counts,
    without_count_bias,
)
from par4_identification.diagnosis.verdict.weak_causes import weak_causes, widened

MORE = 4.0
"""What a name explains beside unnamed causes, over what it does without them, beyond which they are
part of it."""
TorqueErrors = Sequence[Sequence[np.ndarray]]
"""What torques may be wrong by, on the rows to fit and on the rows held out, see `torque_errors`.
"""


@dataclass(frozen=True)
class Settled:
    """Causes that hold, with the values that are told.

    Attributes:
        model: all causes, polished.
        named: those with a name, the strongest first.
        told: fit of the named ones, with the values that are told.
        causes: these, with values, rivals and twins.
        loose: loads that rattle in a gap, None if none do.
        blocks: of the rows held out.
    """

    model: Hypotheses
    named: tuple[Hypothesis, ...]
    told: Fit
    causes: tuple[Cause, ...]
    loose: Rattle | None
    blocks: Blocks


@dataclass(frozen=True)
class Doubted:
    """A name with deviations that allow for more and more.

    Attributes:
        plain: they take its joints and its law for right.
        by_any_law: it may act on other joints, with other parts and by another law; `plain` for a
            name that is something by itself beside unnamed causes.
        beside_weak: it may act on other joints, but for such a name, and beside it those weak
            causes (`weak_causes`) that leave it next to nothing to explain.
        told: all of these, and all weak causes.
        coefficients: by which the values are told, (K, J).
    """

    plain: Cause
    by_any_law: Cause
    beside_weak: Cause
    told: Cause
    coefficients: np.ndarray


def settle(search: Search, model: Hypotheses, floor: np.ndarray) -> Settled:
    """Return the causes of a search that hold.

    `floor` (J,), N m, is that of the noise on held-out rows.

    Names and joints that may as well be nothing are taken back one at a time, the weakest first,
    and what is left is looked at anew.
    """
    heldout = search.pool.heldout.observations
    blocks = blocks_of_runs([run.t for run in heldout.runs], [run.valid for run in heldout.runs])
    simplified: set[str] = set()
    while True:
        weak = weak_causes(search, model)
        model, changed = without_count_bias(search, polished(search, model))
        loose, model = loose_loads(search, model)
        model = (without_doubtful_names(search, model, floor) if heldout.of_axis else
                 without_replaceable_names(search, model))
        named = _strongest_first(search, model)
        told = search.weighing.corrected(solve(search.pool.evidence, named))
        errors = [torque_errors(part, search.pool.solution(model), search.rules)
                  for part in (search.pool.evidence, search.pool.heldout)]
        values = [_doubted(search, item, _cause(item, search, named, told, blocks, model, errors),
                           told, model, errors, weak) for item in named]
        less = _without_nothing(search, model, named, values)
        if less is None:
            causes = with_doubt_of_counts(search, [own.told for own in values], named, changed)
            less = _without_idle_joints(model, named, causes)
        if less is None:
            less = _told_more_simply(search, model, named, causes, simplified)
        if less is None:
            told = with_coefficients(
                search.pool.evidence, told, [own.coefficients for own in values])
            return Settled(model, named, told, tuple(causes), loose, blocks)
        model = less


def _strongest_first(search: Search, model: Hypotheses) -> tuple[Hypothesis, ...]:
    return tuple(sorted(named_of(model), key=lambda item: -search.weighing.gains(
        item, others_of(model, item))[0]))


def _doubted(search: Search, item: Hypothesis, cause: Cause, fit: Fit, model: Hypotheses,
             errors: TorqueErrors, weak: Sequence[Hypothesis]) -> Doubted:
    """Return a name with its values, by a fit of the names or of all, and with doubts about them.

    Without unnamed causes the values are in doubt by what these change. A name that has nothing to
    do with them explains beside them what it does without them, and no other explains far more in
    its place. It has the values that it has beside them, and these say whether it is something. One
    that explains far more beside them stands and falls with what they are.
    """
    corrected = search.weighing.corrected
    by_itself = _is_by_itself(search, item, cause, model)
    if by_itself:
        fit = corrected(solve(search.pool.evidence, model))
        cause = replace(cause, parameters=_parameters(search, item, fit, model, errors))
    beside = fit.hypotheses
    on_any_joints = replace(cause, parameters=with_doubt_of_choice(
        cause.parameters, search.pool.evidence, item, beside, corrected))
    by_any_law = replace(on_any_joints, parameters=with_doubt_of_law(
        on_any_joints.parameters, search, item, beside, errors[0]))
    replacing = [other for other in weak if not _stands_beside(search, item, model, other)]
    return Doubted(
        cause, cause if by_itself else by_any_law,
        widened(search, cause if by_itself else on_any_joints, item, beside, replacing),
        widened(search, by_any_law, item, beside, weak),
        fit.coefficients[beside.index(item)])


def _stands_beside(search: Search, item: Hypothesis, model: Hypotheses, weak: Hypothesis) -> bool:
    """Return whether a name of a model explains more than chance does with a weak cause beside it.

    Then that cause changes how large the name is, however much, not whether it is one.
    """
    fit_gain, gain = search.weighing.gains(item, (*others_of(model, item), weak))
    return fit_gain > search.rules.evidence and gain > search.rules.margin


def _is_by_itself(search: Search, item: Hypothesis, cause: Cause, model: Hypotheses) -> bool:
    """Return whether a name has little to do with the unnamed causes of a model, if it has any."""
    others = others_of(model, item)
    _, gain = search.weighing.gains(item, others)
    return bool(unnamed_of(model)) and OWN <= own_share(search, item, others) <= MORE and (
        gain >= OWN * (gain - cause.margin))


def _without_nothing(search: Search, model: Hypotheses, named: tuple[Hypothesis, ...],
                     values: Sequence[Doubted]) -> Hypotheses | None:
    """Return the model without the weakest name that may as well be nothing; None if none may.

    How large a cause is depends on its law, on its joints and on what else acts, not whether it is
    one. But values that no machine can have say nothing if they may as well be zero, or if they lie
    on the wrong side of it on every joint, whatever their deviations. Neither does a name that may
    be zero where something that is no twin explains rows held out as well, nor one that is told as
    nothing where anything explains more of them than twins differ by.
    """
    for item, own in reversed(list(zip(named, values))):
        if own.plain.is_nothing or (own.by_any_law.may_be_zero and (
                unnamed_of(model)
                or not search.belief.is_possible(item, others_of(named, item)))):
            search.journal.reject(item, 'all its values are zero within their deviations')
            return search.with_nameless(others_of(model, item))
        if search.belief.is_on_wrong_side(item, others_of(named, item)):
            search.journal.reject(item, 'on every joint its values lie on the side of zero where '
                                  'no machine has any')
            return search.with_nameless(others_of(model, item))
    for item, own in reversed(list(zip(named, values))):
        cause, least = own.told, search.rules.margin if own.told.is_nothing else 0.0
        outdone = cause.is_nothing and -cause.margin > search.rules.twin
        if outdone or (cause.margin <= least and cause.rival not in cause.twins
                       and (cause.is_nothing or own.beside_weak.may_be_zero)):
            search.journal.reject(item, f'all its values may be zero, and on rows held out '
                                  f'{cause.rival or "no cause at all"} explains as much')
            return search.with_nameless(others_of(model, item))
    return None


def _told_more_simply(search: Search, model: Hypotheses, named: Sequence[Hypothesis],
                      causes: Sequence[Cause], done: set[str]) -> Hypotheses | None:
    """Return the model with the simpler effect in the place of one that is no more than that.

    Where the law of another cause is a little wrong, a torque over the position explains more than
    an offset, and is told as one all the same: the other terms are zero within their deviations.
    None if there is no such name, or if it came back: each is added to `done`.
    """
    for item, cause in zip(named, causes):
        values, std = ({name: np.asarray(getattr(parameter, what), dtype=float)
                        for name, parameter in cause.parameters.items()}
                       for what in ('value', 'std'))
        name = item.named.simpler(values, std)
        effect = search.candidates.library.get(name or '')
        if effect is None or item.effect.name in done:
            continue
        done.add(item.effect.name)
        search.journal.reject(item, f'all but {effect.phrase} is zero within its deviations')
        simple = Hypothesis(effect, {}, item.joints)
        others = others_of(model, item)
        return others if effect.name in names_of(others) else (*others, simple)
    return None


def _without_idle_joints(model: Hypotheses, named: Sequence[Hypothesis], causes: Sequence[Cause]
                         ) -> Hypotheses | None:
    """Return the model in which a name lost the joints where it is nothing; None if none has any.
    """
    for item, cause in zip(named, causes):
        if cause.idle_joints:
            acting = without_joints(item, cause.idle_joints)
            return tuple(acting if other is item else other for other in model)
    return None


def _cause(hypothesis: Hypothesis, search: Search, named: Sequence[Hypothesis], fit: Fit,
           blocks: Blocks, model: Hypotheses, errors: TorqueErrors) -> Cause:
    evidence, heldout = search.pool.evidence, search.pool.heldout
    judgement, index = judge(search, hypothesis, model), named.index(hypothesis)
    before, after = (left_by(heldout, part, solve(evidence, part))
                     for part in (others_of(model, hypothesis), model))
    return Cause(
        effect=hypothesis.named, joints=hypothesis.joints,
        parameters=_parameters(search, hypothesis, fit, model, errors),
        twins=judgement.twins,
        visible_fraction=search.weighing.beside(()).left_share(
            evidence.columns(hypothesis), hypothesis.stacked(fit.coefficients[index])),
        p_value=judgement.p_value, margin=judgement.margin, rival=judgement.rival,
        gain=blocks.whitened_gain(before, after),
        by_shape=variance_of_shape(evidence, hypothesis, fit, index, errors[0]))


def _parameters(search: Search, hypothesis: Hypothesis, fit: Fit, model: Hypotheses,
                errors: TorqueErrors) -> dict[str, Parameter]:
    """Return the parameters of a name by a fit of all causes of a model or of the named ones.

    The rate of the torque contains a delay or a lag, so that the value beside it says nothing.
    """
    evidence, heldout = search.pool.evidence, search.pool.heldout
    model = tuple(item for item in model if not (
        hypothesis.named.retimes and isinstance(item.effect, Kind) and item.effect.left_by_filters))
    parameters = effect_parameters(
        evidence, hypothesis, fit, fit.hypotheses.index(hypothesis), errors[0])
    parameters = with_doubt_of_size(parameters, evidence, hypothesis, fit)
    if len(fit.hypotheses) < len(model):
        parameters = with_doubt(parameters, effect_parameters(
            evidence, hypothesis, search.weighing.corrected(solve(evidence, model)),
            model.index(hypothesis), errors[0]))
    # unnamed causes that differ from motion to motion are no disagreement about the named one
    parameters = with_disagreement(parameters, *(
        parameters_by(part, model, model.index(hypothesis), wrong)
        for part, wrong in zip((evidence, heldout), errors)))
    if goes_both_ways(evidence.observations):
        return parameters
    return with_doubt_of_time(parameters, evidence.observations)
