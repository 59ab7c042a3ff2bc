"""Coulomb friction of another size in each direction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from par4_dynamics.effects.asymmetry import ASYMMETRY, driving_one_way
from par4_dynamics.effects.effect import Base, Effect, EffectParameter, Shape, Signature, Values
from par4_dynamics.state import State


class CoulombAsymmetry(Effect):
    """tau_i += a_i while joint i moves: plateaus f_c + a and -(f_c - a), zero at rest."""

    name = 'coulomb_asymmetry'
    phrase = 'Coulomb friction that differs between the directions'
    friction_term = 'coulomb_friction'
    parameters = (EffectParameter('asymmetry', 'N m', 'joint'),)
    needs_both_ways = True
    told_by_speeds = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return (state.qd != 0.0).astype(float)[..., None]

    def base_part(self, values: Values) -> Mapping[str, np.ndarray]:
        return {ASYMMETRY: values['asymmetry']}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return driving_one_way(values, std, base, 'Coulomb', 'N m')

    def signature(self, state: State) -> Signature:
        return Signature(state.qd, 'joint speed, rad/s')
