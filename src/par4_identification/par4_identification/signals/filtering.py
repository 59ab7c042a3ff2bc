"""Zero-phase filters and derivatives of measured signals, along the first axis."""

from __future__ import annotations

from functools import lru_cache

import numba
import numpy as np

from par4_kinematics.errors import InputError

AT_ONCE = 32
"""Columns that are filtered together."""
NO_DENORMAL = 1e-200
"""Added to what is filtered, in its unit: where a filter forgets, states decay to it, not to
numbers below 1e-308, with which processors take many times as long."""
NO_SECTION = 1.0, 2.0, 1.0
"""b0, a1, a2 of a section that changes nothing: 1 + 2 / z + 1 / z^2 over itself."""


def reach_of(cutoff: float) -> float:
    """Return half the time over which `low_pass` remembers.

    Args:
        cutoff: in Hz for a time in s, or in cycles a sample for one in samples.
    """
    return 0.9 / cutoff


def fewest_samples(order: int = 4) -> int:
    """Return how many samples `low_pass` of an order needs."""
    return 3 * order


def low_pass(values: np.ndarray, cutoff_hz: float, period: float, order: int = 4,
             rows: slice = slice(None)) -> np.ndarray:
    """Return `values` (n, ...) after a Butterworth filter run forward and backward (no phase).

    The magnitude at `cutoff_hz` is one half (two passes of -3 dB). Beyond either end the values
    are continued by their reflection through the end point.

    Args:
        values: (n, ...).
        cutoff_hz: of the filter.
        period: of the values, s.
        order: of either pass, even.
        rows: which to return; the others are not kept.

    Raises:
        InputError: fewer samples than the filter needs, or a cut-off beyond the Nyquist frequency.
    """
    nyquist = 0.5 / period
    if not 0.0 < cutoff_hz < nyquist:
        raise InputError(f'low-pass at {cutoff_hz:g} Hz asked of samples with a Nyquist frequency '
                         f'of {nyquist:g} Hz; lower the cut-off or record faster')
    if len(values) < fewest_samples(order):
        raise InputError(f'low-pass: {len(values)} samples are too few, {fewest_samples(order)} '
                         f'needed')
    padding = int(min(3 * len(values) // 4, 3.0 / (cutoff_hz * period)))
    columns = np.asarray(values, dtype=float).reshape(len(values), -1)
    sections = _butterworth(cutoff_hz * period, order)
    filtered = np.empty((len(columns[rows]), columns.shape[1]))
    # of few columns at a time, so that the same memory serves all of them
    buffer = np.empty((len(columns) + 2 * padding) * min(columns.shape[1], AT_ONCE))
    for first in range(0, columns.shape[1], AT_ONCE):
        some = columns[:, first:first + AT_ONCE]
        lines = buffer[:(len(columns) + 2 * padding) * some.shape[1]].reshape(-1, some.shape[1])
        inner = lines[padding:padding + len(columns)]
        np.add(some, NO_DENORMAL, out=inner)
        lines[:padding] = 2.0 * some[0] - some[padding:0:-1]
        lines[len(lines) - padding:] = 2.0 * some[-1] - some[-2:-2 - padding:-1]
        _forward_backward(lines, sections)
        filtered[:, first:first + AT_ONCE] = inner[rows]
    return filtered.reshape(-1, *values.shape[1:])


def passed(frequency: np.ndarray, cutoff_hz: float, period: float, order: int = 4) -> np.ndarray:
    """Return the share of a wave's amplitude that `low_pass` lets through, up to Nyquist's.

    Args:
        frequency: Hz, up to half the sample rate.
        cutoff_hz, period, order: of `low_pass`.
    """
    ratio = np.tan(np.pi * frequency * period) / np.tan(np.pi * cutoff_hz * period)
    return np.asarray(1.0 / (1.0 + ratio ** (2 * order)))


@lru_cache(maxsize=64)
def _butterworth(cutoff: float, order: int) -> np.ndarray:
    """Return the second-order sections b0, a1, a2 (m, 3) of a digital low-pass, m even.

    Bilinear transform of 1 / (s^2 + 2 d s + 1), prewarped; b1 = 2 b0, b2 = b0, a0 = 1; `cutoff` is
    in cycles a sample. An odd number of sections is made even by one that changes no bit.
    """
    warped = np.tan(np.pi * cutoff)
    damping = np.sin(np.pi * (2.0 * np.arange(order // 2) + 1.0) / (2.0 * order))
    scale = 1.0 / (1.0 + 2.0 * damping * warped + warped ** 2)
    sections = np.stack((warped ** 2 * scale, 2.0 * (warped ** 2 - 1.0) * scale,
                         (1.0 - 2.0 * damping * warped + warped ** 2) * scale), axis=1)
    return sections if len(sections) % 2 == 0 else np.vstack((sections, NO_SECTION))


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _forward_backward(lines, sections):
    """Filter columns (n, k) in place, forward and then backward."""
    for first in range(0, len(sections), 2):
        _sweep(lines, sections[first:first + 2], 0, len(lines), 1)
    for first in range(0, len(sections), 2):
        _sweep(lines, sections[first:first + 2], len(lines) - 1, -1, -1)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _sweep(lines, sections, start, stop, step):
    """Run two sections over the rows from `start` on, in place.

    Direct form II transposed, at rest on the first row. A row waits for the row before it, a column
    for no other: columns are the inner loop, which the compiler turns into vector instructions. The
    second section works on a row while the first one is at the next.
    """
    gain, a1, a2 = sections[0]
    next_gain, next_a1, next_a2 = sections[1]
    first = lines[start]
    near, far = (1.0 - gain) * first, (gain - a2) * first
    passed_on = gain * first + near
    next_near, next_far = (1.0 - next_gain) * passed_on, (next_gain - next_a2) * passed_on
    for row in range(start, stop, step):
        line = lines[row]
        for column in range(len(line)):
            value = gain * line[column]
            out = value + near[column]
            near[column] = (2.0 * value + far[column]) - a1 * out
            far[column] = value - a2 * out
            value = next_gain * out
            out = value + next_near[column]
            next_near[column] = (2.0 * value + next_far[column]) - next_a1 * out
            next_far[column] = value - next_a2 * out
            line[column] = out


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
