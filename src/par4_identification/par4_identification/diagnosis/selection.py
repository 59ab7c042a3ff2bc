"""Forward selection of causes, each accepted only on every kind of evidence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtrc

from par4_dynamics.effects.effect import Effect
from par4_dynamics.effects.elastic_transmission import ElasticTransmission
from par4_identification.diagnosis.estimates import effect_parameters
from par4_identification.diagnosis.evidence import (
    Evidence,
    Fit,
    Hypothesis,
    Projection,
    gather,
    project,
    solve,
    transfer_error,
)
from par4_identification.diagnosis.holdout import Blocks, Gain
from par4_identification.diagnosis.law import Dithered
from par4_identification.diagnosis.observations import Observations
from par4_identification.diagnosis.rules import Rules
from par4_identification.diagnosis.shapes import best_shape, self_consistent, shapes_of
from par4_identification.diagnosis.swing import GRID, compliances

HALF_BLOCK = 100
"""Rows after which the two halves alternate, so that both see slow and fast motion."""


@dataclass(frozen=True)
class Found:
    """An accepted cause.

    Attributes:
        hypothesis: effect, shape, joints.
        likelihood_ratio: twice its gain in log-likelihood given the other causes.
        p_value: family-wise.
        gain: on held-out rows, over the model without it.
        rivals: of other names, which explain it as well.
    """

    hypothesis: Hypothesis
    likelihood_ratio: float
    p_value: float
    gain: Gain
    rivals: tuple[Hypothesis, ...] = ()

    @property
    def twins(self) -> tuple[str, ...]:
        """The rivals' names."""
        return tuple(rival.effect.name for rival in self.rivals)


@dataclass(frozen=True)
class Rejected:
    """A candidate that was strong enough to be looked at, and why it is not a cause."""

    label: str
    reason: str


@dataclass
class Selection:
    """Causes found and candidates rejected, in the order in which it happened.

    Attributes:
        found: the causes.
        rejected: whatever was looked at closely.
        shadows: names that were taken away as what the causes get wrong of each other.
    """

    found: list[Found] = field(default_factory=list)
    rejected: list[Rejected] = field(default_factory=list)
    shadows: set[str] = field(default_factory=set)

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """The causes' hypotheses."""
        return [item.hypothesis for item in self.found]


@dataclass(frozen=True)
class Candidate:
    """The best shape of one effect given the model so far."""

    hypothesis: Hypothesis
    likelihood_ratio: float
    freedoms: int
    tried: int

    def p_value(self, family: int) -> float:
        """Return the family-wise p-value among `family` tests."""
        return float(min(1.0, chdtrc(self.freedoms, self.likelihood_ratio) * family))

    def score(self, rows: int) -> float:
        """Return the evidence: BIC with a penalty for the shapes tried."""
        return (self.likelihood_ratio - self.freedoms * np.log(rows)
                - 2.0 * np.log(max(self.tried, 1)))


class Selector:
    """Searches the library on fit rows and confirms on held-out rows.

    Args:
        library: effects that may be named.
        evidence: whitened fit rows.
        heldout: rows that take no part in any fit.
        blocks: of the held-out rows.
        rules: what a cause must show.
        dithered: what encoder counts may have made of the motion.
    """

    def __init__(self, library: Mapping[str, Effect], evidence: Evidence, heldout: Observations,
                 blocks: Blocks, rules: Rules, dithered: Dithered) -> None:
        self.library = library
        self.evidence = evidence
        self.heldout = gather(heldout, replace(
            evidence.whitener, valid=tuple(run.valid for run in heldout.runs)))
        self.blocks = blocks
        self.rules = rules
        self._dithered = dithered
        self._searched: dict[tuple, Candidate | None] = {}
        self._shapes = {name: shapes_of(evidence.observations, effect)
                        for name, effect in library.items()}
        self._family = sum(len(shapes) for shapes in self._shapes.values())
        self._joints = tuple(range(evidence.observations.joints))

    def best(self, effect: Effect, projection: Projection) -> Candidate | None:
        """Return the best shape of an effect on all joints given a projection; searched once."""
        key = (effect.name, frozenset(item.key for item in projection.hypotheses))
        if key not in self._searched:
            self._searched[key] = self._search(effect, projection)
        return self._searched[key]

    def _search(self, effect: Effect, projection: Projection) -> Candidate | None:
        if isinstance(effect, ElasticTransmission):
            return self._twisting(effect, projection)
        shapes = self._shapes[effect.name]
        if not shapes:
            return None

        def ratio(shape):
            return projection.gain(Hypothesis(effect, shape, self._joints))

        shape, best = best_shape(effect, shapes, ratio)
        if effect.expanded:
            shape = self_consistent(projection, effect, shape)
            best = ratio(shape)
        hypothesis = Hypothesis(effect, shape, self._joints)
        return Candidate(hypothesis, best, self._freedoms(hypothesis), len(shapes))

    def _twisting(self, effect: ElasticTransmission, projection: Projection) -> Candidate | None:
        """Return the transmissions that twist most like the residual, if any do.

        Looked for only where the first order of a twist explains something.
        """
        if projection.gain(Hypothesis(effect, {}, self._joints)) < 2.0 * self.rules.least_gain:
            return None
        found = compliances(projection)
        if found is None:
            return None
        compliance, ratio = found
        hypothesis = Hypothesis(effect, effect.expansion(compliance), self._joints)
        return Candidate(hypothesis, ratio, len(compliance), len(GRID) * len(compliance))

    def _freedoms(self, hypothesis: Hypothesis) -> int:
        rows = self.evidence.observations.effect_rows(hypothesis.effect, hypothesis.shape)
        width = rows[0].shape[2]
        return (width if hypothesis.effect.shared else width * len(hypothesis.joints)) + len(
            hypothesis.shape)

    def run(self) -> Selection:
        """Return the causes: add the best, re-test the others, until nothing is left."""
        selection = Selection()
        refused: set[str] = set()
        visited: set[frozenset[str]] = set()
        while len(selection.found) < self.rules.most:
            projection = project(self.evidence, selection.hypotheses)
            named = {item.effect.name for item in selection.hypotheses}
            candidates = [self.best(effect, projection) for name, effect in self.library.items()
                          if name not in named | refused]
            candidates = [item for item in candidates if item is not None
                          and self._is_evident(item)]
            if not candidates:
                break
            candidate = self._simplest_of_the_best(candidates)
            candidate = self._keep_acting_joints(candidate, projection)
            name = candidate.hypothesis.effect.name
            verdict = self._confirm(candidate, selection.hypotheses)
            if isinstance(verdict, Rejected):
                selection.rejected.append(verdict)
                refused.add(name)
                continue
            trial = replace_found(selection, [*selection.found, verdict])
            self._retest(trial)
            state = frozenset(item.effect.name for item in trial.hypotheses)
            if state in visited:
                refused.add(name)
                continue
            visited.add(state)
            selection = trial
            refused.clear()  # beside another cause they may look better
        self._prune(selection)
        selection.found.sort(key=lambda item: -item.likelihood_ratio)
        return selection

    def _is_evident(self, candidate: Candidate) -> bool:
        """Return whether a candidate is no chance and worth its parameters."""
        return (candidate.p_value(self._family) < self.rules.p_value
                and candidate.likelihood_ratio > 2.0 * self.rules.least_gain
                and candidate.score(self.evidence.rows) > 0.0)

    def _simplest_of_the_best(self, candidates: list[Candidate]) -> Candidate:
        """Return the best candidate; of equals, the first of the library, which is the simplest."""
        scores = [item.score(self.evidence.rows) for item in candidates]
        return next(item for item, score in zip(candidates, scores)
                    if score > max(scores) - self.rules.equal_margin)

    def _keep_acting_joints(self, candidate: Candidate, projection: Projection) -> Candidate:
        """Return the candidate without the joints that do not need it beside the others.

        Joints share the base parameters, so that an effect on one leaves a trace on all: joints
        are taken away one by one, the least needed first, as long as that costs nothing.
        """
        hypothesis = candidate.hypothesis
        if hypothesis.effect.shared:
            return candidate
        width = (candidate.freedoms - len(hypothesis.shape)) // len(hypothesis.joints)
        ratio = candidate.likelihood_ratio
        while len(hypothesis.joints) > 1:
            trials = []
            for joint in hypothesis.joints:
                rest = replace(hypothesis, joints=tuple(
                    other for other in hypothesis.joints if other != joint))
                trials.append((projection.gain(rest), rest))
            left, rest = max(trials, key=lambda trial: trial[0])
            lost = ratio - left
            needed = chdtrc(width, lost) * len(self._joints) < self.rules.joint_p_value
            if needed and lost > self.rules.joint_share * ratio:
                break
            hypothesis, ratio = rest, left
        return Candidate(hypothesis, ratio, self._freedoms(hypothesis), candidate.tried)

    def _confirm(self, candidate: Candidate, others: Sequence[Hypothesis]) -> Found | Rejected:
        hypothesis = candidate.hypothesis
        together = [*others, hypothesis]
        fit = solve(self.evidence, together)
        gain = self.heldout_gain(hypothesis, others)
        if gain.share < self.rules.holdout_gain or gain.low <= 0.0:
            return Rejected(hypothesis.label, f'removes {gain.share:.1%} of the held-out squared '
                            f'error (95 % interval {gain.low:.1%} to {gain.high:.1%})')
        share = self._torque_share(hypothesis, fit.coefficients[-1], others)
        if share < self.rules.least_share:
            return Rejected(hypothesis.label, f'what shows of its torque is {share:.2%} of the '
                            f'measured one, less than sampling and filters resolve')
        reason = self._implausible(hypothesis, fit, len(together) - 1)
        if reason:
            return Rejected(hypothesis.label, reason)
        if not self._obeys(hypothesis, others, fit):
            return Rejected(hypothesis.label, 'the torque is read at another time, but in second '
                            'order of that time it does not follow this law')
        agreement = self._agreement(together)
        if agreement < self.rules.agreement:
            return Rejected(hypothesis.label, f'its estimates from the two halves of the data '
                            f'disagree (cosine {agreement:.2f})')
        error = transfer_error(self.evidence, self.heldout, together)
        if error > self.rules.transfer * hypothesis.effect.tolerance:
            return Rejected(hypothesis.label, f'its estimates from the data to learn from and from '
                            f'those held out differ by {error:.0%} of its torque')
        return Found(hypothesis, candidate.likelihood_ratio, candidate.p_value(self._family), gain)

    def heldout_gain(self, hypothesis: Hypothesis, others: Sequence[Hypothesis]) -> Gain:
        """Return what a hypothesis fitted beside others removes of the held-out rows."""
        before, after = (self.heldout.left(part, solve(self.evidence, part))
                         for part in (others, [*others, hypothesis]))
        return self.blocks.whitened_gain(before, after)

    def _torque_share(self, hypothesis: Hypothesis, coefficients: np.ndarray,
                      others: Sequence[Hypothesis]) -> float:
        """Return the visible rms torque of an effect over the measured one, at most of a joint."""
        effect_rows = self.heldout.observations.effect_rows(hypothesis.effect, hypothesis.shape)
        effect, torque = np.zeros(len(self._joints)), np.zeros(len(self._joints))
        for run, rows in zip(self.heldout.observations.runs, effect_rows):
            own = np.einsum('mjk,kj->mj', rows, coefficients)
            effect += np.sum(np.where(run.valid, own, 0.0) ** 2, axis=0)
            torque += np.sum(np.where(run.valid, run.tau, 0.0) ** 2, axis=0)
        visible = project(self.evidence, others).left_share(
            self.evidence.columns(hypothesis), hypothesis.stacked(coefficients))
        return float(visible * np.max(np.sqrt(effect / np.maximum(torque, 1e-30))))

    def _implausible(self, hypothesis: Hypothesis, fit: Fit, index: int) -> str | None:
        effect = hypothesis.effect
        acting = list(hypothesis.joints)
        values = effect.values(fit.coefficients[index][:, acting], hypothesis.shape)
        base = {term.name: np.full(len(acting), value)
                for term, value in zip(self.evidence.observations.terms, fit.base)}
        if effect.fixed_coefficients:
            # their columns have the nominal friction; what they must reach is the refitted one
            nominal = self.evidence.observations.runs[0].state.nominal
            level = base['coulomb_friction'] / nominal.values['coulomb_friction'][acting]
            found = fit.coefficients[index][:, acting] / level
            low, high = self.rules.fixed_range
            if found.min() < low or found.max() > high:
                return (f'its torque comes out at {found.min():.2f} to {found.max():.2f} of what '
                        f'it must be')
        parameters = effect_parameters(self.evidence, hypothesis, fit, index)
        std = {name: np.broadcast_to(parameter.std, values[name].shape)
               for name, parameter in parameters.items()}
        return effect.implausible(values, std, base)

    def _obeys(self, hypothesis: Hypothesis, others: Sequence[Hypothesis], fit: Fit) -> bool:
        if not hypothesis.effect.retimes:
            return True
        time = float(fit.coefficients[len(others)][0, 0])
        return self._dithered.obeys(project(self.evidence, others), hypothesis, time)

    def _agreement(self, hypotheses: Sequence[Hypothesis]) -> float:
        """Return the cosine between the last effect's visible torque as two halves estimate it."""
        columns = self.evidence.columns(hypotheses[-1])
        rest = self.evidence.design(hypotheses[:-1])
        estimates = []
        joints = self.evidence.observations.joints
        half = np.tile(np.arange(len(columns) // joints) // HALF_BLOCK % 2 == 0, joints)
        for rows in (half, ~half):
            design = np.hstack([rest[rows], columns[rows]])
            scale = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
            values = np.linalg.lstsq(design / scale, self.evidence.target[rows], rcond=1e-9)[0]
            estimates.append((values / scale)[rest.shape[1]:])
        # of its torque what the rest of the model cannot follow: the other part is anybody's
        visible = project(self.evidence, hypotheses[:-1]).rest(columns)
        first, second = (visible @ estimate for estimate in estimates)
        return float(first @ second / max(np.linalg.norm(first) * np.linalg.norm(second), 1e-30))

    def _retest(self, selection: Selection) -> None:
        """Look at every cause but the newest again, beside the others: shape, joints, need."""
        for item in list(selection.found[:-1]):
            others = [other.hypothesis for other in selection.found if other is not item]
            projection = project(self.evidence, others)
            candidate = self.best(item.hypothesis.effect, projection)
            verdict: Found | Rejected = Rejected(item.hypothesis.label,
                                                 'explained by another cause')
            if candidate and self._is_evident(candidate):
                verdict = self._confirm(self._keep_acting_joints(candidate, projection), others)
            position = selection.found.index(item)
            if isinstance(verdict, Rejected):
                selection.rejected.append(verdict)
                selection.found.pop(position)
            else:
                selection.found[position] = verdict

    def _prune(self, selection: Selection) -> None:
        """Take away causes that are little more than what the others get wrong of their torque.

        What the others gain is counted anew.
        """
        while len(selection.found) > 1:
            whole = self.evidence_of(selection.hypotheses)
            weakest, reason = None, ''
            for item in selection.found:
                others = [other for other in selection.hypotheses if other is not item.hypothesis]
                own = whole - self.evidence_of(others)
                if weakest is not None and own >= weakest[0]:
                    continue
                if own < self.rules.least_evidence * whole:
                    weakest, reason = (own, item), (
                        f'what it explains is {own / whole:.2%} of what all causes explain, no '
                        f'more than they may get wrong of each other')
                elif self._alone(item.hypothesis, others) < self.rules.least_alone:
                    weakest, reason = (own, item), 'its torque is that of another cause'
            if weakest is None:
                break
            selection.rejected.append(Rejected(weakest[1].hypothesis.label, reason))
            selection.found.remove(weakest[1])
            selection.shadows.add(weakest[1].hypothesis.effect.name)
        for index, item in enumerate(selection.found):
            others = [other for other in selection.hypotheses if other is not item.hypothesis]
            selection.found[index] = replace(
                item, gain=self.heldout_gain(item.hypothesis, others),
                likelihood_ratio=project(self.evidence, others).gain(item.hypothesis))

    def evidence_of(self, hypotheses: Sequence[Hypothesis]) -> float:
        """Return how much less hypotheses leave of the whitened target than the base, squared."""
        left = [project(self.evidence, part).residual for part in ((), hypotheses)]
        return float(left[0] @ left[0] - left[1] @ left[1])

    def _alone(self, hypothesis: Hypothesis, others: Sequence[Hypothesis]) -> float:
        """Return the share (rms) of an effect's visible torque that the others do not have."""
        fit = solve(self.evidence, [*others, hypothesis])
        columns = self.evidence.columns(hypothesis)
        coefficients = hypothesis.stacked(fit.coefficients[-1])
        beside, visible = (project(self.evidence, part).left_share(columns, coefficients)
                           for part in (others, ()))
        return beside / max(visible, 1e-30)

    def with_twins(self, selection: Selection) -> Selection:
        """Return the selection with the names that could stand in for each cause."""
        found = []
        for item in selection.found:
            others = [other for other in selection.hypotheses if other is not item.hypothesis]
            named = {other.effect.name for other in others} | {item.hypothesis.effect.name}
            projection = project(self.evidence, others)
            own = projection.gain(item.hypothesis)
            rivals = []
            for name, effect in self.library.items():
                if name in named:
                    continue
                rival = self.best(effect, projection)
                # which of two times it is only the law tells: counts weigh on a lag's column
                one_time = effect.retimes and item.hypothesis.effect.retimes
                if rival is None or (own - rival.likelihood_ratio > 2.0 * self.rules.twin_margin
                                     and not one_time):
                    continue
                fit = solve(self.evidence, [*others, rival.hypothesis])
                if (self._implausible(rival.hypothesis, fit, len(others)) is not None
                        or not self._obeys(rival.hypothesis, others, fit)):
                    continue
                gain = self.heldout_gain(rival.hypothesis, others)
                if gain.share > 0.5 * item.gain.share:
                    rivals.append(rival.hypothesis)
            found.append(replace(item, rivals=tuple(rivals)))
        return replace_found(selection, found)

    def richest(self) -> list[Hypothesis]:
        """Return every effect at its best shape: what the noise model must not swallow."""
        projection = project(self.evidence, [])
        candidates = (self.best(effect, projection) for effect in self.library.values())
        return [item.hypothesis for item in candidates if item is not None]


def replace_found(selection: Selection, found: list[Found]) -> Selection:
    """Return a selection with other causes and the same rejections."""
    return Selection(list(found), list(selection.rejected), set(selection.shadows))
