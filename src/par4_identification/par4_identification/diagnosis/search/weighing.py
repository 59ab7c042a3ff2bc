"""What a cause gains beside others, and whether that is as much as it must gain."""

from __future__ import annotations

from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.law_error import law_error_of
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.projection import Projection, Projections
from par4_identification.diagnosis.evidence.unnamed import Kind, Ranges
from par4_identification.diagnosis.search.causes import Model, named_of
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

    def gains(self, cause: Hypothesis, others: Model) -> tuple[float, float]:
        """Return the gain in log-likelihood beside others on rows to fit and on rows held out."""
        without, together = self._pool.fit(others), self._pool.fit((*others, cause))
        return (0.5 * (without.fit_squares - together.fit_squares),
                0.5 * (without.heldout_squares - together.heldout_squares))

    def sound_gains(self, cause: Hypothesis, others: Model) -> tuple[float, float]:
        """Return `gains` less what encoder counts may have contributed."""
        fit_gain, gain = self.gains(cause, others)
        by_counts = self._by_counts(cause, others)
        return fit_gain - by_counts[0], gain - by_counts[1]

    def requirement(self, model: Model, cause: Hypothesis | None = None) -> Requirement:
        """Return what a cause must gain in a model."""
        return requirement_of(self._pool, model, self._rules, cause)

    def standing(self, cause: Hypothesis, others: Model) -> float:
        """Return what a cause gains beside others over what it must gain, on the worse data.

        A name that does not gain what any error of the other names could make of it is looked at
        beside the errors that they can have.
        """
        needed = self.requirement((*others, cause), cause)
        fit_gain, gain = self.sound_gains(cause, others)
        if isinstance(cause.effect, Kind):
            return min(fit_gain / needed.fit, gain / (needed.heldout + self._rules.margin))
        least_fit, least = needed.beside_law_error
        standing = min(fit_gain / needed.fit, gain / needed.heldout)
        hopeless = min(fit_gain / least_fit, gain / least) <= 1.0
        if standing > 1.0 or hopeless or not named_of(others):
            return standing
        return max(standing, self._standing_beside_law_error(cause, others, needed))

    def _standing_beside_law_error(self, cause: Hypothesis, others: Model, needed: Requirement
                                   ) -> float:
        """Return the same where the laws of the other names may be wrong in any of their ways.

        Rows that are left with more than noise are worth no more than noise of that size.
        """
        beside = (*others, self._law_error(others))
        fit_gain, gain = self.gains(cause, beside)
        by_counts = self._by_counts(cause, others)
        fit_excess, excess = self._pool.excess(
            (*beside, cause), self._joints if cause.effect.shared else cause.joints)
        least_fit, least = needed.beside_law_error
        return min((fit_gain - by_counts[0]) / fit_excess / least_fit,
                   (gain - by_counts[1]) / excess / least)

    def _by_counts(self, cause: Hypothesis, others: Model) -> tuple[float, float]:
        """Return what encoder counts may contribute to the gains."""
        imitated = self._counts.imitate(self.beside(others), cause)
        return imitated, imitated * self._pool.heldout.rows / max(self._pool.evidence.rows, 1)

    def beside(self, model: Model) -> Projection:
        """Return what a model leaves of the rows to fit."""
        return self._projections.beside(model)

    def _law_error(self, model: Model) -> Hypothesis:
        """Return what the named causes of a model may get wrong; made once."""
        key = frozenset(item.key for item in model)
        if key not in self._law_errors:
            fit, named = self._pool.solution(model), named_of(model)
            self._law_errors[key] = Hypothesis(law_error_of(
                named, [fit.coefficients[model.index(item)] for item in named],
                self._ranges, self._rules.named_error), {}, self._joints)
        return self._law_errors[key]
