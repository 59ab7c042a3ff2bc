"""White noise of positions, as counts, stamps that tremble and analogue encoders make it.

A motion has next to nothing in the upper half of the frequencies that samples carry. Whatever the
positions hold there is noise, and white noise has the same level below.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.signals.filtering import second_difference

UPPER = 0.5
"""Share of half the sample rate above which a position is taken to hold noise only."""


def second_difference_gain(frequency: np.ndarray, period: float) -> np.ndarray:
    """Return the factor (k,), 1/s^4, by which `second_difference` multiplies the power there."""
    angle = 2.0 * np.pi * frequency * period
    return ((30.0 - 32.0 * np.cos(angle) + 2.0 * np.cos(2.0 * angle))
            / (12.0 * period ** 2)) ** 2


def mean_spectrum(signals: Sequence[np.ndarray], period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies (k,), Hz, and the mean power of signals (n, J) there, (k, J).

    That of white noise is its variance at each frequency. The mean is over windows of a second that
    overlap by half (Welch 1967); zero where no signal is as long.
    """
    length = max(round(1.0 / period), 16)
    window = np.hanning(length)
    joints = signals[0].shape[1] if signals else 1
    total, windows = np.zeros((length // 2 + 1, joints)), 0
    for signal in signals:
        for first in range(0, len(signal) - length + 1, length // 2):
            part = signal[first:first + length]
            total += np.abs(np.fft.rfft(window[:, None] * (part - part.mean(axis=0)), axis=0)) ** 2
            windows += 1
    return (np.fft.rfftfreq(length, period),
            total / (max(windows, 1) * float(np.sum(window ** 2))))


def noise_variance(frequency: np.ndarray, power: np.ndarray, period: float) -> np.ndarray:
    """Return the variance (J,) of the white noise of positions.

    Args:
        frequency: Hz, (k,).
        power: of the second difference of the positions, (k, J), see `mean_spectrum`.
        period: of the samples, s.
    """
    upper = frequency > UPPER * frequency[-1]
    return np.asarray(np.median(power[upper] / second_difference_gain(
        frequency[upper], period)[:, None], axis=0))


def position_noise(positions: Sequence[np.ndarray], period: float) -> np.ndarray:
    """Return the standard deviation (J,) of the white noise of positions (n, J), rad.

    Args:
        positions: of each uninterrupted stretch.
        period: of the samples, s.
    """
    return np.sqrt(noise_variance(*mean_spectrum(
        [second_difference(q, period) for q in positions], period), period))
