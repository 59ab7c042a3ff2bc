"""Torque that a drive cannot deliver."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature, beyond


class TorqueSaturation(Effect):
    """tau_i += clip(tau_i, -limit_i, limit_i) - tau_i: what the limit takes off the needed torque.

    A recorded command exceeds the limit while the machine gets the limit only, and moves as it
    then must: the torque that this motion needs is within the limit, so that no motion shows the
    effect and it has no shapes to search. Flat tops of the recorded torque do.
    """

    name = 'torque_saturation'
    phrase = 'saturation of the drives'
    parameters = (EffectParameter('limit', 'N m', 'joint', is_shape=True),)
    needs_nominal = True
    fixed_coefficients = True

    def shapes(self, state):  # noqa: ARG002
        return ()

    def columns(self, state, shape):
        torque = state.nominal.torque
        return (np.clip(torque, -shape['limit'], shape['limit']) - torque)[..., None]

    def coefficients(self, values):
        return np.ones_like(values['limit'])[None]

    def implausible(self, values, std, base):
        limit, level = values['limit'], base['coulomb_friction']
        worst = beyond(limit, std['limit'], low=level)
        if worst is not None:
            return (f'a drive limited to {limit[worst]:.3g} N m could not move its joint against '
                    f'Coulomb friction of {level[worst]:.3g} N m')
        return None

    def signature(self, state):
        return Signature(state.nominal.torque, 'torque of the model, N m')
