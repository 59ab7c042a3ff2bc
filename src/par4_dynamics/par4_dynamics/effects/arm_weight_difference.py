"""Weight of an arm that differs from the others'."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from par4_dynamics.effects.arm_moment import unlike_an_arm
from par4_dynamics.effects.effect import (
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
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

    def base_part(self, values: Values) -> Mapping[str, np.ndarray]:
        return {'arm_gravity': GRAVITY * values['first_moment']}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return unlike_an_arm(values, std, base, 'weight by which one arm differs')

    def signature(self, state: State) -> Signature:
        return Signature(np.cos(state.q), 'cosine of the joint position')
