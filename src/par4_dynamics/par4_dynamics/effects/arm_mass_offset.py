"""Mass of an arm beside the line from its axis to the elbow."""

from __future__ import annotations

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


class ArmMassOffset(Effect):
    """tau_i += g s_i sin q_i with s the first moment of the arm across its line.

    Positive is the side towards which q grows: below a horizontal arm. A mass m there hangs
    s/m cos q lower than on the line, its potential energy changes by -g s cos q, and the drive
    supplies the slope of that.
    """

    name = 'arm_mass_offset'
    phrase = 'arm mass beside the line of the arm'
    is_body = True
    parameters = (EffectParameter('first_moment', 'kg m', 'joint'),)
    needs_platform = True  # the angle to gravity of a single axis is not known

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return (GRAVITY * np.sin(state.q))[..., None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return unlike_an_arm(values, std, base, 'mass beside the arm')

    def signature(self, state: State) -> Signature:
        return Signature(np.sin(state.q), 'sine of the joint position')
