"""Torque that follows its command late, with first order."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import (
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
    beyond,
)
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State

LONGEST = 0.05


class ActuatorLag(Effect):
    """tau += T dtau/dt: the command is recorded, its torque lags; of readings it is time_offset."""

    name = 'actuator_lag'
    phrase = 'first-order lag of the actuators'
    parameters = (EffectParameter('time_constant', 's', 'machine'),)
    shared = True
    retimes = True
    needs_nominal = True
    looks_around = True
    needs_both_ways = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return time_rate(state, state.told)[..., None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        constant = float(values['time_constant'][0])
        if beyond(constant, std['time_constant'][0], 0.0, LONGEST) is not None:
            return (f'a drive lags by a time constant above 0 and up to {LONGEST:g} s, '
                    f'found {constant:.3g} s')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(self.columns(state, {})[..., 0], 'rate of the torque, N m/s')
