"""Torque that follows its command late, with first order."""

from __future__ import annotations

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature, beyond
from par4_dynamics.effects.time_rate import time_rate

LONGEST = 0.05


class ActuatorLag(Effect):
    """tau += T dtau/dt: the command that a drive with tau + T dtau/dt = command needs."""

    name = 'actuator_lag'
    phrase = 'first-order lag of the actuators'
    parameters = (EffectParameter('time_constant', 's', 'machine'),)
    shared = True
    retimes = True
    needs_nominal = True

    def columns(self, state, shape):  # noqa: ARG002
        return time_rate(state, state.nominal.delivered)[..., None]

    def implausible(self, values, std, base):  # noqa: ARG002
        constant = float(values['time_constant'][0])
        if beyond(constant, std['time_constant'][0], 0.0, LONGEST) is not None:
            return (f'a drive lags by a time constant above 0 and up to {LONGEST:g} s, '
                    f'found {constant:.3g} s')
        return None

    def signature(self, state):
        return Signature(self.columns(state, {})[..., 0], 'rate of the torque, N m/s')
