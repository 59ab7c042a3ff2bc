"""Noise of positions: white, as counts, stamps that tremble and analogue encoders make it.

A motion has next to nothing in the upper half of the frequencies that samples carry. Whatever the
positions hold there is noise, and white noise has the same level below. Where positions are the
integral of measured speeds, the speeds have the white noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from par4_identification.signals.filtering import second_difference

UPPER = 0.5
"""Share of half the sample rate above which a position is taken to hold noise only."""
LEAST_GAIN = 0.01
"""Of the largest, from which a frequency tells noise: an integral has none at half the rate."""


def noise_gain(frequency: np.ndarray, period: float, integrated: bool = False) -> np.ndarray:
    """Return the factor (k,) by which `second_difference` multiplies the power of white noise.

    Args:
        frequency: (k,) Hz.
        period: of the samples, s.
        integrated: whether it is noise of speeds (1/s^2), integrated by the trapezoidal rule, or
            that of positions (1/s^4).
    """
    angle = 2.0 * np.pi * frequency * period
    gain = ((30.0 - 32.0 * np.cos(angle) + 2.0 * np.cos(2.0 * angle))
            / (12.0 * period ** 2)) ** 2
    if integrated:
        # 30 - 32 cos x + 2 cos 2x = (1 - cos x) (28 - 4 cos x), so that zero stays zero
        gain = ((1.0 + np.cos(angle)) * (1.0 - np.cos(angle))) * ((28.0 - 4.0 * np.cos(angle))
                                                                  / (24.0 * period)) ** 2
    return gain


@dataclass(frozen=True)
class Spectrum:
    """The mean power of signals, over windows that overlap by half (Welch 1967).

    Attributes:
        frequency: (k,), Hz.
        power: (k, J); that of white noise is its variance at each frequency. Zero where no signal
            is as long as a window.
        windows: how many there are.
    """

    frequency: np.ndarray
    power: np.ndarray
    windows: int

    def level(self, chosen: np.ndarray, gain: np.ndarray | float = 1.0) -> np.ndarray:
        """Return the variance (J,) of white noise, by its gain (m,) at the chosen frequencies (m).

        It is told by the median over them, which lines do not move. The power of noise is a sum of
        squares (a gamma distribution), whose median is below its mean where windows are few.
        """
        count = max(self.windows, 1)
        below = scipy.special.gammaincinv(count, 0.5) / count
        shares = self.power[chosen] / np.reshape(gain, (-1, 1))
        return np.asarray(np.median(shares, axis=0) / below)


def mean_spectrum(signals: Sequence[np.ndarray], period: float, window: np.ndarray | None = None,
                  centred: bool = True) -> Spectrum:
    """Return the mean power of signals (n, J).

    Args:
        signals: of each uninterrupted stretch.
        period: of the samples, s.
        window: weights (m,) of the samples of a window; None for one of a second.
        centred: whether the mean of each window is taken off.
    """
    if window is None:
        window = np.hanning(max(round(1.0 / period), 16))
    length = len(window)
    joints = signals[0].shape[1] if signals else 1
    total, windows = np.zeros((length // 2 + 1, joints)), 0
    for signal in signals:
        for first in range(0, len(signal) - length + 1, length // 2):
            part = signal[first:first + length]
            part = part - part.mean(axis=0) if centred else part
            total += np.abs(np.fft.rfft(window[:, None] * part, axis=0)) ** 2
            windows += 1
    return Spectrum(np.fft.rfftfreq(length, period),
                    total / (max(windows, 1) * float(np.sum(window ** 2))), windows)


def noise_variance(differences: Spectrum, period: float, integrated: bool = False) -> np.ndarray:
    """Return the variance (J,) of the white noise of positions, or of the speeds they are made of.

    Args:
        differences: spectrum of the second difference of the positions.
        period: of the samples, s.
        integrated: whether it is that of speeds.
    """
    gain = noise_gain(differences.frequency, period, integrated)
    upper = ((differences.frequency > UPPER * differences.frequency[-1])
             & (gain > LEAST_GAIN * gain.max()))
    return differences.level(upper, gain[upper])


def position_noise(positions: Sequence[np.ndarray], period: float, integrated: bool = False
                   ) -> np.ndarray:
    """Return the standard deviation (J,) of the white noise of positions (n, J), rad.

    Args:
        positions: of each uninterrupted stretch.
        period: of the samples, s.
        integrated: whether they are the integral of speeds; the noise is that of these then, rad/s.
    """
    return np.sqrt(noise_variance(mean_spectrum(
        [second_difference(q, period) for q in positions], period), period, integrated))
