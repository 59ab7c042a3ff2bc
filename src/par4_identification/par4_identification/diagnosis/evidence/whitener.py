"""Rows in units of their noise: a filter for each joint that makes its noise white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.signals.noise import ArNoise, Whitening, fit_noise
from par4_identification.signals.run import Run

LEAST = 1e-9
"""Least variance of the noise, over the mean square of residuals, that is looked for."""


@dataclass(frozen=True)
class Whitener:
    """Standardises rows by the noise of their joint; invalid rows become zero.

    Where the torque jumps the times of its readings add to the noise (`Run.timing_error`).

    Attributes:
        noise: of each joint, where the torque does not jump.
        runs: whose rows are whitened.
    """

    noise: tuple[ArNoise, ...]
    runs: tuple[Run, ...]

    def whiten(self, rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return for each joint the whitened rows (n, k) of all runs, (m, J, k) a run."""
        return [np.concatenate([whitening.of(part[:, joint])
                                for part, whitening in zip(rows, of_runs)])
                for joint, of_runs in enumerate(self._whitenings)]

    def adjoint(self, white: np.ndarray) -> list[np.ndarray]:
        """Return rows z (m, J) of each run of standardised rows w (N,), all joints stacked.

        For any rows c, the sum of z c over all runs and joints is w @ (whitened and stacked c).
        """
        lengths = [len(run.valid) for run in self.runs]
        parts = iter(np.split(white, np.cumsum(lengths * len(self.noise))[:-1]))
        of_joints = [[whitening.adjoint(next(parts)) for whitening in of_runs]
                     for of_runs in self._whitenings]
        return [np.stack(of_run, axis=1) for of_run in zip(*of_joints)]

    def timing_squares(self) -> float:
        """Return the whitened squares that the times of readings make of all valid rows."""
        return sum(float(np.sum(1.0 - _louder(run, joint, noise.size)[run.valid[:, joint]] ** -2))
                   for joint, noise in enumerate(self.noise) for run in self.runs)

    @cached_property
    def _whitenings(self) -> list[list[Whitening]]:
        """The filter of each joint for each run."""
        return [[noise.whitening(run.valid[:, joint], _louder(run, joint, noise.size))
                 for run in self.runs] for joint, noise in enumerate(self.noise)]


def whitener_of_residuals(observations: Observations, residuals: Sequence[np.ndarray],
                          parameters: int) -> Whitener:
    """Return the whitener whose noise model fits residuals (m, J) of each run."""
    runs = observations.runs
    return Whitener(tuple(
        _noise_of(runs, [part[:, joint] for part in residuals], joint,
                  parameters / observations.joints)
        for joint in range(observations.joints)), runs)


def flat_whitener(observations: Observations, sigma: np.ndarray) -> Whitener:
    """Return a whitener for white noise of standard deviation sigma (J,)."""
    noise = tuple(ArNoise(np.zeros(1), float(value) ** 2) for value in sigma)
    return Whitener(noise, observations.runs)


def _noise_of(runs: Sequence[Run], residuals: Sequence[np.ndarray], joint: int,
              parameters: float) -> ArNoise:
    """Return the noise of a joint without what the times of readings add to its residuals (m,)."""
    valid = [run.valid[:, joint] for run in runs]
    squares, added = (np.concatenate([part[mask] ** 2 for part, mask in zip(parts, valid)])
                      for parts in (residuals, [run.timing_error[:, joint] for run in runs]))
    variance = float(np.mean(squares)) if len(squares) else 0.0
    if variance > 0.0 and added.any():
        least = LEAST * variance

        def excess(trial: float) -> float:
            return float(np.mean(squares / (trial + added))) - 1.0

        variance = least if excess(least) <= 0.0 else float(
            scipy.optimize.brentq(excess, least, variance))
    return fit_noise([part / _louder(run, joint, np.sqrt(variance))
                      for run, part in zip(runs, residuals)], valid, parameters)


def _louder(run: Run, joint: int, size: float) -> np.ndarray:
    """Return the noise of each row (m,) over that of this size, N m, without jumps."""
    return np.hypot(1.0, run.timing_error[:, joint] / max(size, 1e-15))
