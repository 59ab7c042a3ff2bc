"""The search for causes: names first, then unnamed causes, each tested again beside the others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from par4_identification.diagnosis.evidence.dithered import Dithered
from par4_identification.diagnosis.evidence.fit import residuals
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.pool import Fitted, Pool
from par4_identification.diagnosis.evidence.projection import Projections
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.search.belief import Belief
from par4_identification.diagnosis.search.candidates import Candidate, Candidates, price_of_shapes
from par4_identification.diagnosis.search.causes import (
    Hypotheses,
    named_of,
    names_of,
    others_of,
    unnamed_of,
)
from par4_identification.diagnosis.search.counts import Counts
from par4_identification.diagnosis.search.joints import (
    choices,
    with_acting_joints,
    with_needed_joints,
)
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.simplicity import (
    BY_CHANCE,
    best_first,
    simplest_first,
)
from par4_identification.diagnosis.search.weighing import Weighing

SHARED = 0.5
"""Share of what a name explains alone below which the other causes explain most of that, too."""
NEARLY = 0.8
"""Share of what a name explains from which on fewer joints of it, or another name, may be all that
the machine has of it, beside a cause that is not found yet."""
LEFT_BY_FILTERS = 0.25
"""Share of what is left that a kind must explain if filters leave some of it in every record."""


@dataclass(frozen=True)
class Rejected:
    """A candidate that was looked at closely, and why it is no cause."""

    label: str
    reason: str


@dataclass(frozen=True)
class Rival:
    """A hypothesis that could explain the data in the place of a cause.

    Attributes:
        hypothesis: a name or an unnamed cause; None for no cause at all.
        margin: log-likelihood of the cause over this, on held-out rows.
        fit_margin: the same on the fitted rows.
        believable: False for a name whose values or law no machine can have.
    """

    hypothesis: Hypothesis | None
    margin: float
    fit_margin: float
    believable: bool


@dataclass
class Journal:
    """The hypotheses that were looked at closely and rejected, in that order."""

    rejected: list[Rejected] = field(default_factory=list)

    def reject(self, hypothesis: Hypothesis, reason: str) -> None:
        """Note why a hypothesis is no cause."""
        self.rejected.append(Rejected(hypothesis.label, reason))

    def beside(self, told: Iterable[str]) -> tuple[Rejected, ...]:
        """Return what was rejected, but for the labels that were told in the end."""
        labels = set(told)
        return tuple(item for item in self.rejected if item.label not in labels)


class Search:
    """Finds causes: fitted rows suggest them, held-out rows confirm them.

    Args:
        candidates: the library.
        pool: fits.
        rules: what a cause must show.
        dithered: what encoder counts may have made of the motion.
        kinds: of unnamed causes.
    """

    def __init__(self, candidates: Candidates, pool: Pool, rules: Rules, dithered: Dithered,
                 kinds: Kinds) -> None:
        self.candidates = candidates
        self.pool = pool
        self.rules = rules
        self.journal = Journal()
        projections = Projections(pool.evidence)
        self.belief = Belief(candidates, pool, projections, rules, dithered)
        self.weighing = Weighing(pool, projections, rules, Counts(dithered), kinds.ranges)
        self._joints = tuple(range(pool.evidence.observations.joints))
        self._all_kinds = kinds
        self._kinds: tuple[Kind, ...] = ()

    def run(self, start: Hypotheses = ()) -> Hypotheses:
        """Return the causes; the search begins with those of an earlier one."""
        model = self.tested(start)
        visited: set[frozenset[str]] = {names_of(model)}
        refused: set[str] = set()
        while True:
            grown = self._with_a_name(model, refused) or self._with_unnamed(model, refused)
            step = (grown or self._with_a_swap(model, visited)
                    or self._with_several_instead(model, visited))
            if step is None:
                return model
            trial = self.tested(step)
            known = names_of(trial) in visited
            visited.add(names_of(trial))
            if not grown:  # a swap is noted even if it comes to nothing, or it is tried for ever
                visited.add(names_of(step))
            if (known or not self._does_as_well(trial, model)
                    or (grown and self._gives_names_away(trial, model))):
                refused |= names_of(grown or ()) - names_of(model)
                continue
            model = trial
            refused.clear()  # beside other causes a candidate may look better

    def with_nameless(self, model: Hypotheses) -> Hypotheses:
        """Return a model with the unnamed causes that explain what it leaves."""
        while grown := self._with_unnamed(model, set()):
            trial = self.tested(grown)
            if len(trial) <= len(model):
                break
            model = trial
        return model

    def _does_as_well(self, trial: Hypotheses, model: Hypotheses) -> bool:
        """Return whether a trial explains as much as the model from which a step led to it.

        For each cause that it dropped it may explain less by as much as chance makes.
        """
        dropped = len(names_of(model) - names_of(trial))
        loss = 0.5 * (sum(self.pool.fit(trial).squares) - sum(self.pool.fit(model).squares))
        return loss < dropped * (self.rules.evidence + self.rules.margin)

    def _gives_names_away(self, trial: Hypotheses, model: Hypotheses) -> bool:
        """Return whether a trial lost names to an unnamed cause that does little more than they.

        An unnamed function contains the columns of many laws, so that beside it none of them
        explains anything of its own. By the rules of a Par4, whose `Rules.better` is zero, it takes
        their place only if each of the coefficients that it has more is worth `Rules.price`: a wide
        function contains laws by being wide. By those of an axis a function of the speed, which
        contains every law of the speed, takes their place only if it explains `Rules.better` more
        than they do, and if none of them alone explains what it does, but for the share of it that
        may be wrong.
        """
        lost = [item for item in named_of(model) if item.effect.name not in names_of(trial)]
        new = [item for item in unnamed_of(trial) if item.effect.name not in names_of(model)]
        if not (lost and new):
            return False
        if not self.rules.better:
            more = self._width(trial) - self._width(model)
            gain = 0.5 * (sum(self.pool.fit(model).squares) - sum(self.pool.fit(trial).squares))
            return gain < self.rules.price * more
        if not all(item.effect.told_by_speeds for item in (*lost, *new)):
            return False
        before, after = self.pool.fit(model).heldout_squares, self.pool.fit(trial).heldout_squares
        if 0.5 * (before - after) < self.rules.better:
            return True
        kept = tuple(item for item in model if item not in lost)
        most = max(self.weighing.gains(item, kept)[1] for item in lost)
        whole = 0.5 * (self.pool.fit(kept).heldout_squares - after)
        return most > (1.0 - self.rules.unnamed_error ** 2) * whole

    def _with_a_name(self, model: Hypotheses, refused: set[str]) -> Hypotheses | None:
        """Return the model with the most likely name that can be confirmed.

        Of names that are as likely but for what chance and the times of readings make, the simplest
        is taken. So it is of names that would be told as twins, if held-out rows do not prefer the
        best of them.
        """
        by_times = 0.5 * self.pool.timing_squares[0]
        by_chance, twin = (max(least, by_times) for least in (BY_CHANCE, self.rules.twin))
        projection = self.weighing.beside(model)
        trimmed: dict[str, tuple[float, Hypothesis]] = {}
        while found := [item for item in self.candidates.all_of(
                projection, {*names_of(model), *refused}) if item.gain > self.rules.evidence]:
            # no score exceeds the gain on all joints
            most = 0.0
            for item in sorted(found, key=lambda item: -item.gain):
                if item.gain <= most - twin:
                    break
                name = item.hypothesis.effect.name
                if name not in trimmed:
                    trimmed[name] = self._trimmed(item, model)
                most = max(most, trimmed[name][0])
            if most <= 0.0:
                return None
            likely = [own for item in found if (own := trimmed.get(item.hypothesis.effect.name))
                      and own[0] > 0.0 and own[0] >= most - twin]
            best = max(likely, key=lambda own: own[0])[1]
            confirmed = self.weighing.gains(best, model)[1]
            near = [own for own in likely if own[0] > most - by_chance
                    or self.weighing.gains(own[1], model)[1] > confirmed - BY_CHANCE]
            _, hypothesis = min(
                near, key=lambda own: simplest_first(self.pool, own[1], most - own[0]))
            if self._is_confirmed(hypothesis, model):
                return (*model, hypothesis)
            refused.add(hypothesis.effect.name)
        return None

    def _trimmed(self, candidate: Candidate, model: Hypotheses) -> tuple[float, Hypothesis]:
        """Return a candidate with what it needs, and its log-likelihood less what chance gives.

        So many numbers, and the best of so many shapes, gain something by chance.
        """
        hypothesis = self._with_needed_joints(candidate.hypothesis, model)
        chance = 0.5 * self.pool.numbers(hypothesis) * float(np.log(self.pool.evidence.rows))
        gain, _ = self.weighing.gains(hypothesis, model)
        return gain - chance - price_of_shapes(candidate), hypothesis

    def _with_unnamed(self, model: Hypotheses, refused: set[str]) -> Hypotheses | None:
        """Return the model with the unnamed cause that explains most, if rows held out agree."""
        left = residuals(self.pool.evidence.observations, model, self.pool.solution(model))
        here = self.pool.fit(model)
        self._kinds = self._all_kinds.beside(self.pool.evidence.observations, left)
        found = []
        tried = [kind for kind in self._kinds if kind.name not in names_of(model) | refused]
        self.pool.prepare([Hypothesis(kind, {}, self._joints) for kind in tried])
        for kind in tried:
            hypothesis = Hypothesis(kind, {}, self._joints)
            trial = (*model, with_acting_joints(self.pool, self.rules, hypothesis, model))
            gain = 0.5 * (here.heldout_squares - self.pool.fit(trial).heldout_squares)
            if kind.left_by_filters and gain < LEFT_BY_FILTERS * here.heldout_squares:
                continue
            found.append((self._loss(trial), trial[-1]))
        if not found:
            return None
        _, hypothesis = min(found, key=lambda item: best_first(self.pool, item[1], item[0]))
        gain = self.weighing.sound_gains(hypothesis, model)[1]
        if gain <= self.weighing.requirement((*model, hypothesis)).heldout + self.rules.margin:
            return None
        return (*model, hypothesis)

    def _with_needed_joints(self, hypothesis: Hypothesis, others: Hypotheses) -> Hypothesis:
        return with_needed_joints(self.pool, self.belief, hypothesis, others)

    def _is_confirmed(self, hypothesis: Hypothesis, others: Hypotheses) -> bool:
        """Return whether a candidate could be real and is confirmed by rows held out."""
        reason = self.belief.objection(hypothesis, others)
        if reason is None:
            if self.weighing.standing(hypothesis, others) > 1.0:
                return True
            needed = self.weighing.requirement((*others, hypothesis), hypothesis)
            fit_gain, gain = self.weighing.sound_gains(hypothesis, others)
            if fit_gain <= needed.fit:
                reason = (f'explains {fit_gain:.0f} in log-likelihood, less than the '
                          f'{needed.fit:.0f} that chance and the other causes may make')
            elif gain <= needed.heldout:
                reason = (f'gains {gain:.0f} in log-likelihood on rows held out, less than the '
                          f'{needed.heldout:.0f} that chance and the other causes may make')
        if reason is not None:
            self.journal.reject(hypothesis, reason)
        return reason is None

    def tested(self, model: Hypotheses) -> Hypotheses:
        """Return a model without the causes that are superfluous beside the others.

        The best shape and the joints of each cause are sought again. Then the cause that falls
        shortest of what it must gain is removed, and so on, until none falls short. A cause that
        cannot be real beside the others gives way to a twin that can, if it has one.
        """
        gone: set[str] = set()
        while model:
            model = tuple(self._adjusted(item, others_of(model, item)) for item in model)
            standings = [self.weighing.standing(item, others_of(model, item)) for item in model]
            worst = min(standings)
            item = model[standings.index(worst)]
            refused = self._unbelievable(model) if worst > 1.0 else (
                item, 'explains nothing of its own beside the other causes')
            if refused is None:
                return model
            self.journal.reject(*refused)
            gone.add(refused[0].effect.name)
            others = others_of(model, refused[0])
            twin = self._twin_of(refused[0], others, gone) if worst > 1.0 else None
            model = others if twin is None else (*others, twin)
        return model

    def _twin_of(self, cause: Hypothesis, others: Hypotheses, gone: set[str]) -> Hypothesis | None:
        """Return the name that can be real and explains as much as a cause that cannot, if any.

        A cable that found no stiffness is a constant force, a law of two numbers one of a single
        number. Without any of them the other causes would have to explain its torque, too, and
        could not be real either.
        """
        inflation = self.weighing.requirement((*others, cause)).inflation
        for rival in self.rivals(cause, others):
            twin = rival.hypothesis
            if twin is None or isinstance(twin.effect, Kind) or twin.effect.name in gone:
                continue
            fewer = self.pool.width(cause) - self.pool.width(twin)
            less = (rival.margin + rival.fit_margin) / inflation - self.rules.price * fewer
            if rival.believable and less < self.rules.twin:
                return twin
        return None

    def _unbelievable(self, model: Hypotheses) -> tuple[Hypothesis, str] | None:
        """Return the first cause of a model that cannot be real beside the others, and why."""
        for item in model:
            reason = self.belief.objection(item, others_of(model, item))
            if reason is not None:
                return item, reason
        return None

    def _adjusted(self, hypothesis: Hypothesis, others: Hypotheses) -> Hypothesis:
        effect = hypothesis.effect
        if isinstance(effect, Kind):
            return with_acting_joints(self.pool, self.rules,
                                      replace(hypothesis, joints=self._joints), others)
        candidate = self.candidates.best(effect, self.weighing.beside(others))
        return hypothesis if candidate is None else self._with_needed_joints(
            candidate.hypothesis, others)

    def _with_a_swap(self, model: Hypotheses, visited: set[frozenset[str]]) -> Hypotheses | None:
        """Return a model in which a cause gave way to what is decidedly better in its place.

        That is what explains more, at the price of its coefficients, or as much with fewer of them.
        """
        needed = self.weighing.requirement(model)
        for item in named_of(model):
            others = others_of(model, item)
            for rival in self.rivals(item, others):
                if rival.hypothesis is None or isinstance(rival.hypothesis.effect, Kind):
                    continue
                swapped = (*others, rival.hypothesis)
                gain = (-rival.margin - rival.fit_margin) / needed.inflation
                fewer = self.pool.width(item) - self.pool.width(rival.hypothesis)
                is_better = gain + self.rules.price * fewer > self.rules.twin or (
                    fewer > 0 and gain > -BY_CHANCE * fewer)
                if rival.believable and names_of(swapped) not in visited and is_better:
                    return swapped
        return self._with_unnamed_instead(model, visited)

    def _with_several_instead(self, model: Hypotheses, visited: set[frozenset[str]]
                              ) -> Hypotheses | None:
        """Return a model in which several names do decidedly better in the place of one."""
        inflation = self.weighing.requirement(model).inflation
        width, squares = self._width(model), sum(self.pool.fit(model).squares)
        for item in named_of(model):
            for start in self._starts_without(item, others_of(model, item)):
                trial = self._grown(start, item, width)
                gain = 0.5 * (squares - sum(self.pool.fit(trial).squares)) / inflation
                fewer = width - self._width(trial)
                if gain + self.rules.price * fewer > self.rules.twin and (
                        names_of(trial) not in visited):
                    return trial
        return None

    def _starts_without(self, cause: Hypothesis, others: Hypotheses) -> Iterator[Hypotheses]:
        """Yield models from which several names may grow that explain more than a cause does.

        The name that explains most is taken first, and may explain what several others make up.
        Beside it each of them has little left to explain, and none does better in its place. Once
        the others are known, such a name explains little of what it does alone. Or it has more
        joints than the machine does, which explain a bit of another cause; nearly as much is
        explained by half of its coefficients, or by a name with so few.
        """
        gained = self.weighing.gains(cause, others)[0]
        if gained <= SHARED * self.weighing.gains(cause, ())[0]:
            yield self.tested(others)
        named = [rival.hypothesis for rival in self.rivals(cause, others)
                 if rival.hypothesis is not None and rival.believable
                 and not isinstance(rival.hypothesis.effect, Kind)]
        fewer = [item for item in (*choices(cause, self._joints), *named)
                 if 2 * self.pool.width(item) <= self.pool.width(cause)
                 and self.weighing.gains(item, others)[0] > NEARLY * gained]
        for item in fewer:
            if self.pool.width(item) == min(self.pool.width(own) for own in fewer
                                            if own.effect is item.effect):
                yield (*others, item)

    def _grown(self, model: Hypotheses, without: Hypothesis, most: int) -> Hypotheses:
        """Return a model with the names that are found beside it, but for a given one.

        It has at most so many coefficients, unless it has more to begin with.
        """
        without_it = {without.effect.name}
        refused = set(without_it)
        while (step := self._with_a_name(model, refused)) is not None:
            trial = self.tested(step)
            if len(trial) <= len(model) or self._width(trial) > most:
                break
            model, refused = trial, set(without_it)
        return model

    def _width(self, model: Hypotheses) -> int:
        return sum(map(self.pool.width, model))

    def _loss(self, model: Hypotheses) -> float:
        """Return what a model leaves of all rows, in log-likelihood, and what it gains by chance.

        The latter is `BY_CHANCE` for each coefficient. Rows held out may go where rows to fit do
        not; a function that is right there, too, need not know what lies beyond.
        """
        return (0.5 * sum(self.pool.fit(model).squares)
                + BY_CHANCE * self._width(model))

    def _with_unnamed_instead(self, model: Hypotheses, visited: set[frozenset[str]]
                              ) -> Hypotheses | None:
        """Return a model in which an unnamed cause does better than those it makes needless.

        Several causes can together imitate one outside the library so well that nothing is left
        for another beside them; an unnamed cause that contains it does better without them. In the
        place of several it need only be better by what the model may get wrong of its torques, as
        one cause is likelier than several that happen to make up its torque. In the place of one
        without a name it must be better by more than chance, in that of a name by as much as it
        would have to explain beside the name.
        """
        here = self._loss(model)
        better = here - self.rules.margin
        needed = self.weighing.requirement(model)
        decidedly = better - needed.fit - needed.heldout
        beyond_error = here - needed.by_error
        found = []
        for kind in self._kinds:
            if kind.left_by_filters:
                continue
            instead = Hypothesis(kind, {}, self._joints)
            before = tuple(item for item in model if item.effect is not kind)
            others = before
            while others:
                standings = [self.weighing.standing(item, (*others_of(others, item), instead))
                             for item in others]
                if min(standings) > 1.0:
                    break
                others = others_of(others, others[int(np.argmin(standings))])
            trial = (*others, with_acting_joints(self.pool, self.rules, instead, others))
            gone = [item for item in before if item not in others]
            limit = beyond_error if len(gone) > 1 else decidedly if named_of(gone) else better
            loss = self._loss(trial)
            if gone and loss < limit and names_of(trial) not in visited:
                found.append((loss, trial))
        return min(found, key=lambda item: best_first(self.pool, item[1][-1], item[0]),
                   default=(0.0, None))[1]

    def rivals(self, cause: Hypothesis, others: Hypotheses) -> list[Rival]:
        """Return the rivals of a cause beside the others, the strongest first.

        Of equally strong ones the simplest comes first.
        """
        own = self.pool.fit((*others, cause))
        projection = self.weighing.beside(others)
        names = names_of((*others, cause))
        least = 0.5 * self.weighing.gains(cause, others)[0]
        named = [self._believable(item, others)
                 for item in self.candidates.all_of(projection, set(names), least)
                 if item.gain > least]
        unnamed = [Hypothesis(kind, {}, self._joints) for kind in self._kinds
                   if kind.name not in names]
        found = [self._rival(None, self.pool.fit(others), own, True)]
        found += [self._rival(item, self.pool.fit((*others, item)), own,
                              self.belief.objection(item, others) is None)
                  for item in (*named, *unnamed)]
        return sorted(found, key=lambda rival: best_first(
            self.pool, rival.hypothesis, rival.margin))

    def _believable(self, candidate: Candidate, others: Hypotheses) -> Hypothesis:
        """Return a candidate with what it needs, in the best shape that a machine can have.

        The best shape of all is no machine's where the data hardly tell shapes apart; one that
        explains nearly as much may be. Where there is none, the best shape is returned.
        """
        best = self._with_needed_joints(candidate.hypothesis, others)
        if self.belief.objection(best, others) is None:
            return best
        projection = self.weighing.beside(others)
        for shape in self.candidates.other_shapes(
                candidate, projection, candidate.gain - self.rules.twin):
            trial = self._with_needed_joints(
                replace(candidate.hypothesis, shape=shape), others)
            if self.belief.objection(trial, others) is None:
                return trial
        return best

    @staticmethod
    def _rival(hypothesis: Hypothesis | None, there: Fitted, own: Fitted, believable: bool
               ) -> Rival:
        return Rival(hypothesis, 0.5 * (there.heldout_squares - own.heldout_squares),
                     0.5 * (there.fit_squares - own.fit_squares), believable)
