"""Viscous friction of another slope in each direction."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature


class ViscousAsymmetry(Effect):
    """tau_i += a_i |qd|: slopes f_v + a forward and f_v - a backward."""

    name = 'viscous_asymmetry'
    phrase = 'viscous friction that differs between the directions'
    parameters = (EffectParameter('asymmetry', 'N m s/rad', 'joint'),)

    def columns(self, state, shape):  # noqa: ARG002
        return np.abs(state.qd)[..., None]

    def implausible(self, values, base):
        excess = np.abs(values['asymmetry']) - base['viscous_friction']
        worst = int(np.argmax(excess))
        if excess[worst] >= 0.0:
            return (f'an asymmetry of {values["asymmetry"][worst]:.3g} N m s/rad is not less than '
                    f'the viscous friction {base["viscous_friction"][worst]:.3g} N m s/rad: it '
                    f'would drive the joint in one direction')
        return None

    def signature(self, state):
        return Signature(state.qd, 'joint speed, rad/s')
