"""Friction of the belt and pulleys that turn the tool."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.dissipation import feeds_energy
from par4_dynamics.effects.effect import Effect, EffectParameter, Signature

TYPICAL_RATE = 5.0
"""rad/s of theta."""
LARGEST = 5.0
"""N m at that rate, ten times what belts and pulleys take."""


class ThetaFriction(Effect):
    """tau += J_1^T (0, 0, 0, coulomb sign(thetad) + viscous thetad)."""

    name = 'theta_friction'
    phrase = 'friction of the rotation theta'
    parameters = (EffectParameter('coulomb', 'N m', 'machine', default=0.0),
                  EffectParameter('viscous', 'N m s/rad', 'machine', default=0.0))
    shared = True
    needs_platform = True

    def columns(self, state, shape):  # noqa: ARG002
        unit = state.torque_of_force((0.0, 0.0, 0.0, 1.0))
        rate = state.xd[:, 3:]
        return np.stack((unit * np.sign(rate), unit * rate), axis=-1)

    def implausible(self, values, base):  # noqa: ARG002
        coulomb, viscous = float(values['coulomb'][0]), float(values['viscous'][0])
        if feeds_energy(coulomb, viscous * TYPICAL_RATE):
            return (f'friction of theta must dissipate, found {coulomb:.3g} N m and {viscous:.3g} '
                    f'N m s/rad')
        if coulomb + viscous * TYPICAL_RATE > LARGEST:
            return (f'friction of theta of {coulomb + viscous * TYPICAL_RATE:.3g} N m at '
                    f'{TYPICAL_RATE:g} rad/s is ten times what belt and pulleys take')
        return None

    def signature(self, state):
        return Signature(np.broadcast_to(state.xd[:, 3:], state.q.shape), 'theta rate, rad/s')
