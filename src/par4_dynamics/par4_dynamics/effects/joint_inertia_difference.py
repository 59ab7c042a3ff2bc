"""Inertia of an actuator that differs from the others'."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature


class JointInertiaDifference(Effect):
    """tau_i += di_i qdd; what all joints share belongs to i_act of (20)."""

    name = 'joint_inertia_difference'
    phrase = 'actuator inertia that differs between the joints'
    against_the_others = True
    parameters = (EffectParameter('inertia', 'kg m2', 'joint'),)

    def columns(self, state, shape):  # noqa: ARG002
        return state.qdd[..., None]

    def implausible(self, values, base):
        excess = np.abs(values['inertia']) - base['actuator_inertia']
        worst = int(np.argmax(excess))
        if excess[worst] >= 0.0:
            return (f'an inertia that differs by {values["inertia"][worst]:.3g} from '
                    f'{base["actuator_inertia"][worst]:.3g} kg m2 is not a difference between '
                    f'like actuators')
        return None

    def signature(self, state):
        return Signature(state.qdd, 'joint acceleration, rad/s2')
