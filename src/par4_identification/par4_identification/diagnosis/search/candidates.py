"""The best shape of each effect, given the causes that a model already has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape
from par4_dynamics.effects.elastic_transmission import ElasticTransmission
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.diagnosis.evidence.side_by_side import side_by_side
from par4_identification.diagnosis.search.first_look import Look, first_look
from par4_identification.diagnosis.search.orders import best_orders
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.shapes import (
    best_shape,
    order_name,
    self_consistent,
    shapes_of,
)
from par4_identification.diagnosis.search.swing import Swing, swing_in, without_rigid

GRID, ORDERS, SPRINGS = range(3)
"""What is searched of an effect, the quickest first."""
PROMISED = 0.4
"""Share of the gain that is wanted which a first look at springs or at periodic torques must
promise to be followed. Springs that came to what was wanted had promised 1.2 times as much and
more."""
ONE_WAY = 0.1
"""Share of the travel that must go either way for a difference between the directions to show."""


@dataclass(frozen=True)
class Candidate:
    """The best shape of one effect on all joints, given the causes of a model.

    Attributes:
        hypothesis: the effect with that shape.
        gain: in log-likelihood on the fitted rows.
        tried: number of shapes that were tried.
    """

    hypothesis: Hypothesis
    gain: float
    tried: int


class Candidates:
    """Searches the shapes of every effect of a library on the rows to fit.

    Args:
        library: effects that may be named.
        evidence: whitened rows to fit.
        rules: `Rules.evidence` decides whether an expensive search is worth its time.
        swings: transmissions that twist, as earlier searches found them.

    Attributes:
        swings: the same of this search, too; the last one last.
        family: number of effects and shapes that are tried.
    """

    def __init__(self, library: Mapping[str, Effect], evidence: Evidence, rules: Rules,
                 swings: Sequence[Swing] = ()) -> None:
        self.library = library
        self._rules = rules
        self._joints = tuple(range(evidence.observations.joints))
        self._shapes = {name: shapes_of(evidence.observations, effect)
                        for name, effect in library.items()
                        if not effect.needs_both_ways or goes_both_ways(evidence.observations)}
        self._searched: dict[Any, tuple[float, Candidate | None]] = {}
        self._looks: dict[frozenset[object], Look] = {}
        self._orders: dict[Effect, Shape] = {}
        self.swings = list(swings)
        self.family = sum(len(shapes) for shapes in self._shapes.values())

    def best(self, effect: Effect, projection: Projection, wanted: float = 0.0
             ) -> Candidate | None:
        """Return the best shape of an effect beside a projection; searched once.

        Args:
            effect: of the library.
            projection: what the causes of a model leave.
            wanted: gain in log-likelihood below which the candidate is of no use. Springs and
                periodic torques that promise less are not followed.
        """
        key = (effect, _causes_of(projection))
        least, found = self._searched.get(key, (np.inf, None))
        if least > wanted:
            found = self._search(effect, projection, wanted)
            is_whole = _slowness(effect) == GRID or found is not None
            self._searched[key] = 0.0 if is_whole else wanted, found
        return found

    def all_of(self, projection: Projection, without: set[str], wanted: float | None = None
               ) -> list[Candidate]:
        """Return the best shape of each effect that is not among the names `without`.

        Args:
            projection, wanted: of `best`; unless given, what the best of the quicker effects gains
                is wanted of periodic torques and of springs, whose searches take longest.
            without: names.
        """
        effects = [effect for name, effect in self.library.items() if name not in without]
        found: list[Candidate] = []
        for slowness in sorted(set(map(_slowness, effects))):
            least = max((item.gain for item in found), default=0.0) if wanted is None else wanted
            found += [item for item in side_by_side(
                partial(self.best, projection=projection, wanted=least),
                [effect for effect in effects if _slowness(effect) == slowness])
                if item is not None]
        return found

    def other_shapes(self, candidate: Candidate, projection: Projection, least: float
                     ) -> list[Shape]:
        """Return the shapes of the grid that explain more than `least`, the best first.

        There are none for orders of periodic torques, which have no grid, for series, which hold
        only near their one coefficient, and for effects with one shape.
        """
        effect = candidate.hypothesis.named
        if order_name(effect) is not None or effect.expanded:
            return []
        gains = [(0.5 * projection.gain(effect, shape), shape)
                 for shape in self._shapes.get(effect.name, ()) if shape]
        return [shape for gain, shape in sorted(gains, key=lambda item: -item[0]) if gain > least]

    def by_other_laws(self, hypothesis: Hypothesis, projection: Projection) -> list[Hypothesis]:
        """Return the same cause by each other law that was searched, in its best shape."""
        effect = hypothesis.named
        if effect.law is None:
            return []
        laws: dict[float | tuple[float, ...] | None, list[Shape]] = {}
        for shape in self._shapes.get(effect.name, ()):
            laws.setdefault(shape.get(effect.law), []).append(shape)
        return [replace(hypothesis, shape=best_shape(
                    effect, shapes, partial(projection.gains, effect))[0])
                for law, shapes in laws.items() if law != hypothesis.shape.get(effect.law)]

    def _search(self, effect: Effect, projection: Projection, wanted: float) -> Candidate | None:
        if isinstance(effect, ElasticTransmission):
            return self._twisting(effect, projection, wanted)
        shapes = self._shapes.get(effect.name)
        if not shapes:
            return None

        if order_name(effect) is not None:
            orders = best_orders(effect, shapes, projection, self._rules, self._orders.get(effect),
                                 2.0 * PROMISED * wanted)
            if orders is None:
                return None
            shape, best = orders
            self._orders[effect] = shape
        else:
            shape, best = self._best_of_laws(effect, shapes, projection)
        if effect.expanded:
            shape = self_consistent(projection, effect, shape)
            best = projection.gain(effect, shape)
        return Candidate(Hypothesis(effect, shape, self._joints), 0.5 * best, len(shapes))

    def _best_of_laws(self, effect: Effect, shapes: Sequence[Shape], projection: Projection
                      ) -> tuple[Shape, float]:
        """Return the best shape and its gain; each number more than another has must be worth it.

        A law with a number of its own, such as an exponent, always fits better than the usual one,
        and a series of more terms better than one of fewer.
        """
        joints = 1 if effect.shared else len(self._joints)

        def numbers(shape: Shape) -> int:
            return len(shape) + joints * effect.terms(shape)

        found = [best_shape(effect, [shape for shape in shapes if numbers(shape) == count],
                            partial(projection.gains, effect))
                 for count in sorted(set(map(numbers, shapes)))]
        return max(found, key=lambda item: item[1] - 2.0 * self._rules.price * numbers(item[0]))

    def _twisting(self, effect: ElasticTransmission, projection: Projection, wanted: float
                  ) -> Candidate | None:
        """Return the transmissions that twist most like the residual, if any do.

        They are looked for only where the first order of a twist by the nominal torque explains
        something: the measured torque, by which a first look goes, has the noise of the target in
        it. They are followed only where that look promises something, also of what is wanted. Where
        it does and they leave more than rigid ones, counts of the encoders may swing the loads.
        """
        evidence = self._rules.evidence
        if 0.5 * projection.gain(effect, {}) < evidence:
            return None
        key = _causes_of(projection)
        if key not in self._looks:
            self._looks[key] = first_look(projection)
        look = self._looks[key]
        if look.squares <= 2.0 * max(evidence, PROMISED * wanted):
            return None
        found = swing_in(projection, look, 2.0 * self._rules.price, self.swings)
        self.swings.append(found)
        compliance = without_rigid(found.compliance, projection.evidence.observations.runs[0].state)
        hypothesis = Hypothesis(effect, effect.expansion(compliance, found.told), self._joints)
        return Candidate(hypothesis, 0.5 * found.squares, 1)


def _causes_of(projection: Projection) -> frozenset[object]:
    """Return what tells the causes of a projection from others."""
    return frozenset(item.key for item in projection.hypotheses)


def _slowness(effect: Effect) -> int:
    """Return how long the search of an effect takes: that of a grid, of orders, of loads that
    swing."""
    if isinstance(effect, ElasticTransmission):
        return SPRINGS
    return GRID if order_name(effect) is None else ORDERS


def goes_both_ways(observations: Observations) -> bool:
    """Return whether a joint travels both ways, not only jerks back now and then."""
    forward, backward = (sum(np.sum(np.where(run.valid, np.maximum(side * run.speed, 0.0), 0.0),
                                    axis=0) for run in observations.runs) for side in (1.0, -1.0))
    return bool(np.any(np.minimum(forward, backward) > ONE_WAY * (forward + backward)))


def price_of_shapes(candidate: Candidate) -> float:
    """Return the log-likelihood that the best of so many shapes gains by chance alone."""
    return float(np.log(max(candidate.tried, 1)))
