"""A constant force on the platform."""

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
from par4_dynamics.state import State

LARGEST = 50.0
"""N, ten times what a hose or a counterweight pulls."""


class ExternalForce(Effect):
    """tau += -J_1^T (F, 0): the drives hold against F = (x, y, z), the environment's force on D."""

    name = 'external_force'
    phrase = 'a constant force on the platform'
    parameters = tuple(EffectParameter(axis, 'N', 'machine', default=0.0) for axis in 'xyz')
    shared = True
    needs_platform = True
    is_force = True
    variables = 0

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return np.stack([-state.torque_of_force(unit) for unit in np.eye(4)[:3]], axis=-1)

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        force, spread = (float(np.linalg.norm([part[axis][0] for axis in 'xyz']))
                         for part in (values, std))
        if beyond(force, spread, high=LARGEST) is not None:
            return (f'a constant force of {force:.3g} N on the platform is ten times what a hose '
                    f'or a counterweight pulls')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
