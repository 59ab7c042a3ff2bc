"""What a cause gains beside others, and whether that is enough."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import Fit, pinned
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.kind_functions import Ranges
from par4_identification.diagnosis.evidence.law_error import factors_of, law_error_of, put_in
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.projection import Projection, Projections
from par4_identification.diagnosis.search.causes import Hypotheses, named_of
from par4_identification.diagnosis.search.counts import Counts
from par4_identification.diagnosis.search.requirement import Requirement, requirement_of
from par4_identification.diagnosis.search.rules import Rules


class Weighing:
    """Gains of causes in log-likelihood, and what they must exceed.

    Args:
        pool: fits.
        projections: of the same rows.
        rules: what a cause must show.
        counts: what encoder counts may contribute.
        ranges: scales of the motion.
    """

    def __init__(self, pool: Pool, projections: Projections, rules: Rules, counts: Counts,
                 ranges: Ranges) -> None:
        self._pool = pool
        self._projections = projections
        self._rules = rules
        self._counts = counts
        self._ranges = ranges
        self._joints = tuple(range(pool.evidence.observations.joints))
        self._law_errors: dict[frozenset[tuple[object, ...]], Hypothesis] = {}

    @property
    def _knows_the_machine(self) -> bool:
        """Whether it is a Par4; the laws of an axis, which may be any machine, may err anyhow."""
        return not self._pool.evidence.observations.of_axis

    @cached_property
    def _factors(self) -> list[tuple[Evidence, list[np.ndarray]]]:
        """What torques may be wrong by, on the rows to fit and on the rows held out."""
        return [(part, factors_of(part.observations, self._ranges))
                for part in (self._pool.evidence, self._pool.heldout)]

    def gains(self, cause: Hypothesis, others: Hypotheses) -> tuple[float, float]:
        """Return the gain in log-likelihood beside others, on fitted and on held-out rows."""
        without, together = self._pool.fit(others), self._pool.fit((*others, cause))
        return (0.5 * (without.fit_squares - together.fit_squares),
                0.5 * (without.heldout_squares - together.heldout_squares))

    def sound_gains(self, cause: Hypothesis, others: Hypotheses,
                    needed: tuple[float, float] = (np.inf, np.inf)) -> tuple[float, float]:
        """Return `gains` less what encoder counts may have contributed.

        Where both gains are beyond what is needed in any case, that is known by one draw only.
        """
        fit_gain, gain = self.gains(cause, others)
        spare = min(fit_gain - needed[0], (gain - needed[1]) / self._heldout_share)
        by_counts = self._by_counts(cause, others, spare)
        return fit_gain - by_counts[0], gain - by_counts[1]

    def corrected(self, fit: Fit) -> Fit:
        """Return a fit with the values that the answer tells.

        The bias that encoder counts make is taken out of them. A torque that is not linear in its
        values has those at which it was fitted, also afterwards: what counts make of loads that
        swing is no matter of columns (`verdict/swinging_loads.py`).
        """
        evidence = self._pool.evidence
        return pinned(evidence, self._counts.corrected(evidence, pinned(evidence, fit)),
                      retimed=False)

    def requirement(self, model: Hypotheses, cause: Hypothesis | None = None) -> Requirement:
        """Return what a cause must gain in a model."""
        return requirement_of(self._pool, model, self._rules, cause)

    def standing(self, cause: Hypothesis, others: Hypotheses) -> float:
        """Return the ratio of what a cause gains beside others to what it must gain.

        It is the smaller of the ratios on fitted and on held-out rows. A name gets a second chance
        if it fails only because an error of the other names might look like it: it is then weighed
        beside the errors that their laws can have.
        """
        needed = self.requirement((*others, cause), cause)
        unnamed = isinstance(cause.effect, Kind)
        both = needed.fit, needed.heldout + (self._rules.margin if unnamed else 0.0)
        fit_gain, gain = self.sound_gains(cause, others, both)
        standing = min(fit_gain / both[0], gain / both[1])
        if unnamed:
            return standing
        least_fit, least = needed.beside_law_error
        hopeless = min(fit_gain / least_fit, gain / least) <= 1.0
        if standing > 1.0 or hopeless or not self._knows_the_machine:
            return standing
        return max(standing, self._standing_beside_law_error(cause, others, needed))

    def _standing_beside_law_error(self, cause: Hypothesis, others: Hypotheses, needed: Requirement
                                   ) -> float:
        """Return the same beside the errors that the laws of the other names can have.

        If the model leaves more than noise, the size of what it leaves takes the place of the
        noise, so that a weak cause waits until the strong ones are known.
        """
        beside = (*others, *self._law_error(others))
        gains, by_counts = self.gains(cause, beside), self._by_counts(cause, others)
        left = self._pool.fit((*beside, cause)).squares
        rows = self._pool.evidence.rows, self._pool.heldout.rows
        return min((gains[part] - by_counts[part]) / max(1.0, left[part] / max(rows[part], 1))
                   / needed.beside_law_error[part] for part in (0, 1))

    def _by_counts(self, cause: Hypothesis, others: Hypotheses, spare: float = 0.0
                   ) -> tuple[float, float]:
        """Return what encoder counts may contribute to the gains; see `Counts.imitate`."""
        imitated = self._counts.imitate(self.beside(others), cause, spare)
        return imitated, imitated * self._heldout_share

    @cached_property
    def _heldout_share(self) -> float:
        """Rows held out over rows to fit."""
        return max(self._pool.heldout.rows, 1) / max(self._pool.evidence.rows, 1)

    def beside(self, model: Hypotheses) -> Projection:
        """Return what a model leaves of the rows to fit."""
        return self._projections.beside(model)

    def _law_error(self, model: Hypotheses) -> Hypotheses:
        """Return what the named causes of a model may get wrong, if it has any; made once."""
        named = named_of(model)
        key = frozenset(item.key for item in model)
        if named and key not in self._law_errors:
            error, fit = law_error_of(self._rules.named_error), self._pool.solution(model)
            coefficients = [fit.coefficients[model.index(item)] for item in named]
            for part, factors in self._factors:
                put_in(part, error, named, coefficients, factors)
            self._law_errors[key] = Hypothesis(error, {}, self._joints)
        return (self._law_errors[key],) if named else ()
