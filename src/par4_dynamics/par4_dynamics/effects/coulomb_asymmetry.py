"""Coulomb friction of another size in each direction."""

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
from par4_dynamics.state import State


class CoulombAsymmetry(Effect):
    """tau_i += a_i while joint i moves: plateaus f_c + a and -(f_c - a), zero at rest."""

    name = 'coulomb_asymmetry'
    phrase = 'Coulomb friction that differs between the directions'
    parameters = (EffectParameter('asymmetry', 'N m', 'joint'),)
    needs_both_ways = True
    told_by_speeds = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return (state.qd != 0.0).astype(float)[..., None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        asymmetry, level = values['asymmetry'], base['coulomb_friction']
        worst = beyond(asymmetry, std['asymmetry'], -level, level)
        if worst is not None:
            return (f'an asymmetry of {asymmetry[worst]:.3g} N m is not less than the Coulomb '
                    f'level {level[worst]:.3g} N m: friction would drive the joint in one '
                    f'direction')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.qd, 'joint speed, rad/s')
