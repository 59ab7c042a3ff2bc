"""Torque recorded late or early against the positions."""

from __future__ import annotations

import numba
import numpy as np

from par4_dynamics.effects.effect import (
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
    beyond,
    single,
)
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State

LONGEST = 0.15
"""s: a recorder behind buffers and a bus may be 100 ms late."""


class TimeOffset(Effect):
    """tau += tau(t - d) - tau(t): d > 0 where torque is stamped late, or low-passed with T = d.

    The column is this change, at the delay that the shape `expanded_at` holds, divided by that
    delay; at 0 it is the slope -dtau/dt. It is exact where the coefficient d equals `expanded_at`.
    """

    name = 'time_offset'
    phrase = 'torque recorded out of time with the positions'
    by_sign = ('torque recorded {} late against the positions',
               'torque recorded {} early against the positions')
    parameters = (EffectParameter('delay', 's', 'machine'),)
    shared = True
    expanded = True
    retimes = True
    needs_nominal = True
    looks_around = True
    needs_both_ways = True

    def shapes(self, state: State) -> tuple[Shape, ...]:
        return ({'expanded_at': 0.0},)

    def free_numbers(self, shape: Shape) -> int:
        return 0

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        torque, delay = state.told, single(shape['expanded_at'])
        if delay == 0.0 or len(state.t) < 2:
            return -time_rate(state, torque)[..., None]
        return ((_earlier(state, torque, delay) - torque) / delay)[..., None]

    def shape_of(self, values: Values) -> Shape:
        return {'expanded_at': float(values['delay'])}

    def assumes(self, values: Values) -> str | None:
        if 'delay' in values and np.max(values['delay']) <= 0.0:
            return None
        return ('A first-order low pass of the logged torque or current, with a time constant of '
                'the same size, looks like a delay: see whether the drive filters what it logs.')

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        delay = float(values['delay'][0])
        if beyond(delay, std['delay'][0], -LONGEST, LONGEST) is not None:
            return (f'stamps that are wrong by {delay:.3g} s are not an offset of a recorder, '
                    f'expected at most {LONGEST:g} s')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(time_rate(state, state.told), 'rate of the torque, N m/s')


def _earlier(state: State, values: np.ndarray, delay: float) -> np.ndarray:
    """Return `values` (n, J) at t - delay; the first and last hold beyond the ends.

    A cubic by the values and slopes at the two samples around: a straight line between them would
    low-pass fast torque.
    """
    earlier = np.empty(values.shape)
    _earlier_rows(np.ascontiguousarray(state.t), values, time_rate(state, values), delay, earlier)
    return earlier


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _earlier_rows(t, values, slope, delay, earlier):
    """Write values (n, J) at t - delay, of a cubic by values and slopes at the samples around."""
    left = 0
    for row in range(len(t)):
        asked = min(max(t[row] - delay, t[0]), t[-1])
        while left < len(t) - 2 and t[left + 1] <= asked:
            left += 1
        span = t[left + 1] - t[left]
        share = (asked - t[left]) / span
        for joint in range(values.shape[1]):
            start, end = values[left, joint], values[left + 1, joint]
            first, last = span * slope[left, joint], span * slope[left + 1, joint]
            earlier[row, joint] = start + share * (first + share * (
                3.0 * (end - start) - 2.0 * first - last
                + share * (2.0 * (start - end) + first + last)))
