"""Positions with less noise of encoder counts than they were told with, by Wiener's filter (1949).

Rounding to counts adds noise to positions. The columns of a fit hold derivatives of them, in which
that noise grows with the frequency while the motion fades. Noise in a column biases what is found
towards zero (errors in variables): a compliance by 40 % where joints twist little, and a rigid
inertia beside it takes what is missing. The best linear estimate of the motion, the share
S / (S + N) of each frequency, leaves what a fit finds unbiased: it is regression calibration
(Carroll et al., Measurement Error in Nonlinear Models, 2006).

The noise is not white where a joint goes slowly, and there is none where it rests. So N is that of
the motion itself, as encoders would have rounded it whose counts lie elsewhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from par4_identification.signals.position_noise import mean_spectrum

WINDOW = 0.25
"""Seconds over which spectra are taken and the filter remembers, half to each side."""
FEWEST_WINDOWS = 16
"""Halves of a window that a log must have for its spectrum to tell what is noise."""
CHANCE = 3.0
"""Deviations of a spectrum, which is a mean of so many that overlap by half, within which what it
has beyond that of the noise may be none."""
KNOWN = 0.8
"""Least share of what is told that is motion, up to the highest frequency at which the motion is
known."""
NEARLY_ALL = 0.98
"""The same where motors move with what encoders misread, and that swings."""
RISE = 0.25
"""Share by which what is told rises again, beyond where the motion fades, that is no motion."""
LEAST_CHANGE = 1e-6
"""Of a count, for a position to count as changed."""
WHOLE, ALL = 0.1, 0.9
"""Distance from a whole count, and share of the changes that must be as near to one."""
ROUNDINGS = 8
"""Places of the counts, evenly spread over one, that the noise is the mean of."""


@dataclass(frozen=True)
class Smoother:
    """A filter of positions without a shift in time.

    Attributes:
        taps: of each joint, symmetric, (2 k + 1, J).
        likely_taps: those of its square root.
    """

    taps: np.ndarray
    likely_taps: np.ndarray

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """Return the best estimate of a motion (n, J) from positions as told."""
        return _filtered(values, self.taps)

    def known_hz(self, period: float, least: float = KNOWN) -> float:
        """Return the frequency, Hz, up to which that share of what is told is motion, inf if all.

        It is that of the joint in the middle.
        """
        lost = np.flatnonzero(np.median(self._shares(), axis=1) < least)
        return float(np.fft.rfftfreq(len(self.taps), period)[lost[0]]) if len(lost) else np.inf

    def told_hz(self, period: float, cutoff_hz: float) -> float:
        """Return the frequency, Hz, up to which what is told may swing a load, inf if all may.

        Drives whose loops answer encoder counts move the motors of soft transmissions with what is
        misread. That noise is not independent of the motion, so that part of it passes for motion,
        beyond where the motion has faded.

        Args:
            period: of the samples, s.
            cutoff_hz: of positions; what lies beyond is not looked at.
        """
        frequency = np.fft.rfftfreq(len(self.taps), period)
        for share in self._shares()[frequency < cutoff_hz].T:
            faded = share[np.argmax(share < KNOWN):] if share.min() < KNOWN else share[:1]
            if np.max(faded - np.minimum.accumulate(faded)) > RISE:
                return self.known_hz(period, NEARLY_ALL)
        return np.inf

    def _shares(self) -> np.ndarray:
        """Return the share of what is told that is motion, (k + 1, J) over the frequency."""
        return np.abs(np.fft.rfft(self.taps, axis=0))

    def likely(self, values: np.ndarray) -> np.ndarray:
        """Return a motion (n, J) as lively as the true one, from positions as told.

        The best estimate has the spectrum S^2 / (S + N), less than the motion, and this one S.
        """
        return _filtered(values, self.likely_taps)


UNCHANGED = Smoother(np.ones((1, 1)), np.ones((1, 1)))
"""The filter that leaves positions as they are."""


def smoother_of(parts: Sequence[np.ndarray], counts: int, period: float) -> Smoother:
    """Return the filter that tells a motion best from positions in encoder counts.

    It is one for all stretches of a log: few windows tell a spectrum badly, and a filter from a
    short stretch would take most of its motion for noise.

    Args:
        parts: positions as told, (n, J), rad, of stretches without a gap.
        counts: of the encoders a turn; 0 where they are not known. Then nothing is filtered, nor
            where positions lie between counts, so that a recorder or a finer encoder made them.
        period: of the samples, s.
    """
    half = round(0.5 * WINDOW / period)
    parts = [q for q in parts if len(q) >= 4 * half]
    samples = sum(map(len, parts))
    if half < 2 or samples < FEWEST_WINDOWS * half or not _in_counts(parts, counts):
        return UNCHANGED
    step = 2.0 * np.pi / counts
    told = _spectrum(parts, half, period)
    white = step ** 2 / 12.0 * (2.0 - 2.0 * np.cos(
        np.pi * np.arange(half + 1) / half))[:, None] ** 2
    first = _smoother(told, white, samples)
    motions = [first(q) for q in parts]
    noise = np.mean([_spectrum([rounded(motion, counts, place) - motion for motion in motions],
                               half, period)
                     for place in np.arange(ROUNDINGS) / ROUNDINGS], axis=0)
    return _smoother(told, noise, samples)


def rounded(q: np.ndarray, counts: int, place: float) -> np.ndarray:
    """Return positions (n, J), rad, as encoders tell them whose counts lie at `place` of one."""
    step = 2.0 * np.pi / counts
    return step * (np.round(q / step - place) + place)


def _in_counts(parts: Sequence[np.ndarray], counts: int) -> bool:
    """Return whether positions (n, J) change by whole counts."""
    change = np.concatenate([np.diff(q, axis=0) for q in parts]) * counts / (2.0 * np.pi)
    change = change[np.abs(change) > LEAST_CHANGE]
    return bool(len(change) and np.mean(np.abs(change - np.round(change)) < WHOLE) > ALL)


def speed_noise(counts: int, cutoff_hz: float, period: float) -> float:
    """Return the noise, rad/s rms, of speeds from positions in counts below a frequency."""
    if not counts:
        return 0.0
    rounding = 2.0 * np.pi / counts / np.sqrt(12.0)
    return float(rounding * np.sqrt(2.0 * cutoff_hz * period / 3.0) * 2.0 * np.pi * cutoff_hz)


def _spectrum(stretches: Sequence[np.ndarray], half: int, period: float) -> np.ndarray:
    """Return the spectrum (half + 1, J) of the second difference of positions (n, J) of stretches.

    Its lines leak less into its faint end than those of the positions would. No mean is taken off:
    what is slow is motion.
    """
    return mean_spectrum([np.diff(q, 2, axis=0) for q in stretches], period,
                         np.hanning(2 * half + 1)[:-1], centred=False).power


def _smoother(told: np.ndarray, noise: np.ndarray, samples: int) -> Smoother:
    """Return the filter of positions with a spectrum `told` and that of their noise."""
    half = len(told) - 1
    share = 1.0 - noise / np.maximum(told, np.finfo(float).tiny)
    # a share that chance can make would let noise through, and none at all biases nothing
    share[share < CHANCE / np.sqrt(samples / half)] = 0.0
    share[0] = 1.0
    share[1:-1] = 0.25 * share[:-2] + 0.5 * share[1:-1] + 0.25 * share[2:]
    return Smoother(_taps(share), _taps(np.sqrt(share)))


def _taps(response: np.ndarray) -> np.ndarray:
    """Return the symmetric taps (2 k + 1, J) of a frequency response (k + 1, J) that is real."""
    half = len(response) - 1
    taps = np.fft.fftshift(np.fft.irfft(response, axis=0), axes=0)
    taps = np.concatenate((taps, taps[:1])) * np.hanning(2 * half + 1)[:, None]
    return np.asarray(taps / taps.sum(axis=0))


def _filtered(values: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Return filtered values (n, J); beyond either end they are reflected through it.

    A joint that rests stays at one place to the last digit, as a sum of products has it and a
    Fourier transform has not: the sign of its speed is that of its friction.
    """
    reach = len(taps) // 2
    if reach == 0:
        return values
    wide = np.pad(values, ((reach, reach), (0, 0)), mode='reflect', reflect_type='odd')
    return np.stack([scipy.ndimage.convolve1d(line, own)[reach:-reach]
                     for line, own in zip(wide.T, taps.T)], axis=1)
