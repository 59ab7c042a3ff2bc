"""Inertia of an actuator that differs from the others'."""

from __future__ import annotations

from collections.abc import Mapping

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


class JointInertiaDifference(Effect):
    """tau_i += di_i qdd; what all joints share belongs to i_act of (20)."""

    name = 'joint_inertia_difference'
    phrase = 'actuator inertia that differs between the joints'
    against_the_others = True
    is_body = True
    parameters = (EffectParameter('inertia', 'kg m2', 'joint'),)

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return state.qdd[..., None]

    def base_part(self, values: Values) -> Mapping[str, np.ndarray]:
        return {'actuator_inertia': values['inertia']}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        inertia, whole = values['inertia'], base['actuator_inertia']
        worst = beyond(inertia, std['inertia'], -whole, whole)
        if worst is not None:
            return (f'an inertia that differs by {inertia[worst]:.3g} from {whole[worst]:.3g} '
                    f'kg m2 is not a difference between like actuators')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.qdd, 'joint acceleration, rad/s2')
