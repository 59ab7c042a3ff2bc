"""The cycle of a motion that repeats itself, such as that of a production machine."""

from __future__ import annotations

import numpy as np
import scipy

FEWEST = 4
"""Cycles from which on what repeats with the motion is told from what does not."""
ALIKE = 1e-2
"""Mean square of the change after a cycle over the largest after any time: cycles that differ by
a tenth (rms) are the same."""
STILL = 1e-4
"""Share of its range that a joint goes between two samples while it rests, at most."""
LEFT = 0.25
"""That share by which a motion must have changed before it can come back."""


def cycle_of(positions: np.ndarray) -> float | None:
    """Return after how many samples (n,) of one joint's positions come again, in parts of a sample.

    None if they do not, or fewer than `FEWEST` times. Rest before and after the motion is left out.
    """
    moved = np.flatnonzero(np.abs(np.diff(positions)) > STILL * np.ptp(positions))
    if not len(moved):
        return None
    positions = positions[moved[0]:moved[-1] + 2]
    change = _change(positions, len(positions) // 2)
    largest = float(np.max(change, initial=0.0))
    if largest <= 0.0:
        return None
    share = change / largest
    gone = np.flatnonzero(share > LEFT)
    back = gone[0] + np.flatnonzero(share[gone[0]:] < ALIKE)
    if not len(back) or back[0] > len(positions) / FEWEST:
        return None
    apart = np.flatnonzero(np.diff(back) > 1)
    lag = int(back[0] + np.argmin(share[back[0]:back[apart[0] if len(apart) else -1] + 1]))
    count = 1
    while 2 * lag + count < len(share) - 1:  # of twice as many cycles the length is told twice
        lag, count = 2 * lag, 2 * count
        near = slice(lag - count, lag + count + 1)
        lag = near.start + int(np.argmin(share[near]))
    if not 0 < lag < len(share) - 1:
        return float(lag) / count
    before, here, after = share[lag - 1:lag + 2]
    bend = before - 2.0 * here + after
    return float(lag + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) / count


def _change(positions: np.ndarray, most: int) -> np.ndarray:
    """Return the mean square of the change of positions (n,) after 0, 1 .. `most` samples."""
    centred = positions - positions.mean()
    count = len(centred)
    size = scipy.fft.next_fast_len(2 * count, real=True)
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    products = np.fft.irfft(spectrum, size)[:most + 1]
    squares = np.concatenate(([0.0], np.cumsum(centred ** 2)))
    lags = np.arange(most + 1)
    both = squares[count - lags] + squares[count] - squares[lags]
    return np.asarray(np.maximum(both - 2.0 * products, 0.0) / (count - lags))
