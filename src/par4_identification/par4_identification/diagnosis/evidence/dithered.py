"""The motion as other encoders could have read it: what counts make of torques that it computes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from par4_dynamics.model import Model
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.evidence import Evidence, spread
from par4_identification.diagnosis.evidence.observations import Observations, with_nominal
from par4_identification.diagnosis.evidence.side_by_side import side_by_side
from par4_identification.signals.filtering import central_difference, low_pass, second_difference
from par4_identification.signals.run import Run

DRAWS = 4
"""Motions that are drawn with other roundings to encoder counts. Their mean tells the squares of
that noise to a few percent."""


@dataclass(frozen=True)
class Dithered:
    """The same motion as other encoders could have read it, whose counts lie elsewhere.

    Positions are rounded to counts and filtered, which gives each torque of the model an error. Its
    products with columns are known from the draws.

    Attributes:
        draws: the observations with other positions; empty if the noise of positions is not known.
    """

    draws: tuple[Observations, ...] = ()

    def with_nominal(self, model: Model) -> Dithered:
        """Return the motions with the torque of `model` as nominal torque."""
        return Dithered(tuple(with_nominal(draw, model) for draw in self.draws))

    def noise(self, evidence: Evidence, function: Callable[[State], np.ndarray]
               ) -> list[np.ndarray]:
        """Return the change of `function`, (n, J, K) of a state, in each draw, whitened (N, K)."""
        runs = evidence.observations.runs
        told = [function(run.state) for run in runs]
        return side_by_side(lambda draw: stacked(evidence, [
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
                   else _noise(run, random.standard_normal(true.shape), period))
    missed = run.smoother(told) - true
    dither, missed = (low_pass(part, run.conditioning.position_cutoff_hz, period)
                      for part in (missed if run.coarse else told - true, missed))
    return state.moved(state.q + dither, state.qd + central_difference(dither, period),
                       state.qdd + second_difference(missed, period))


def _noise(run: Run, white: np.ndarray, period: float) -> np.ndarray:
    """Return noise (n, J) of positions, rad, made of white noise of variance 1."""
    noise = white * run.position_noise
    return scipy.integrate.cumulative_trapezoid(noise, dx=period, axis=0, initial=0.0
                                                ) if run.integrated else noise


def delivered(state: State) -> np.ndarray:
    """Return the nominal torque that the drives deliver as one column, (n, J, 1) N m."""
    return state.known.independent[..., None]


def stacked(evidence: Evidence, rows: list[np.ndarray]) -> np.ndarray:
    """Return columns (m, J, K) of each run, which the joints share, whitened, (N, K)."""
    joints = tuple(range(evidence.observations.joints))
    return spread(evidence.whitener.whiten(rows), joints, shared=True)
