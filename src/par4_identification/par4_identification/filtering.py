"""Zero-phase filters and derivatives of measured signals, along the first axis."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from par4_kinematics.errors import InputError


def low_pass(values: np.ndarray, cutoff_hz: float, period: float, order: int = 4) -> np.ndarray:
    """Return `values` (n, ...) after a Butterworth filter run forward and backward (no phase).

    The magnitude at `cutoff_hz` is one half (two passes of -3 dB).

    Raises:
        InputError: fewer samples than the filter needs, or a cut-off beyond the Nyquist frequency.
    """
    nyquist = 0.5 / period
    if not 0.0 < cutoff_hz < nyquist:
        raise InputError(f'low-pass at {cutoff_hz:g} Hz asked of samples with a Nyquist frequency '
                         f'of {nyquist:g} Hz; lower the cut-off or record faster')
    sections = butter(order, cutoff_hz, fs=1.0 / period, output='sos')
    padding = int(min(3 * len(values) // 4, 3.0 / (cutoff_hz * period)))
    if len(values) < 3 * order:
        raise InputError(f'low-pass: {len(values)} samples are too few, {3 * order} needed')
    return sosfiltfilt(sections, values, axis=0, padlen=padding)


def central_difference(values: np.ndarray, period: float) -> np.ndarray:
    """Return the time derivative of `values` (n, ...) by central differences of fourth order.

    The magnitude at w rad/s is 1 - (w period)^4 / 30; the second order formula's 1 - (w period)^2
    / 6 would bias inertias by a tenth of a percent. Second order beside the ends, one-sided there.
    """
    derivative = np.empty_like(values)
    derivative[2:-2] = (8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / (
        12.0 * period)
    derivative[1] = (values[2] - values[0]) / (2.0 * period)
    derivative[-2] = (values[-1] - values[-3]) / (2.0 * period)
    derivative[0] = (values[1] - values[0]) / period
    derivative[-1] = (values[-1] - values[-2]) / period
    return derivative


def second_difference(values: np.ndarray, period: float) -> np.ndarray:
    """Return the second time derivative of `values` (n, ...) by central differences.

    Fourth order; second order beside the ends, which repeat their neighbours.
    """
    derivative = np.empty_like(values)
    derivative[2:-2] = (16.0 * (values[3:-1] + values[1:-3]) - (values[4:] + values[:-4])
                        - 30.0 * values[2:-2]) / (12.0 * period ** 2)
    derivative[1] = (values[2] - 2.0 * values[1] + values[0]) / period ** 2
    derivative[-2] = (values[-1] - 2.0 * values[-2] + values[-3]) / period ** 2
    derivative[0], derivative[-1] = derivative[1], derivative[-2]
    return derivative
