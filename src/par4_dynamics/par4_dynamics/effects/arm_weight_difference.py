"""Weight of an arm that differs from the others'."""

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
)
from par4_dynamics.state import GRAVITY, State


class ArmWeightDifference(Effect):
    """tau_i -= g ds_i cos q_i, ds the first moment of an arm along its line beyond the others'.

    What all arms share belongs to the arm gravity of (20). What is fixed to an arm adds an inertia,
    too, which is `joint_inertia_difference`.
    """

    name = 'arm_weight_difference'
    phrase = 'arm weight that differs between the joints'
    against_the_others = True
    is_body = True
    parameters = (EffectParameter('first_moment', 'kg m', 'joint'),)
    needs_platform = True  # what gravity does to a single axis are its base parameters

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return (-GRAVITY * np.cos(state.q))[..., None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        torque, spread = GRAVITY * values['first_moment'], GRAVITY * std['first_moment']
        whole = np.abs(base['arm_gravity'])
        largest = np.maximum(2.0 * whole, 1.0)
        worst = beyond(torque, spread, -largest, largest)
        if worst is not None:
            return (f'{abs(torque[worst]):.3g} N m by which the weight of one arm differs is more '
                    f'than twice that of an arm, {whole[worst]:.3g} N m')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(np.cos(state.q), 'cosine of the joint position')
