"""Friction of a joint that differs from the others'."""

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

_BASE = {'coulomb': 'coulomb_friction', 'viscous': 'viscous_friction'}


class JointFrictionDifference(Effect):
    """tau_i += df_c,i sign(qd) + df_v,i qd; what all joints share belongs to (20)."""

    name = 'joint_friction_difference'
    phrase = 'friction that differs between the joints'
    against_the_others = True
    parameters = (EffectParameter('coulomb', 'N m', 'joint', default=0.0),
                  EffectParameter('viscous', 'N m s/rad', 'joint', default=0.0))

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return np.stack((state.direction, state.qd), axis=-1)

    def base_part(self, values: Values) -> Mapping[str, np.ndarray]:
        return {base: values[name] for name, base in _BASE.items()}

    def friction(self, state: State, values: Values, joints: tuple[int, ...]
                 ) -> dict[str, np.ndarray]:
        none = np.zeros_like(values['coulomb'])
        return {base: self.torque(state, {'coulomb': none, 'viscous': none, name: values[name]},
                                  joints) for name, base in _BASE.items()}

    def lowered(self, values: Values, shares: Mapping[str, np.ndarray]) -> Values:
        return {name: shares[base] * values[name] for name, base in _BASE.items()}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        for parameter in self.parameters:
            difference, level = values[parameter.name], base[_BASE[parameter.name]]
            worst = beyond(difference, std[parameter.name], -level, level)
            if worst is not None:
                return (f'{parameter.name} friction that differs by {difference[worst]:.3g} from '
                        f'{level[worst]:.3g} {parameter.unit} is not a difference between like '
                        f'joints')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.qd, 'joint speed, rad/s')
