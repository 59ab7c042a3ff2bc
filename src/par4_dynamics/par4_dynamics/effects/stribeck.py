"""Friction that is higher at low speed."""

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
    single,
)
from par4_dynamics.effects.grid import around
from par4_dynamics.state import State

SPEEDS = np.geomspace(0.01, 1.0, 13)
"""rad/s, of the arms of a Par4."""
SPEEDS_OF_AXIS = np.geomspace(0.002, 0.5, 17)
"""The same of an axis, whose speeds may be any, over its fastest."""
USUAL, TUSTIN = 2.0, 1.0
"""Exponents of the decay: of a Gaussian, and of Tustin's exponential."""


class Stribeck(Effect):
    """tau_i += F_s exp(-|qd / v_s|^a) sign(qd): breakaway above the Coulomb level.

    A shape without an exponent has the usual one (Armstrong-Helouvry, Dupont and Canudas de Wit
    1994 give 0.5 to 2 for materials in use, more for oils with friction modifiers).
    """

    name = 'stribeck'
    told_by_speeds = True
    law = 'exponent'
    phrase = 'Stribeck friction'
    friction_term = 'coulomb_friction'
    parameters = (EffectParameter('stribeck_torque', 'N m', 'joint'),
                  EffectParameter('stribeck_velocity', 'rad/s', 'joint', is_shape=True,
                                  positive=True),
                  EffectParameter('exponent', '1', 'joint', default=USUAL, is_shape=True,
                                  positive=True))

    def shapes(self, state: State) -> tuple[Shape, ...]:
        fastest = float(np.max(np.abs(state.qd)))
        arm = state.geometry is not None
        speeds = [float(speed) for speed in (SPEEDS if arm else SPEEDS_OF_AXIS * fastest)
                  if speed < 0.5 * fastest]
        usual = tuple({'stribeck_velocity': speed} for speed in speeds)
        return (*usual, *({**shape, 'exponent': TUSTIN} for shape in usual))

    def refined(self, shape: Shape, step: float) -> tuple[Shape, ...]:
        return tuple({**shape, **moved} for moved in around(
            'stribeck_velocity', single(shape['stribeck_velocity']),
            (SPEEDS[1] / SPEEDS[0]) ** step))

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        ratio = np.abs(state.qd) / single(shape['stribeck_velocity'])
        decayed = np.exp(-ratio ** single(shape.get('exponent', USUAL)))
        return (decayed * state.direction)[..., None]

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        return super().values(coefficients, {'exponent': USUAL, **shape})

    def shape_of(self, values: Values) -> Shape:
        shape = super().shape_of({'exponent': np.array(USUAL), **values})
        return {name: value for name, value in shape.items()
                if name != 'exponent' or value != USUAL}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        torque, level = values['stribeck_torque'], base['coulomb_friction']
        worst = beyond(torque, std['stribeck_torque'], low=0.0)
        if worst is not None:
            return f'Stribeck torque must add to friction, found {torque[worst]:.3g} N m'
        worst = beyond(torque, std['stribeck_torque'], high=2.0 * level)
        if worst is not None:
            return (f'Stribeck torque {torque[worst]:.3g} N m is more than twice the Coulomb level '
                    f'{level[worst]:.3g} N m')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.qd, 'joint speed, rad/s')
