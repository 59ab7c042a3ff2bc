"""The noise of the recorder: on torque, position and stamps; seeded, each from its own stream."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS

DRAWN = 512
"""Samples drawn at a time."""
JITTER_BOUND = 0.49
"""Largest error of a stamp over the sample period: stamps keep their order."""
LARGEST_JITTER = 0.25
"""Largest rms of it, so that the bound is rarely met."""


@dataclass(frozen=True)
class Noise:
    """What the recorder adds to the samples; nothing of it reaches the drives.

    Attributes:
        torque_noise: rms on the recorded torque, N m.
        correlation_time: of the torque's noise, s: first-order Gauss-Markov of that rms with the
            autocorrelation exp(-|t| / correlation_time); 0 = white.
        position_noise: rms on the recorded positions, before they are rounded to counts, rad.
        stamp_jitter: rms of the error of the stamps, s; values belong to the even, true times.
    """

    torque_noise: float = 0.0
    correlation_time: float = 0.0
    position_noise: float = 0.0
    stamp_jitter: float = 0.0


@numba.njit(cache=True, error_model='numpy')
def _correlate(draws, keep, fresh, last):
    """Turn white draws (n, 4) into n_k = keep n_(k-1) + fresh w_k in place; move `last` (4,)."""
    for row in range(draws.shape[0]):
        for joint in range(draws.shape[1]):
            last[joint] = keep * last[joint] + fresh * draws[row, joint]
            draws[row, joint] = last[joint]


class NoiseSource:
    """The noise of one sample after the other.

    A noise that is switched on, off or resized leaves the others as they are, bit for bit.

    Args:
        noise: sizes.
        period: of the samples, s.
        seed: of all streams.

    Raises:
        InputError: a jitter that stamps a period apart cannot have.
    """

    def __init__(self, noise: Noise, period: float, seed: int) -> None:
        if noise.stamp_jitter > LARGEST_JITTER * period:
            raise InputError(
                f'stamp jitter: {noise.stamp_jitter:g} s rms asked with samples {period:g} s '
                f'apart; give {LARGEST_JITTER * period:g} s or less, else stamps lose their order')
        streams = [np.random.default_rng(child)
                   for child in np.random.SeedSequence(seed).spawn(3)]
        self._torque, self._position, self._stamp = streams
        self._noise = noise
        self._bound = JITTER_BOUND * period
        self._keep = (math.exp(-period / noise.correlation_time)
                      if noise.correlation_time > 0.0 else 0.0)
        self._last = self._torque.standard_normal(LEGS)  # stationary from the first sample on
        self._row = DRAWN

    def advance(self) -> None:
        """Go to the next sample; before the first one too."""
        self._row += 1
        if self._row < DRAWN:
            return
        self._row = 0
        noise = self._noise
        torque = self._torque.standard_normal((DRAWN, LEGS))
        _correlate(torque, self._keep, math.sqrt(1.0 - self._keep ** 2), self._last)
        self._torques = noise.torque_noise * torque
        self._positions = noise.position_noise * self._position.standard_normal((DRAWN, LEGS))
        stamps = noise.stamp_jitter * self._stamp.standard_normal(DRAWN)
        self._stamps_ns = np.rint(1e9 * np.clip(stamps, -self._bound, self._bound)).astype(int)

    def take(self, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Go `count` samples on and return their noise.

        Returns:
            On the torques (count, 4), N m, and on the positions (count, 4), rad; errors of the
            stamps (count,), ns.
        """
        parts = []
        while count > 0:
            self.advance()
            rows = slice(self._row, min(self._row + count, DRAWN))
            parts.append((self._torques[rows], self._positions[rows], self._stamps_ns[rows]))
            self._row = rows.stop - 1
            count -= len(parts[-1][0])
        torque, position, stamp_ns = (np.concatenate(part) for part in zip(*parts, strict=True))
        return torque, position, stamp_ns

    @property
    def torque(self) -> np.ndarray:
        """On the recorded torque (4,), N m."""
        return self._torques[self._row]

    @property
    def position(self) -> np.ndarray:
        """On the recorded positions (4,), rad."""
        return self._positions[self._row]

    @property
    def stamp_ns(self) -> int:
        """Error of the stamp, ns."""
        return int(self._stamps_ns[self._row])
