"""Torque periodic in the joint angle, whatever the load."""

from __future__ import annotations

import numba
import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature

LOWEST_PERIODS, HIGHEST_PERIODS = 4, 160
LEAST_TURNS = 1.5
"""Periods in the range of a joint below which they cannot be told from gravity."""


@numba.njit(cache=True, error_model='numpy')
def _power_rows(phasor, exponent, columns):
    """Write sine and cosine (n, J, 2) of a whole multiple of the angles of exp(i q) (n, J)."""
    for row in range(phasor.shape[0]):
        for joint in range(phasor.shape[1]):
            power, square, left = 1.0 + 0.0j, phasor[row, joint], exponent
            while left:  # the binary digits of the exponent
                if left & 1:
                    power *= square
                square *= square
                left >>= 1
            columns[row, joint, 0], columns[row, joint, 1] = power.imag, power.real


class Cogging(Effect):
    """tau_i += a_i sin(N q_i + phi_i): slots of the motor, seen through its gear."""

    name = 'cogging'
    phrase = 'cogging torque'
    parameters = (EffectParameter('amplitude', 'N m', 'joint'),
                  EffectParameter('periods', '1/turn', 'machine', is_shape=True),
                  EffectParameter('phase', 'rad', 'joint'))

    def shapes(self, state):
        # periods a turn are whole: the torque returns after one turn
        span = float(np.max(np.ptp(state.q, axis=0)))  # of the joint that moves most
        lowest = max(LOWEST_PERIODS, int(np.ceil(LEAST_TURNS * 2.0 * np.pi / max(span, 1e-3))))
        return tuple({'periods': float(periods)}
                     for periods in range(lowest, HIGHEST_PERIODS + 1))

    def columns(self, state, shape):
        periods = shape['periods']
        if periods not in range(HIGHEST_PERIODS + 1):  # a model file may have any number
            return np.stack((np.sin(periods * state.q), np.cos(periods * state.q)), axis=-1)
        columns = np.empty((*state.q.shape, 2))
        _power_rows(state.phasor, int(periods), columns)
        return columns

    def coefficients(self, values):
        return values['amplitude'] * np.stack((np.cos(values['phase']), np.sin(values['phase'])))

    def values(self, coefficients, shape):
        amplitude = np.hypot(coefficients[0], coefficients[1])
        return {'amplitude': amplitude,
                'periods': np.full_like(amplitude, shape['periods']),
                'phase': np.arctan2(coefficients[1], coefficients[0])}

    def implausible(self, values, std, base):  # noqa: ARG002
        return None

    def signature(self, state):
        return Signature(state.q, 'joint position, rad')
