"""Friction in the balls of the forearms and in the pivots of the platform's bars."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Base, Effect, EffectParameter, Shape, Signature, Values
from par4_dynamics.effects.passive_rotation import unlike_friction
from par4_dynamics.effects.rest import RESTING_RATE, may_rest
from par4_dynamics.load_friction import LoadFriction
from par4_dynamics.state import State
from par4_kinematics.passive import (
    BALLS_PER_GROUP,
    BAR_PIVOTS,
    passive_friction_force,
    passive_rates,
)

TYPICAL_RATE = 3.0
"""rad/s of a rod."""
LARGEST = 1.0
"""N m in one joint at that rate, ten times what a preloaded ball takes."""


class PassiveJointFriction(Effect):
    """tau += J_1^T f, f . Xdot = sum of coulomb |w| (fading at rest) + viscous w^2, passive joints.

    w is the relative angular velocity of each of the 20 passive joints, see
    `par4_kinematics.passive`: 8 rods with a ball at both ends and 4 pivots of the two bars. All are
    alike. At rest the Coulomb friction fades as tanh(|w| / RESTING_RATE).
    """

    name = 'passive_joint_friction'
    phrase = 'friction in the passive joints'
    parameters = (EffectParameter('coulomb', 'N m', 'machine', default=0.0, nonnegative=True,
                                  meaning='of each of the 20: a ball at both ends of 8 rods, 4 '
                                          'pivots of the two bars'),
                  EffectParameter('viscous', 'N m s/rad', 'machine', default=0.0,
                                  nonnegative=True))
    shared = True
    separable = ((0,), (1,))
    needs_platform = True
    is_force = True
    rubs = True
    variables = 9

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        geometry, x, xd, _ = state.platform
        rates = passive_rates(geometry, x, xd)
        return np.stack([
            state.torque_of_force(
                passive_friction_force(geometry, x, rates, *unit, slip_rate=RESTING_RATE))
            for unit in ((1.0, 0.0), (0.0, 1.0))], axis=-1)

    def slips(self, state: State, values: Values) -> LoadFriction:
        geometry, x, *_ = state.platform
        by_pose = np.stack([passive_rates(geometry, x, np.broadcast_to(unit, x.shape))
                            for unit in np.eye(4)], axis=-1)
        turning = np.einsum('ngac,ncj->ngaj', by_pose, state.jacobian)
        numbers = np.append(np.full(8, BALLS_PER_GROUP), BAR_PIVOTS)
        return LoadFriction(turning, numbers * values['coulomb'][0],
                            numbers * values['viscous'][0])

    def is_unsure(self, state: State) -> np.ndarray:
        # of the pivots of the bars; the axes of the balls turn, and so they hardly ever rest
        return may_rest(state.platform.xd[:, 3])

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return unlike_friction(values, std, TYPICAL_RATE, LARGEST, 'a passive joint',
                               'a preloaded ball takes')

    def signature(self, state: State) -> Signature:
        return Signature(self.columns(state, {})[..., 0],
                         'torque of Coulomb friction in the passive joints, N m per N m')
