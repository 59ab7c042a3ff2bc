"""Torque that follows its command late, with first order."""

from __future__ import annotations

import numba
import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature
from par4_dynamics.effects.time_rate import time_rate

LONGEST = 0.05
EXPANDED_AT = (0.0, 5e-4, 1e-3, 2e-3, 3e-3, 4.5e-3, 7e-3, 1e-2)
"""s, of the expansion points."""


class ActuatorLag(Effect):
    """tau += T dtau/dt: the command that a drive with tau + T dtau/dt = command needs.

    Of a record, the command is known better than tau: the column is the command less what a lag of
    the time constant it is `expanded_at` makes of it, divided by that.
    """

    name = 'actuator_lag'
    phrase = 'first-order lag of the actuators'
    parameters = (EffectParameter('time_constant', 's', 'machine'),)
    shared = True
    needs_nominal = True

    def shapes(self, state):
        if state.recorded is None:
            return ({'expanded_at': 0.0},)
        return tuple({'expanded_at': constant} for constant in EXPANDED_AT)

    def columns(self, state, shape):
        constant = shape.get('expanded_at', 0.0)
        if state.recorded is None:
            return time_rate(state, state.nominal.torque)[..., None]
        if constant == 0.0 or len(state.t) < 2:
            return time_rate(state, state.recorded)[..., None]
        late = lagged(state.recorded, constant, state.t[1] - state.t[0])
        return ((state.recorded - late) / constant)[..., None]

    def implausible(self, values, base):  # noqa: ARG002
        constant = float(values['time_constant'][0])
        if not 0.0 < constant <= LONGEST:
            return (f'a drive lags by a time constant above 0 and up to {LONGEST:g} s, '
                    f'found {constant:.3g} s')
        return None

    def signature(self, state):
        return Signature(self.columns(state, {})[..., 0], 'rate of the torque, N m/s')


@numba.njit(cache=True, error_model='numpy')
def _lag(values, keep, late, early, result):
    for column in range(values.shape[1]):
        result[0, column] = values[0, column]
        for row in range(1, values.shape[0]):
            result[row, column] = (keep * result[row - 1, column] + late * values[row - 1, column]
                                   + early * values[row, column])


def lagged(values: np.ndarray, constant: float, period: float) -> np.ndarray:
    """Return values (n, J) behind a first-order lag of `constant` s; straight between samples."""
    keep = float(np.exp(-period / constant))
    mean = constant / period * (1.0 - keep)
    result = np.empty_like(values)
    _lag(np.ascontiguousarray(values), keep, mean - keep, 1.0 - mean, result)
    return result
