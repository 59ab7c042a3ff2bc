"""Whether a torque that is late is late by a lag or by a delay.

Both add the rate of the torque to it, so that they are alike to first order in the time. They
differ in second order, by half of the squared time of its curvature. Both are late by the same time
at all frequencies. Loads that swing or bounce are not, but look like it at one of them.
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
from par4_identification.diagnosis.evidence.side_by_side import side_by_side
from par4_identification.signals.filtering import central_difference, low_pass, second_difference
from par4_identification.signals.rows import Run

DRAWS = 4
"""Motions that are drawn with other roundings to encoder counts. Their mean tells the squares of
that noise to a few percent."""
WRONG = 0.5
"""A lag T and a delay T differ by T^2 / 2. From this share of it on, the other law is believed; and
neither is if low frequencies have a time that differs by this share of it from that of the others.
"""
TOLD = 0.5
"""A column is judged only if at least this share of its squares is no error of counts."""
DOUBT = 0.25
"""Share of what counts are computed to do to a coefficient by which that may be wrong."""
NO_CHANCE = 10.0
"""Log-likelihood from which what differs from the law counts as no chance."""
OCTAVES = (4.0, 8.0)
"""Cut-off of the torque over a frequency that parts low ones from the others. Beside the cut-off
itself most of a rate is what counts make of it."""


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
        """Return whether a torque that is `time` (s) late follows the law of an effect.

        Each of the other columns of `_orders` is fitted beside the effect's own. Its coefficient is
        0 for the true effect. That of d2(torque)/dt2 is +-time^2 / 2 for a lag in place of a delay
        or the reverse, that of low frequencies the difference of their time to that of the others.
        Without draws the answer is yes. `inflation` enlarges the variances for the errors of the
        model (`Requirement.inflation`).
        """
        if not self.draws:
            return True
        evidence = projection.evidence
        orders = _orders(hypothesis, evidence.observations.runs[0].conditioning.torque_cutoff_hz)
        whole = _stacked(evidence, [run.rows(orders(run.state))
                                    for run in evidence.observations.runs])
        columns = projection.rest(whole)
        told = columns.T @ columns, columns.T @ projection.residual
        (gram, moment), blurred = told, np.zeros_like(told[0])
        for torque, noise in zip(self.noise(evidence, delivered), self.noise(evidence, orders)):
            moved, alone = projection.rest(whole + noise), projection.rest(noise)
            gram = gram - moved.T @ noise / len(self.draws)
            moment = moment + moved.T @ torque[:, 0] / len(self.draws)
            blurred = blurred + alone.T @ alone / len(self.draws)

        def differs(column: int, size: float) -> bool:
            """Return whether a column has a coefficient that is no chance and not small to `size`.
            """
            apart = np.array((-told[0][0, column] / told[0][0, 0], 1.0))
            pair = np.ix_((0, column), (0, column))
            if apart @ (blurred - (1.0 - TOLD) * told[0])[pair] @ apart > 0.0:
                return False
            (found, gain), (before, _) = (_beside(*part, column) for part in ((gram, moment), told))
            wrong = WRONG * size + DOUBT * abs(found - before)
            return gain >= inflation * NO_CHANCE and abs(found) >= wrong

        sizes = (0.5 * time ** 2, *(abs(time) for _ in OCTAVES))
        return not any(differs(column, size) for column, size in enumerate(sizes, start=1))

    def noise(self, evidence: Evidence, function: Callable[[State], np.ndarray]
               ) -> list[np.ndarray]:
        """Return the change of `function`, (n, J, K) of a state, in each draw, whitened (N, K)."""
        runs = evidence.observations.runs
        told = [function(run.state) for run in runs]
        return side_by_side(lambda draw: _stacked(evidence, [
            run.rows(function(moved.state) - own)
            for run, moved, own in zip(runs, draw.runs, told)]), self.draws)


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


def _orders(hypothesis: Hypothesis, cutoff_hz: float) -> Callable[[State], np.ndarray]:
    """Return the column of an effect, the second rate of the torque, and the low frequencies of the
    column, `OCTAVES` below a cut-off, (n, J, 2 + k).
    """

    def columns(state: State) -> np.ndarray:
        own = hypothesis.effect.columns(state, hypothesis.shape)
        bend = time_rate(state, time_rate(state, state.known.delivered))
        period = float(state.t[1] - state.t[0])
        return np.concatenate((own, bend[..., None], *(
            low_pass(own, cutoff_hz / octave, period) for octave in OCTAVES)), axis=2)

    return columns


def _beside(gram: np.ndarray, moment: np.ndarray, column: int) -> tuple[float, float]:
    """Return the coefficient of a column beside the first, and what it gains in log-likelihood."""
    pair = [0, column]
    both = np.linalg.solve(gram[np.ix_(pair, pair)], moment[pair])
    return float(both[1]), 0.5 * float(both @ moment[pair] - moment[0] ** 2 / gram[0, 0])


def _stacked(evidence: Evidence, rows: list[np.ndarray]) -> np.ndarray:
    joints = tuple(range(evidence.observations.joints))
    return spread(evidence.whitener.whiten(rows), joints, shared=True)
