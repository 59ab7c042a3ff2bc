"""A periodic path of the platform: a finite Fourier series of x, y, z and theta."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class FourierPath:
    """X(t) = c_0 + sum over k of c_(2k-1) cos(k w t) + c_2k sin(k w t), w = 2 pi / period.

    Attributes:
        coefficients: c, of x, y, z, theta, (2 n + 1, 4), m and rad, in `base`.
        period: s.
    """

    coefficients: np.ndarray
    period: float

    @property
    def harmonics(self) -> int:
        """Number n of harmonics."""
        return len(self.coefficients) // 2

    def sample(self, t: np.ndarray) -> np.ndarray:
        """Return X and its first two time derivatives, (3, n, 4), at times t (n,), s."""
        return fourier_basis(t, self.period, self.harmonics) @ self.coefficients

    def scaled(self, share: float) -> FourierPath:
        """Return the path drawn towards its middle c_0, 0 leaving nothing but that."""
        scale = np.full((len(self.coefficients), 1), share)
        scale[0] = 1.0
        return replace(self, coefficients=scale * self.coefficients)


def fourier_basis(t: np.ndarray, period: float, harmonics: int) -> np.ndarray:
    """Return what multiplies the coefficients in X, Xd and Xdd, (3, n, 2 harmonics + 1)."""
    rate = 2.0 * np.pi / period * np.arange(1, harmonics + 1)
    cosine, sine = np.cos(np.outer(t, rate)), np.sin(np.outer(t, rate))
    basis = np.zeros((3, len(t), 2 * harmonics + 1))
    basis[0, :, 0] = 1.0
    basis[0, :, 1::2], basis[0, :, 2::2] = cosine, sine
    basis[1, :, 1::2], basis[1, :, 2::2] = -rate * sine, rate * cosine
    basis[2, :, 1::2], basis[2, :, 2::2] = -rate ** 2 * cosine, -rate ** 2 * sine
    return basis
