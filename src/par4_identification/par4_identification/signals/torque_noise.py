"""The noise of the torque in the rows, told by the torque above their pass band."""

from __future__ import annotations

import numpy as np

from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import fewest_samples, low_pass, passed
from par4_kinematics.robot import Axis, Robot

QUIET_BANDS = 4
"""In which the noise of an axis's torque is looked at."""
BAND_ORDER = 8
"""Of the filters that part these bands."""


def samples_for_floor(conditioning: Conditioning, period: float, machine: Robot | Axis) -> int:
    """Return how many samples, `period` s apart, `white_floor` takes at the least."""
    return fewest_samples(BAND_ORDER) if len(_edges(conditioning, period, machine)) else 0


def _edges(conditioning: Conditioning, period: float, machine: Robot | Axis) -> np.ndarray:
    """Return the edges, Hz, of the bands above the pass band; none where there is no room."""
    nyquist = 0.5 / period
    above, bands = (2.0, QUIET_BANDS) if isinstance(machine, Axis) else (4.0, 1)
    lowest = above * conditioning.torque_cutoff_hz
    return np.linspace(lowest, nyquist, bands + 1) if lowest <= 0.9 * nyquist else np.empty(0)


def white_floor(torque: np.ndarray, conditioning: Conditioning, period: float,
                machine: Robot | Axis) -> np.ndarray:
    """Return the standard deviation (J,) in the pass band that the level above it implies.

    The median size of the torque in a band above the cut-off is taken as that of white noise. The
    median over time leaves out the bursts with which the drives answer reversals. Noise that is
    stronger below the pass band is underrated; torque with which the drives follow encoder counts
    is counted though it moves the arms, so that a residual may lie some 10 % below. White noise is
    as loud in any band, the chatter of a drive or the ripple of a gear in some. So the quietest of
    several bands counts on an axis, which may be any machine.

    Args:
        torque: as measured, (n, J), N m.
        conditioning: has the pass band.
        period: between samples, s.
        machine: that was measured.

    Returns:
        N m; zeros where the samples leave no room above the pass band.
    """
    frequency = np.fft.rfftfreq(len(torque), period)
    edges = _edges(conditioning, period, machine)
    if not len(edges):
        return np.zeros(torque.shape[1])
    below = [*(low_pass(torque, edge, period, order=BAND_ORDER) for edge in edges[:-1]), torque]
    shares = [*(passed(frequency, edge, period, order=BAND_ORDER) for edge in edges[:-1]),
              np.ones_like(frequency)]
    levels = [np.median(np.abs(below[band + 1] - below[band]), axis=0) / np.sqrt(np.mean(
        (shares[band + 1] - shares[band]) ** 2)) for band in range(len(edges) - 1)]
    in_band = np.sqrt(np.mean(passed(frequency, conditioning.torque_cutoff_hz, period) ** 2))
    return np.asarray(np.min(levels, axis=0) / 0.6745 * in_band)
