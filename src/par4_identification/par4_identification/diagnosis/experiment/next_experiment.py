"""The motion that would tell apart what the data at hand cannot, with the expected separation.

How well a motion separates the names A and B is computed as follows. The fitted model with A gives
a torque without noise, on the old rows and on those of the motion. Base terms, the other causes and
B at any shape are fitted to it. Half the sum of squares of the whitened residual is the expected
difference of log-likelihood, A over B, if A is true. The same is done with A and B exchanged, and
the smaller difference counts, since nobody knows which is true. For an unnamed cause, A is that
cause and B the name that comes nearest. For a name that nearly passes as a cause, B is no cause at
all. In these two cases only A counts as true.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from par4_dynamics.effects.catalogue import effect_named
from par4_dynamics.effects.effect import Effect, Shape
from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import torque_model
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.evidence import Evidence, gather
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import shape_key
from par4_identification.diagnosis.evidence.observations import observe, with_nominal
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.small_systems import quadratic
from par4_identification.diagnosis.evidence.whitener import Whitener
from par4_identification.diagnosis.experiment.motion_library import joined, motion_library
from par4_identification.diagnosis.search.shapes import best_shape, self_consistent, shapes_of
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_identification.diagnosis.verdict.pair import Pair
from par4_identification.logs.log import Log
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Axis, Robot

WANTED = 30.0
"""Expected separation at which a motion decides: chance moves it by about sqrt(2 separation), so
that it will exceed the margin of 10 within which names are twins."""
LONGEST = 60.0
"""s of motion that may be asked for."""
MOTION_FILE = 'motion.yaml'
"""Name under which the motion is written where nobody else has files of that name."""


Programme = tuple[Motion, ...]
"""Motions that are run one after the other."""


@dataclass(frozen=True)
class Separation:
    """What is known of telling two explanations apart.

    Attributes:
        names: of the effects, the stronger first, or in words what an unnamed cause acts like.
        present: difference of log-likelihood on the data at hand, first over second.
        expected: the same behind the next motion, whichever is true.
        most: expected of the motion of the library that is best for these two, repeated as long
            as may be.
        separated: True where the next motion decides between them.
    """

    names: tuple[str, str]
    present: float
    expected: float
    most: float
    separated: bool


@dataclass(frozen=True)
class NextExperiment:
    """The next motion, or why there is none.

    Attributes:
        motion: None if no candidate motion separates any pair.
        separations: one for each pair of explanations.
        file: name of the file of the motion.
    """

    motion: Motion | None
    separations: tuple[Separation, ...]
    file: str = MOTION_FILE

    @property
    def separates(self) -> tuple[tuple[str, str], ...]:
        """Pairs between which the motion decides."""
        return tuple(item.names for item in self.separations if item.separated)

    @property
    def expected_separation(self) -> float:
        """The smallest expected separation of these pairs."""
        return min(item.expected for item in self.separations if item.separated)


def next_experiment(diagnosis: Diagnosis, machine: Robot | Axis) -> NextExperiment | None:
    """Return the motion that would tell causes from their twins, and unnamed causes from names.

    Args:
        diagnosis: the answer with its evidence.
        machine: that was recorded.

    Returns:
        the motion and what it separates. None if there are no twins and no doubts, for a single
        axis, and for a robot that can do none of the candidate motions.
    """
    if not isinstance(machine, Robot):
        return None
    evidence = diagnosis.evidence
    pairs = [twins_of(evidence, diagnosis.hypotheses, number, effect_named(twin, diagnosis.effects))
             for number, cause in enumerate(diagnosis.causes) for twin in cause.twins]
    pairs += diagnosis.doubts
    if not pairs:
        return None
    prospect = Prospect(evidence, machine, diagnosis.extended_model, diagnosis.effects)
    trials = [Trial(prospect, pair) for pair in pairs]
    motions = motion_library(machine, prospect.model)
    if not motions:
        return None
    best = [_choose([trial], [(motion,) for motion in motions]) for trial in trials]
    programmes = [(motion,) for motion in motions] + list({
        tuple(sorted(motion.name for motion in couple)): couple
        for couple in (first + second for first in best for second in best if first != second)
    }.values()) if len(trials) > 1 else best
    chosen = _choose(trials, programmes)
    times = _times(chosen, trials)
    name = ' and '.join(part.name for part in chosen)
    motion = joined(chosen * times, name if times == 1 else f'{times} times {name}', machine)
    found = []
    for trial, own in zip(trials, best, strict=True):
        expected = trial.exact((motion,))
        found.append(Separation(trial.pair.names, difference(evidence, trial.pair), expected,
                                trial.exact(own, _most_times(own)), expected >= WANTED))
    separated = any(item.separated for item in found)
    return NextExperiment(motion if separated else None, tuple(found))


def twins_of(evidence: Evidence, hypotheses: Sequence[Hypothesis], cause: int, twin: Effect
             ) -> Pair:
    """Return a cause and its twin, the twin at the shape that suits the data best."""
    others = tuple(item for number, item in enumerate(hypotheses) if number != cause)
    projection = project(evidence, others)
    shape, _ = best_shape(twin, shapes_of(evidence.observations, twin),
                          partial(projection.gains, twin))
    if twin.expanded:
        shape = self_consistent(projection, twin, shape)
    return Pair(hypotheses[cause], _everywhere(evidence, twin, shape), others)


def difference(evidence: Evidence, pair: Pair) -> float:
    """Return the difference of log-likelihood on the data, first explanation over second."""
    first, second = (squared_rest(moments(evidence.design([*pair.others, *_given(hypothesis)]),
                                          evidence.target))
                     for hypothesis in (pair.first, pair.second))
    return 0.5 * (second - first)


def _given(hypothesis: Hypothesis | None) -> list[Hypothesis]:
    return [] if hypothesis is None else [hypothesis]


def _everywhere(evidence: Evidence, effect: Effect, shape: Shape) -> Hypothesis:
    return Hypothesis(effect, shape, tuple(range(evidence.observations.joints)))


def moments(design: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """Return the products (c + 1, c + 1) of a design (N, c) with a signal (N,) as last column.

    Those of several stretches of rows add up, and hold all that least squares need.
    """
    columns = np.column_stack((design, signal))
    return columns.T @ columns


def squared_rest(products: np.ndarray) -> float:
    """Return the squared residual of the last column of `moments` after its other columns."""
    gram, moment = products[:-1, :-1], products[:-1, -1]
    return float(max(products[-1, -1] - quadratic(gram, moment, np.diag(gram)), 0.0))


@dataclass(frozen=True)
class Prospect:
    """The data at hand, and rows of motions as they would be if they were run.

    Attributes:
        evidence: of the data at hand.
        robot: the machine.
        model_file: the extended model.
        effects: what the names in it stand for.
    """

    evidence: Evidence
    robot: Robot
    model_file: ModelFile
    effects: Mapping[str, Effect]
    _kept: dict[str, Evidence] = field(default_factory=dict)

    @cached_property
    def model(self) -> Model:
        """The extended model."""
        return torque_model(self.robot, self.model_file, self.effects)

    def of_motion(self, motion: Motion) -> Evidence:
        """Return the whitened rows of a motion; computed once."""
        if motion.name not in self._kept:
            old = self.evidence.observations
            runs = runs_of_log(self._record(motion), self.robot, old.runs[0].conditioning)
            whitener = Whitener(self.evidence.whitener.noise, tuple(runs))
            # what the old rows do not show is known of the new ones
            observations = observe(runs, self.robot, self.model_file.rigid_body, None
                                   ).with_terms_of(old, self.model.values)
            self._kept[motion.name] = gather(with_nominal(observations, self.model), whitener)
        return self._kept[motion.name]

    def _record(self, motion: Motion) -> Log:
        """Return what would be recorded of a motion, without noise."""
        state = State(motion.t, motion.q, motion.qd, motion.qdd, self.robot.geometry, motion.x,
                      motion.xd, motion.xdd)
        return Log(name=motion.name, joint_names=self.robot.joint_names, start_stamp=0,
                   period=motion.period, t=motion.t, q=motion.q, tau=self.model.torque(state),
                   segments=(slice(0, len(motion.t)),), reference=None, accounts=None)


@dataclass(frozen=True)
class Trial:
    """A pair of explanations on trial.

    Attributes:
        prospect: old rows and those of motions.
        pair: the explanations.
    """

    prospect: Prospect
    pair: Pair
    _kept: dict[tuple[object, ...], np.ndarray] = field(default_factory=dict)

    def bound(self, motions: Programme, times: int = 1) -> float:
        """Return an upper bound of `exact`, with the rival at the shape of the old data."""
        return min(0.5 * self._rest(number, self._shape(1 - number), motions, times)
                   for number in self._truths)

    def exact(self, motions: Programme, times: int = 1) -> float:
        """Return the expected separation of motions run so often; the rival may have any shape."""
        return min(self.if_true(number, motions, times) for number in self._truths)

    @property
    def _truths(self) -> tuple[int, ...]:
        """Which of the explanations count as true, one after the other."""
        return (0, 1) if self.pair.twins else (0,)

    @property
    def _sides(self) -> tuple[Hypothesis, Hypothesis | None]:
        return self.pair.first, self.pair.second

    def _truth(self, number: int) -> Hypothesis:
        """Return an explanation that may be true; nothing at all is none."""
        side = self._sides[number]
        assert side is not None
        return side

    def _shape(self, number: int) -> Shape:
        side = self._sides[number]
        return {} if side is None else side.shape

    def if_true(self, number: int, motions: Programme, times: int = 1) -> float:
        """Return the expected separation if the first (0) or second (1) explanation is true."""
        rival = self._sides[1 - number]
        if rival is None:
            return 0.5 * self._rest(number, {}, motions, times)
        effect = _name(rival)
        # a series holds around the size that the data give, elsewhere it would be another law
        shapes = (rival.shape,) if effect.expanded else (
            rival.shape, *shapes_of(self.prospect.evidence.observations, effect))
        _, worth = best_shape(effect, shapes, lambda some: -np.array(
            [self._rest(number, shape, motions, times) for shape in some]))
        return -0.5 * worth

    def _rest(self, number: int, shape: Shape, motions: Programme, times: int) -> float:
        """Return the squared residual if name `number` is true and its rival has a shape."""
        return squared_rest(self._moments(number, shape, None) + times * sum(
            self._moments(number, shape, motion) for motion in motions))

    def _moments(self, number: int, shape: Shape, motion: Motion | None) -> np.ndarray:
        """Return the moments of the old rows, or of those of a motion; computed once."""
        key = (number, shape_key(shape), motion and motion.name)
        if key not in self._kept:
            evidence = (self.prospect.evidence if motion is None
                        else self.prospect.of_motion(motion))
            truth, rival = self._truth(number), self._sides[1 - number]
            design = evidence.design([*self.pair.others, *(
                [] if rival is None else [_everywhere(evidence, _name(rival), shape)])])
            self._kept[key] = moments(design, evidence.columns(truth) @ self._fitted[number])
        return self._kept[key]

    @cached_property
    def _fitted(self) -> tuple[np.ndarray, ...]:
        """Stacked coefficients of each explanation that counts as true, on the old data.

        Each stands beside the other causes.
        """
        evidence, found = self.prospect.evidence, []
        for number in self._truths:
            hypothesis = self._truth(number)
            fit = solve(evidence, [*self.pair.others, hypothesis])
            found.append(hypothesis.stacked(fit.coefficients[-1]))
        return tuple(found)


def _name(rival: Hypothesis) -> Effect:
    """Return the effect of a rival, which always has a name."""
    assert isinstance(rival.effect, Effect)
    return rival.effect


Worth = tuple[int, float]
"""Number of pairs that a programme decides, and separation a second of the least of them."""


def _most_times(programme: Programme) -> int:
    """Return how often a programme can be run in the time that may be asked for."""
    return max(1, int(LONGEST / sum(motion.duration for motion in programme)))


def _times(programme: Programme, trials: Sequence[Trial]) -> int:
    """Return how often a programme must run to decide all pairs that it can decide."""
    most = _most_times(programme)
    able = [trial for trial in trials if trial.exact(programme, most) >= WANTED]
    return next((times for times in range(1, most)
                 if all(trial.exact(programme, times) >= WANTED for trial in able)), most)


def _worth(programme: Programme, separations: Sequence[float]) -> Worth:
    """Return the worth by the separations at `_most_times`."""
    decided = [item for item in separations if item >= WANTED]
    return len(decided), min(decided or separations) / (
        _most_times(programme) * sum(motion.duration for motion in programme))


def _choose(trials: Sequence[Trial], programmes: Sequence[Programme]) -> Programme:
    """Return the programme of most worth.

    A bound is quick, the exact separation is not; no worth exceeds what the bounds say, so that
    only programmes with the highest bounds need the exact one.
    """
    worths = [_worth(item, [trial.bound(item, _most_times(item)) for trial in trials])
              for item in programmes]
    exact: set[int] = set()
    while True:
        best = max(range(len(programmes)), key=lambda number: worths[number])
        programme = programmes[best]
        if best in exact:
            return programme
        exact.add(best)
        worths[best] = _worth(programme, [trial.exact(programme, _most_times(programme))
                                          for trial in trials])
