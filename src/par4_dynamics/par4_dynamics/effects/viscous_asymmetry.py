"""Viscous friction of another slope in each direction."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.asymmetry import driving_one_way
from par4_dynamics.effects.effect import Base, Effect, EffectParameter, Shape, Signature, Values
from par4_dynamics.state import State


class ViscousAsymmetry(Effect):
    """tau_i += a_i |qd|: slopes f_v + a forward and f_v - a backward."""

    name = 'viscous_asymmetry'
    phrase = 'viscous friction that differs between the directions'
    friction_term = 'viscous_friction'
    parameters = (EffectParameter('asymmetry', 'N m s/rad', 'joint'),)
    needs_both_ways = True
    told_by_speeds = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return np.abs(state.qd)[..., None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return driving_one_way(values, std, base, 'viscous', 'N m s/rad')

    def signature(self, state: State) -> Signature:
        return Signature(state.qd, 'joint speed, rad/s')
