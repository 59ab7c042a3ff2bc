"""Whether a machine can have a cause: its values, its law, and what it does to friction."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from par4_dynamics.effects.effect import CERTAIN, FAST, Base, Values
from par4_identification.diagnosis.evidence.dithered import Dithered
from par4_identification.diagnosis.evidence.estimates import estimated, fixed_sizes
from par4_identification.diagnosis.evidence.fit import Fit
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.projection import Projections
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.causes import Hypotheses
from par4_identification.diagnosis.search.lag_or_delay import obeys
from par4_identification.diagnosis.search.requirement import requirement_of
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.shapes import order_name


@dataclass(frozen=True)
class Belief:
    """Says why a cause cannot be real.

    Attributes:
        candidates: the library.
        pool: fits.
        projections: of the same rows.
        rules: by how much the torques of a model may be wrong.
        dithered: the motion as encoders could have read it whose counts lie elsewhere.
    """

    candidates: Candidates
    pool: Pool
    projections: Projections
    rules: Rules
    dithered: Dithered
    _objections: dict[Any, str | None] = field(default_factory=dict)

    def objection(self, hypothesis: Hypothesis, others: Hypotheses) -> str | None:
        """Return why a cause cannot be real beside others, or None; computed once."""
        if isinstance(hypothesis.effect, Kind):
            return None
        key = (hypothesis.key, frozenset(item.key for item in others))
        if key not in self._objections:
            self._objections[key] = self._objection(hypothesis, others)
        return self._objections[key]

    def _objection(self, hypothesis: Hypothesis, others: Hypotheses) -> str | None:
        fit = self.pool.solution([*others, hypothesis])
        reason = self._implausible(hypothesis, others, fit)
        if (reason is None and hypothesis.named.retimes
                and not self._follows_its_law(hypothesis, others)):
            reason = ('the torque is read at another time, but in second order of that time, or at '
                      'low frequencies, it does not follow this law')
        return reason

    def is_possible(self, hypothesis: Hypothesis, others: Hypotheses) -> bool:
        """Return whether a machine can have the values of a cause as they are, if they are exact.
        """
        values, level = self._values(hypothesis, self.pool.solution([*others, hypothesis]))
        return hypothesis.named.implausible(values, _exact(values), level) is None

    def is_on_wrong_side(self, hypothesis: Hypothesis, others: Hypotheses) -> bool:
        """Return whether each joint of a cause has values that none can have, with the other sign.

        A gap below zero is such a value; a gain that is too far off is none.
        """
        values, level = self._values(hypothesis, self.pool.solution([*others, hypothesis]))
        effect = hypothesis.named
        sizes = {parameter.name for parameter in effect.parameters if parameter.is_size}
        mirrored = {name: -value if name in sizes else value for name, value in values.items()}
        exact = _exact(values)
        joints = 1 if effect.shared else len(hypothesis.joints)

        def is_possible(known: Values, joint: int) -> bool:
            return effect.implausible(*({
                name: value[[joint]] if joints > 1 and np.shape(value)[:1] == (joints,) else value
                for name, value in part.items()} for part in (known, exact, level))) is None

        return all(not is_possible(values, joint) and is_possible(mirrored, joint)
                   for joint in range(joints))

    def _inflation(self, model: Hypotheses) -> float:
        return requirement_of(self.pool, model, self.rules).inflation

    def _follows_its_law(self, hypothesis: Hypothesis, others: Hypotheses) -> bool:
        """Return whether a torque at another time follows its law beyond the first order.

        Errors of the other causes count as noise. If neither this law nor another passes like that,
        this one is looked at again with the error of its own torque as noise, too.
        """
        projection = self.projections.beside(others)

        def follows(item: Hypothesis, known: Hypotheses) -> bool:
            time = float(self.pool.solution([*others, item]).coefficients[-1][0, 0])
            return obeys(self.dithered, projection, item, time, self._inflation(known))

        if follows(hypothesis, others):
            return True
        laws = [self.candidates.best(effect, projection)
                for effect in self.candidates.library.values()
                if effect.retimes and effect is not hypothesis.effect]
        return follows(hypothesis, (*others, hypothesis)) and not any(
            law is not None and follows(law.hypothesis, others) for law in laws)

    def _implausible(self, hypothesis: Hypothesis, others: Hypotheses, fit: Fit) -> str | None:
        """Return why the values of a hypothesis, the last of a fit, are not those of a machine."""
        effect = hypothesis.named
        if effect.fixed_coefficients:
            found = fixed_sizes(self.pool.evidence, hypothesis, fit, len(others))
            low, high = effect.fixed_range
            if found.min() < low or found.max() > high:
                shares = dict.fromkeys((f'{found.min():.2f}', f'{found.max():.2f}'))
                return f'its torque comes out at {" to ".join(shares)} of what it must be'
        values, level = self._values(hypothesis, fit)
        reason = effect.implausible(values, _exact(values), level)
        if reason is not None:  # deviations, which take far longer to compute, only excuse
            _, std = estimated(self.pool.evidence, hypothesis, fit, len(others),
                               self._inflation((*others, hypothesis)))
            reason = effect.implausible(values, std, level)
        if reason is None and order_name(effect) is None:
            reason = self._driven_beside(others, fit, self._inflation((*others, hypothesis)))
        return reason

    def _values(self, hypothesis: Hypothesis, fit: Fit) -> tuple[Values, Base]:
        """Return the values of a hypothesis, the last of a fit, and those of the base."""
        effect, evidence = hypothesis.named, self.pool.evidence
        acting = list(range(evidence.observations.joints) if effect.shared
                      else hypothesis.joints)
        state = evidence.observations.runs[0].state
        # a parameter that the motion does not show is known, or zero
        level = {name: value[acting] for name, value in state.known.values.items()}
        level.update({term.name: np.full(len(acting), value)
                      for term, value in zip(evidence.observations.terms, fit.base)})
        if evidence.observations.of_axis:
            level[FAST] = np.full(len(acting), self._fast_speed)
        return effect.values(fit.coefficients[-1][:, acting], hypothesis.shape), level

    @property
    def _fast_speed(self) -> float:
        """The speed that a twentieth of the motion exceeds."""
        return float(np.quantile(np.abs(np.concatenate(
            [run.speed for run in self.pool.evidence.observations.runs])), 0.95))

    def _driven_beside(self, others: Hypotheses, fit: Fit, inflation: float) -> str | None:
        """Return why the friction of an axis beside a cause, the last of a fit, is none, or None.

        At a speed that hardly changes, a constant torque and friction cannot be told apart, so one
        may take the place of the other. A periodic torque cannot and is not checked.
        """
        observations = self.pool.evidence.observations
        if not observations.of_axis:
            return None
        speed = self._fast_speed
        size = len(observations.terms)
        before = self.pool.solution(others).base
        for own in (0.0, speed):
            weight = np.array([{'coulomb_friction': 1.0, 'viscous_friction': own}.get(
                term.name, 0.0) for term in observations.terms])
            level = float(weight @ fit.base)
            std = float(np.sqrt(inflation * weight @ fit.covariance[:size, :size] @ weight))
            if level < -CERTAIN * std and level < weight @ before:
                return (f'beside it friction comes out as {level:.3g} N m at {own:.3g} rad/s, '
                        f'which drives')
        return None


def _exact(values: Values) -> Values:
    """Return the standard deviations of values that are exact."""
    return {name: np.zeros(np.shape(value)) for name, value in values.items()}
