"""The joints and the parts of an effect that a hypothesis needs, chosen among all of them."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.search.belief import Belief
from par4_identification.diagnosis.search.causes import Hypotheses
from par4_identification.diagnosis.search.requirement import requirement_of
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.shapes import order_name


def with_needed_joints(pool: Pool, belief: Belief, hypothesis: Hypothesis, others: Hypotheses
                       ) -> Hypothesis:
    """Return a name with only those joints and parts that are worth their price.

    Joints share the base parameters, so an effect on one joint leaves a trace on all, and what all
    have in common belongs to the base. Therefore every set of joints is tried. For a shared effect
    every choice of its separable sets is tried, because one wrong dimension looks like several. A
    set without which held-out rows fit much worse is kept, whatever its price. A joint that is
    worth little more than its price, or no more than the errors of the causes' torques can gain, is
    dropped if no machine could have its value: errors of a strong cause look like that.

    Args:
        pool: fits.
        belief: judges whether a machine can have a cause. Its rules have the price of a coefficient
            (`price`), the gain on held-out rows (`margin`), and how much worse than the best a set
            of joints may be (`twin`).
        hypothesis: an effect on all joints.
        others: the causes beside it.
    """
    rules = belief.rules
    hypothesis = _with_confirmed_terms(pool, rules, _with_confirmed_orders(
        pool, rules, hypothesis, others), others)
    needed = requirement_of(pool, (*others, hypothesis), rules)
    everywhere = tuple(range(pool.evidence.observations.joints))
    trials = list(choices(hypothesis, everywhere)) or [hypothesis]
    fits = [pool.fit((*others, trial)) for trial in trials]
    least = min(fit.heldout_squares for fit in fits)

    def ranked(doubt: float, slack: float = 0.0) -> list[Hypothesis]:
        """Return the best sets, if what the causes get wrong enlarges a joint's price so much.

        A set may explain less than the best by what tells no twins, and by `slack`.
        """
        losses = np.array([0.5 * fit.fit_squares + doubt * rules.price * pool.width(trial)
                           if fit.heldout_squares <= least + 2.0 * doubt * rules.margin
                           else np.inf for trial, fit in zip(trials, fits)]).round(6)
        ranks = np.argsort(losses, kind='stable')  # of equals the first
        return [_by_itself(trials[rank]) for rank in ranks
                if losses[rank] <= losses[ranks[0]] + rules.twin + slack]

    # that may look like one more joint, though not all of it unless no machine has such a joint
    usual = ranked(np.sqrt(needed.inflation))
    by_price = ranked(needed.inflation)
    fewer = [item for item in ranked(needed.inflation, needed.by_causes)
             if _chosen(item) < _chosen(usual[0])]
    return next((item for item in (*usual, *by_price, *fewer)
                 if belief.objection(item, others) is None), usual[0])


def _chosen(hypothesis: Hypothesis) -> set[int]:
    """Return the joints of a name, or its sets if it is shared."""
    return set(hypothesis.joints if hypothesis.sets is None else hypothesis.sets)


def _by_itself(hypothesis: Hypothesis) -> Hypothesis:
    """Return a name with the shape that it has on a machine with only the sets that it has."""
    if hypothesis.sets is None:
        return hypothesis
    return replace(hypothesis, shape=hypothesis.named.shape_of_sets(hypothesis.shape,
                                                                    hypothesis.sets))


def without_joints(hypothesis: Hypothesis, idle: Collection[int]) -> Hypothesis:
    """Return a name, whose every parameter is one of joints, without some of its joints."""
    kept = tuple(joint for joint in hypothesis.joints if joint not in idle)
    if not hypothesis.effect.shared:
        return replace(hypothesis, joints=kept)
    return _by_itself(replace(hypothesis, joints=kept, sets=kept))


def with_acting_joints(pool: Pool, rules: Rules, hypothesis: Hypothesis, others: Hypotheses
                       ) -> Hypothesis:
    """Return an unnamed cause without the joints that held-out rows do not need."""
    if hypothesis.effect.shared:
        return hypothesis
    everywhere = tuple(range(pool.evidence.observations.joints))
    best = pool.fit((*others, hypothesis)).heldout_squares
    for count in range(1, len(everywhere)):
        trials = [replace(hypothesis, joints=joints)
                  for joints in combinations(everywhere, count)]
        squares = [pool.fit((*others, trial)).heldout_squares for trial in trials]
        if min(squares) <= best + 2.0 * rules.margin:
            return trials[int(np.argmin(squares))]
    return hypothesis


def choices(hypothesis: Hypothesis, everywhere: tuple[int, ...]) -> Iterator[Hypothesis]:
    """Yield a name on each set of joints, or with each choice of its separable sets.

    Small sets come first. There are none for a machine with one joint.
    """
    effect = hypothesis.named
    if len(everywhere) == 1:
        return
    numbers = effect.sets_of(hypothesis.shape) if effect.shared else everywhere
    of_joints = all(parameter.scope == 'joint' for parameter in effect.parameters
                    if not parameter.is_shape)
    for count in range(1, len(numbers) + 1):
        for chosen in combinations(numbers, count):
            if not effect.shared:
                yield replace(hypothesis, joints=chosen)
            else:
                yield replace(hypothesis, sets=chosen,
                              joints=chosen if of_joints else hypothesis.joints)


def _with_confirmed_orders(pool: Pool, rules: Rules, hypothesis: Hypothesis, others: Hypotheses
                           ) -> Hypothesis:
    """Return a periodic torque without the orders that held-out rows do not need."""
    if isinstance(hypothesis.effect, Kind):
        return hypothesis
    name = order_name(hypothesis.effect)
    while name is not None and isinstance(orders := hypothesis.shape[name], tuple):
        fewer = [orders[:index] + orders[index + 1:] for index in range(len(orders))]
        trials = [replace(hypothesis, shape={name: kept if len(kept) > 1 else kept[0]})
                  for kept in fewer]
        squares = [pool.fit((*others, trial)).heldout_squares for trial in trials]
        most = pool.fit((*others, hypothesis)).heldout_squares + 2.0 * rules.margin
        if min(squares) > most:
            break
        hypothesis = trials[int(np.argmin(squares))]
    return hypothesis


def _with_confirmed_terms(pool: Pool, rules: Rules, hypothesis: Hypothesis, others: Hypotheses
                          ) -> Hypothesis:
    """Return a series without the highest terms that held-out rows do not need.

    Where little noise is in the rows, terms of any number fit them better, as they follow what the
    columns of the true ones get wrong; where the fitted motion hardly goes they then have any size.
    """
    fewer = [replace(hypothesis, shape=shape)
             for shape in hypothesis.named.with_fewer_terms(hypothesis.shape)]
    trials = [*fewer, hypothesis]
    if not fewer:
        return hypothesis
    squares = [pool.fit((*others, trial)).heldout_squares for trial in trials]
    most = min(squares) + 2.0 * rules.margin
    return next(trial for trial, left in zip(trials, squares) if left <= most)
