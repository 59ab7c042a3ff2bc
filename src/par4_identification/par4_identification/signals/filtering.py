"""Zero-phase filters and derivatives of measured signals, along the first axis."""

from __future__ import annotations

import numba
import numpy as np

from par4_kinematics.errors import InputError


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
    if len(values) < 3 * order:
        raise InputError(f'low-pass: {len(values)} samples are too few, {3 * order} needed')
    padding = int(min(3 * len(values) // 4, 3.0 / (cutoff_hz * period)))
    columns = np.asarray(values, dtype=float).reshape(len(values), -1)
    wanted = range(len(columns))[rows]
    result = np.empty((len(wanted), columns.shape[1]))
    _forward_backward(columns, padding, _butterworth(cutoff_hz * period, order), wanted.start,
                      wanted.step, result)
    return result.reshape(-1, *values.shape[1:])


def _butterworth(cutoff: float, order: int) -> np.ndarray:
    """Return the second-order sections b0, a1, a2 (order / 2, 3) of a digital low-pass.

    Bilinear transform of 1 / (s^2 + 2 d s + 1), prewarped; b1 = 2 b0, b2 = b0, a0 = 1; `cutoff` is
    in cycles a sample.
    """
    warped = np.tan(np.pi * cutoff)
    damping = np.sin(np.pi * (2.0 * np.arange(order // 2) + 1.0) / (2.0 * order))
    scale = 1.0 / (1.0 + 2.0 * damping * warped + warped ** 2)
    return np.stack((warped ** 2 * scale, 2.0 * (warped ** 2 - 1.0) * scale,
                     (1.0 - 2.0 * damping * warped + warped ** 2) * scale), axis=1)


@numba.njit(cache=True, error_model='numpy')
def _forward_backward(columns, padding, sections, start, every, result):
    """Write rows start, start + every, ... of filtered columns (n, k) into result (m, k).

    Four columns at a time are copied with what continues them, filtered forward and then backward
    by one section after the other, at rest on the first row of either way, and written.
    """
    count, width = columns.shape
    lines, ends = np.zeros((count + 2 * padding, 4)), np.empty(4)
    for first in range(0, width, 4):
        lanes = min(4, width - first)
        for row in range(padding):
            for lane in range(lanes):
                column = first + lane
                lines[row, lane] = 2.0 * columns[0, column] - columns[padding - row, column]
                lines[padding + count + row, lane] = (
                    2.0 * columns[count - 1, column] - columns[count - 2 - row, column])
        lines[padding:padding + count, :lanes] = columns[:, first:first + lanes]
        for direction in (1, -1):
            ends[:] = lines[0 if direction == 1 else len(lines) - 1]
            for section in range(len(sections)):
                _sweep(lines, sections[section], ends, direction)
        for row in range(len(result)):
            for lane in range(lanes):
                result[row, first + lane] = lines[padding + start + row * every, lane]


@numba.njit(cache=True, error_model='numpy')
def _sweep(lines, section, rest, direction):
    """Filter lines (n, 4) in place by one section, forward or backward, at rest at rest (4,).

    Direct form II transposed. A row waits for the row before it; so what is carried from row to
    row is in scalars, which stay in registers.
    """
    gain, a1, a2 = section
    row = 0 if direction == 1 else len(lines) - 1
    near_0, near_1, near_2, near_3 = ((1.0 - gain) * rest[0], (1.0 - gain) * rest[1],
                                      (1.0 - gain) * rest[2], (1.0 - gain) * rest[3])
    far_0, far_1, far_2, far_3 = ((gain - a2) * rest[0], (gain - a2) * rest[1],
                                  (gain - a2) * rest[2], (gain - a2) * rest[3])
    for _ in range(len(lines)):
        line = lines[row]
        in_0, in_1, in_2, in_3 = gain * line[0], gain * line[1], gain * line[2], gain * line[3]
        out_0, out_1, out_2, out_3 = in_0 + near_0, in_1 + near_1, in_2 + near_2, in_3 + near_3
        near_0, near_1 = (2.0 * in_0 + far_0) - a1 * out_0, (2.0 * in_1 + far_1) - a1 * out_1
        near_2, near_3 = (2.0 * in_2 + far_2) - a1 * out_2, (2.0 * in_3 + far_3) - a1 * out_3
        far_0, far_1 = in_0 - a2 * out_0, in_1 - a2 * out_1
        far_2, far_3 = in_2 - a2 * out_2, in_3 - a2 * out_3
        line[0], line[1], line[2], line[3] = out_0, out_1, out_2, out_3
        row += direction


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
