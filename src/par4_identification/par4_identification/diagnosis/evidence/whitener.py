"""Rows in units of their noise: a filter for each joint that makes its noise white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.signals.noise import ArNoise, Whitening, fit_noise


@dataclass(frozen=True)
class Whitener:
    """Standardises rows by the noise of their joint; invalid rows become zero.

    Attributes:
        noise: of each joint.
        valid: (m, J) of each run.
    """

    noise: tuple[ArNoise, ...]
    valid: tuple[np.ndarray, ...]

    def whiten(self, rows: Sequence[np.ndarray]) -> list[np.ndarray]:
        """Return for each joint the whitened rows (n, k) of all runs, (m, J, k) a run."""
        return [np.concatenate([whitening.of(part[:, joint])
                                for part, whitening in zip(rows, of_runs)])
                for joint, of_runs in enumerate(self._whitenings)]

    def adjoint(self, white: np.ndarray) -> list[np.ndarray]:
        """Return rows z (m, J) of each run of standardised rows w (N,), all joints stacked.

        For any rows c, the sum of z c over all runs and joints is w @ (whitened and stacked c).
        """
        lengths = [len(valid) for valid in self.valid]
        parts = iter(np.split(white, np.cumsum(lengths * len(self.noise))[:-1]))
        of_joints = [[whitening.adjoint(next(parts)) for whitening in of_runs]
                     for of_runs in self._whitenings]
        return [np.stack(of_run, axis=1) for of_run in zip(*of_joints)]

    @cached_property
    def _whitenings(self) -> list[list[Whitening]]:
        """The filter of each joint for each run."""
        return [[noise.whitening(valid[:, joint]) for valid in self.valid]
                for joint, noise in enumerate(self.noise)]


def whitener_of_residuals(observations: Observations, residuals: Sequence[np.ndarray],
                          parameters: int) -> Whitener:
    """Return the whitener whose noise model fits residuals (m, J) of each run."""
    valid = tuple(run.valid for run in observations.runs)
    joints = observations.joints
    noise = tuple(
        fit_noise([part[:, joint] for part in residuals], [mask[:, joint] for mask in valid],
                  parameters / joints)
        for joint in range(joints))
    return Whitener(noise, valid)


def flat_whitener(observations: Observations, sigma: np.ndarray) -> Whitener:
    """Return a whitener for white noise of standard deviation sigma (J,)."""
    noise = tuple(ArNoise(np.zeros(1), float(value) ** 2) for value in sigma)
    return Whitener(noise, tuple(run.valid for run in observations.runs))
