"""Friction of the belt and pulleys that turn the tool."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Base, Effect, EffectParameter, Shape, Signature, Values
from par4_dynamics.effects.passive_rotation import unlike_friction
from par4_dynamics.effects.rest import fading_sign, may_rest
from par4_dynamics.load_friction import LoadFriction
from par4_dynamics.state import State

TYPICAL_RATE = 5.0
"""rad/s of theta."""
LARGEST = 5.0
"""N m at that rate, ten times what belts and pulleys take."""



class ThetaFriction(Effect):
    """tau += J_1^T (0, 0, 0, coulomb sign(thetad) + viscous thetad), the sign fading at rest."""

    name = 'theta_friction'
    phrase = 'friction of the rotation theta'
    parameters = (EffectParameter('coulomb', 'N m', 'machine', default=0.0, nonnegative=True),
                  EffectParameter('viscous', 'N m s/rad', 'machine', default=0.0,
                                  nonnegative=True))
    shared = True
    separable = ((0,), (1,))
    needs_platform = True
    is_force = True
    rubs = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        unit = state.torque_of_force((0.0, 0.0, 0.0, 1.0))
        rate = state.platform.xd[:, 3:]
        return np.stack((unit * fading_sign(rate), unit * rate), axis=-1)

    def slips(self, state: State, values: Values) -> LoadFriction:
        turning = np.zeros((len(state.t), 1, 3, state.joints))
        turning[:, 0, 2] = state.jacobian[:, 3]
        return LoadFriction(turning, values['coulomb'][:1], values['viscous'][:1])

    def is_unsure(self, state: State) -> np.ndarray:
        return may_rest(state.platform.xd[:, 3])

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return unlike_friction(values, std, TYPICAL_RATE, LARGEST, 'theta',
                               'belt and pulleys take')

    def signature(self, state: State) -> Signature:
        return Signature(np.broadcast_to(state.platform.xd[:, 3:], state.q.shape),
                         'theta rate, rad/s')
