"""Whether a torque that is late is late by a lag or by a delay.

Both add the rate of the torque to it, so that they are alike to first order in the time. They
differ in second order, by half of the squared time of its curvature.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.model import Model
from par4_dynamics.state import State, state_of_joints
from par4_identification.diagnosis.evidence.evidence import Evidence, spread
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import Observations, with_nominal
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.signals.filtering import central_difference, low_pass, second_difference
from par4_identification.signals.rows import Run

DRAWS = 4
"""Motions that are drawn with other roundings to encoder counts. Their mean tells the squares of
that noise to a few percent."""
WRONG = 0.5
"""A lag T and a delay T differ by T^2 / 2. From this share of it on, the other law is believed."""
TOLD = 0.5
"""The second order is judged only if at least this share of its squares is no error of counts."""
DOUBT = 0.25
"""Share of what counts are computed to do to the second order by which that may be wrong."""
SECOND_ORDER = 10.0
"""Log-likelihood from which a second order that differs from the law counts as no chance."""


@dataclass(frozen=True)
class Dithered:
    """The same motion as other encoders could have read it, whose counts lie elsewhere.

    Positions are rounded to counts and filtered. This gives the torque of the model an error e, and
    its rate the error de/dt. A lag amplifies e and a delay only moves it. So least squares favour
    the delay if e is noise that the counts added, and the lag if e is motion that the filter took
    away. The products of the columns with these errors are known from the draws and are therefore
    taken out of the normal equations.

    Attributes:
        draws: the observations with other positions; empty if the noise of positions is not known.
    """

    draws: tuple[Observations, ...] = ()

    def with_nominal(self, model: Model) -> Dithered:
        """Return the motions with the torque of `model` as nominal torque."""
        return Dithered(tuple(with_nominal(draw, model) for draw in self.draws))

    def obeys(self, projection: Projection, hypothesis: Hypothesis, time: float,
              inflation: float = 1.0) -> bool:
        """Return whether a torque that is `time` (s) late has the second order of an effect.

        A column d2(torque)/dt2 is fitted beside the effect's own. Its coefficient is 0 for the true
        effect, and +-time^2 / 2 for a lag in place of a delay or the reverse. Without draws the
        answer is yes. `inflation` enlarges the variances for the errors of the model
        (`Requirement.inflation`).
        """
        if not self.draws:
            return True
        evidence = projection.evidence
        whole = _stacked(evidence, [run.rows(_orders(hypothesis)(run.state))
                                    for run in evidence.observations.runs])
        columns = projection.rest(whole)
        gram, moment = columns.T @ columns, columns.T @ projection.residual
        told, blurred, uncorrected = gram[1, 1], 0.0, np.linalg.solve(gram, moment)
        for torque, orders in zip(self.noise(evidence, delivered),
                                  self.noise(evidence, _orders(hypothesis))):
            moved = projection.rest(whole + orders)
            gram = gram - moved.T @ orders / len(self.draws)
            moment = moment + moved.T @ torque[:, 0] / len(self.draws)
            blurred += float(np.sum(projection.rest(orders[:, 1:]) ** 2)) / len(self.draws)
        if blurred > (1.0 - TOLD) * told:
            return True
        both = np.linalg.solve(gram, moment)
        gain = 0.5 * float(both @ moment - moment[0] ** 2 / gram[0, 0])
        wrong = WRONG * 0.5 * time ** 2 + DOUBT * abs(both[1] - uncorrected[1])
        return gain < inflation * SECOND_ORDER or abs(both[1]) < wrong

    def noise(self, evidence: Evidence, function: Callable[[State], np.ndarray]
               ) -> list[np.ndarray]:
        """Return the change of `function`, (n, J, K) of a state, in each draw, whitened (N, K)."""
        runs = evidence.observations.runs
        told = [function(run.state) for run in runs]
        return [_stacked(evidence, [run.rows(function(moved.state) - own)
                                    for run, moved, own in zip(runs, draw.runs, told)])
                for draw in self.draws]


def dithered(observations: Observations, seed: int = 0) -> Dithered:
    """Return motions whose positions differ by the noise of the machine's encoders."""
    random = np.random.default_rng(seed)
    return Dithered(tuple(
        replace(observations, _kept={}, runs=tuple(
            replace(run, state=dithered_state(run, run.state, random))
            for run in observations.runs))
        for _ in range(DRAWS if is_noisy(observations.runs) else 0)))


def is_noisy(runs: Sequence[Run]) -> bool:
    """Return whether the noise of the positions is known, and not zero."""
    return any(run.counts or run.position_noise.any() for run in runs)


def dithered_state(run: Run, state: State, random: np.random.Generator) -> State:
    """Return the motion of `run`, or of its beginning, with another draw of the position noise.

    A motion as lively as the true one is read by encoders whose counts lie elsewhere, or with other
    white noise, and filtered.
    """
    period = float(state.t[1] - state.t[0])
    true = run.likely[:len(state.q)]
    told = true + (random.uniform(-0.5, 0.5, true.shape) * (2.0 * np.pi / run.counts) if run.counts
                   else random.standard_normal(true.shape) * run.position_noise)
    missed = run.smoother(told) - true
    dither, missed = (low_pass(part, run.conditioning.position_cutoff_hz, period)
                      for part in (missed if run.coarse else told - true, missed))
    return replace(state_of_joints(state.geometry, state.t, state.q + dither,
                                   state.qd + central_difference(dither, period),
                                   state.qdd + second_difference(missed, period)),
                   told_hz=state.told_hz, hanging=state.hanging)


def delivered(state: State) -> np.ndarray:
    """Return the nominal torque that the drives deliver as one column, (n, J, 1) N m."""
    return state.known.delivered[..., None]


def _orders(hypothesis: Hypothesis) -> Callable[[State], np.ndarray]:
    """Return the columns of an effect and of the second rate of the torque, (n, J, 2)."""

    def columns(state: State) -> np.ndarray:
        bend = time_rate(state, time_rate(state, state.known.delivered))
        return np.concatenate((hypothesis.effect.columns(state, hypothesis.shape),
                               bend[..., None]), axis=2)

    return columns


def _stacked(evidence: Evidence, rows: list[np.ndarray]) -> np.ndarray:
    joints = tuple(range(evidence.observations.joints))
    return spread(evidence.whitener.whiten(rows), joints, shared=True)
