"""Errors of rows by times that are not quite known: of readings, and of joints that turn back."""

from __future__ import annotations

import numpy as np
import scipy

from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import fewest_samples, low_pass

READ_WITHIN = 0.01
"""Time from the instants at which torque and positions are read to their stamps, over that between
samples (standard deviation)."""
TICK = 1e-3
"""s after which the drives of a Par4 get a torque, at the latest: one that jumps does so at a tick,
which a slower log does not tell from others between its samples."""
LONGEST_TICKED = 2.5e-3
"""s between samples up to which a jump stands out of a torque that goes on."""
TURNED_WITHIN = 0.01
"""Error of the times at which joints turn back, over the period of the positions' cut-off. Friction
changes an acceleration there, and the low-pass rounds it off."""
ROUNDED = 0.032
"""Time by which the low-pass of the positions rounds off a bend of the speed, over the period of
its cut-off: its first moment on one side, where speeds are read, on average over the samples."""
JUMP, LARGE = 5.0, 0.2
"""Change of the slope of a torque from sample to sample, in standard deviations of the usual ones,
and over the largest torque, from which it is a jump."""


def timing_error(torque: np.ndarray, conditioning: Conditioning, period: float, parts: int,
                 tick: float = np.inf) -> np.ndarray:
    """Return the standard deviation (n, J), N m, of filtered torque by the times of its readings.

    A torque that jumps between two samples is wrong by the jump until its reading comes. Over the
    time by which readings may come early or late that makes an impulse, which the filter spreads.
    A torque that goes on as it did is told by its neighbours, so its change of slope counts where
    it stands out of the noise and is no small part of the torque, as that of friction is at a
    reversal.

    Args:
        torque: (n, J), N m.
        conditioning: filters.
        period: of the torque, s.
        parts: samples of `torque` that are one of the log.
        tick: time from one command of a torque to the next, s, where that is known.
    """
    jump = np.zeros_like(torque)
    jump[parts:-parts] = torque[2 * parts:] - 2.0 * torque[parts:-parts] + torque[:-2 * parts]
    size = np.abs(jump)
    jump[size < np.maximum(JUMP * 1.4826 * np.median(size, axis=0),
                           LARGE * np.abs(torque).max(axis=0))] = 0.0
    ticks = max(period / tick, 1.0) if period <= LONGEST_TICKED else 1.0
    within = np.hypot(READ_WITHIN, np.sqrt((ticks ** 2 - 1.0) / 12.0) / ticks)  # of as many
    return within * _filtered_size(np.sqrt(parts) * jump, conditioning, period)


def turning_error(qd: np.ndarray, conditioning: Conditioning, period: float) -> np.ndarray:
    """Return the standard deviation (n, J) of filtered friction of 1 by the times of turning.

    Until a joint that has turned back is seen to have, friction is wrong by twice its size.
    """
    turns = np.zeros_like(qd)
    turns[1:] = np.signbit(qd[1:]) != np.signbit(qd[:-1])
    samples = TURNED_WITHIN / (conditioning.position_cutoff_hz * period)
    return _filtered_size(2.0 * samples * turns, conditioning, period)


def _filtered_size(impulses: np.ndarray, conditioning: Conditioning, period: float) -> np.ndarray:
    """Return the standard deviation (n, J) of filtered impulses whose signs are anyone's."""
    reach = max(int(np.ceil(conditioning.reach / period)), fewest_samples())
    impulse = np.zeros((2 * reach + 1, 1))
    impulse[reach] = 1.0
    answer = low_pass(impulse, conditioning.torque_cutoff_hz, period)[:, 0]
    return np.sqrt(scipy.ndimage.convolve1d(impulses ** 2, answer ** 2, axis=0, mode='constant'))
