"""Coulomb friction of another size in each direction."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature


class CoulombAsymmetry(Effect):
    """tau_i += a_i while joint i moves: plateaus f_c + a and -(f_c - a), zero at rest."""

    name = 'coulomb_asymmetry'
    phrase = 'Coulomb friction that differs between the directions'
    parameters = (EffectParameter('asymmetry', 'N m', 'joint'),)

    def columns(self, state, shape):  # noqa: ARG002
        return (state.qd != 0.0).astype(float)[..., None]

    def implausible(self, values, base):
        excess = np.abs(values['asymmetry']) - base['coulomb_friction']
        worst = int(np.argmax(excess))
        if excess[worst] >= 0.0:
            return (f'an asymmetry of {values["asymmetry"][worst]:.3g} N m is not less than the '
                    f'Coulomb level {base["coulomb_friction"][worst]:.3g} N m: friction would '
                    f'drive the joint in one direction')
        return None

    def signature(self, state):
        return Signature(state.qd, 'joint speed, rad/s')
