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


class Stribeck(Effect):
    """tau_i += F_s exp(-(qd / v_s)^2) sign(qd): breakaway above the Coulomb level."""

    name = 'stribeck'
    phrase = 'Stribeck friction'
    parameters = (EffectParameter('stribeck_torque', 'N m', 'joint'),
                  EffectParameter('stribeck_velocity', 'rad/s', 'joint', is_shape=True))

    def shapes(self, state: State) -> tuple[Shape, ...]:
        fastest = float(np.max(np.abs(state.qd)))
        return tuple({'stribeck_velocity': float(speed)} for speed in SPEEDS
                     if speed < 0.5 * fastest)

    def refined(self, shape: Shape, step: float) -> tuple[Shape, ...]:
        return around('stribeck_velocity', single(shape['stribeck_velocity']),
                      (SPEEDS[1] / SPEEDS[0]) ** step)

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        ratio = state.qd / single(shape['stribeck_velocity'])
        return (np.exp(-ratio * ratio) * np.sign(state.qd))[..., None]

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
