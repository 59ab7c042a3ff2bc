"""Drag on the platform as it moves through air or drags a hose."""

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

TYPICAL_SPEED = 2.0
"""m/s of D."""
LARGEST = 30.0
"""N at that speed, ten times what air and hoses take."""


class PlatformDrag(Effect):
    """tau += J_1^T (viscous v + quadratic |v| v, 0), v the velocity of D."""

    name = 'platform_drag'
    phrase = 'drag on the platform'
    parameters = (EffectParameter('viscous', 'N s/m', 'machine', default=0.0, nonnegative=True),
                  EffectParameter('quadratic', 'N s2/m2', 'machine', default=0.0,
                                  nonnegative=True))
    shared = True
    separable = ((0,), (1,))
    needs_platform = True
    is_force = True
    variables = 3

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        velocity = state.platform.xd.copy()
        velocity[:, 3] = 0.0
        speed = np.linalg.norm(velocity, axis=1, keepdims=True)
        return np.stack((state.torque_of_force(velocity), state.torque_of_force(speed * velocity)),
                        axis=-1)

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        viscous, quadratic = float(values['viscous'][0]), float(values['quadratic'][0])
        forces = np.array((TYPICAL_SPEED, TYPICAL_SPEED ** 2))
        force, spread = (forces * (part['viscous'][0], part['quadratic'][0])
                         for part in (values, std))
        if beyond(force, spread, low=0.0) is not None:
            return (f'drag must dissipate, found {viscous:.3g} N s/m and {quadratic:.3g} N s2/m2')
        if beyond(force.sum(), spread.sum(), high=LARGEST) is not None:
            return (f'a drag of {force.sum():.3g} N at {TYPICAL_SPEED:g} m/s is ten times what air '
                    f'and hoses take')
        return None

    def signature(self, state: State) -> Signature:
        azimuth = np.array(state.platform.geometry.actuator_azimuth)
        return Signature(state.platform.xd[:, :2] @ (np.cos(azimuth), np.sin(azimuth)),
                         'platform velocity towards the leg, m/s')
