"""A cable or hose that pulls the platform towards where it is fixed."""

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
from par4_kinematics.geometry import LEGS

SOFTEST, STIFFEST = 2.0, 500.0
"""N/m, ten times a stiff hose."""
FARTHEST = 5.0
"""m from the origin of `base`, along each axis: from farther away the pull would hardly change."""


class CableSpring(Effect):
    """tau += J_1^T K (p - anchor), K = diag(stiffness): D, at p, is pulled towards the anchor.

    A hose that bends pulls with another stiffness along each of x, y and z of `base`; one number
    stands for all three, a spring without length. Along an axis without stiffness no pull tells
    where the anchor is: its coordinate there is 0.
    """

    name = 'cable_spring'
    phrase = 'a cable that pulls like a spring'
    parameters = (EffectParameter('stiffness', 'N/m', 'machine', size=3, uniform=True,
                                  nonnegative=True),
                  EffectParameter('anchor', 'm', 'machine', size=3, qualifies=True))
    shared = True
    needs_platform = True
    is_force = True
    variables = 3

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        # J_1^T e of a unit force along each axis
        unit = np.stack([state.torque_of_force(axis) for axis in np.eye(4)[:3]], axis=-1)
        return np.concatenate((unit * state.platform.x[:, None, :3], unit), axis=-1)

    def coefficients(self, values: Values) -> np.ndarray:
        stiffness = values['stiffness']
        column = np.concatenate((stiffness, -stiffness * values['anchor']))
        return np.tile(column[:, None], LEGS)

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        stiffness, pull = coefficients[:3, 0], -coefficients[3:, 0]
        anchor = np.divide(pull, stiffness, out=np.zeros(3), where=stiffness != 0.0)
        return {'stiffness': stiffness.copy(), 'anchor': anchor}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        stiffness, spread = values['stiffness'], std['stiffness']
        worst = beyond(stiffness, spread, low=0.0)
        if worst is not None:
            return (f'a cable pulls back, found a stiffness of {stiffness[worst]:.3g} N/m along '
                    f'{"xyz"[worst]}')
        most = int(np.argmax(stiffness))
        if beyond(stiffness[most], spread[most], low=SOFTEST) is not None:
            return (f'a stiffness of {stiffness[most]:.3g} N/m is that of no cable, expected at '
                    f'least {SOFTEST:g} N/m')
        if beyond(stiffness[most], spread[most], high=STIFFEST) is not None:
            return f'a stiffness of {stiffness[most]:.3g} N/m is ten times that of a stiff hose'
        worst = beyond(values['anchor'], std['anchor'], -FARTHEST, FARTHEST)
        if worst is not None:
            return (f'an anchor at {values["anchor"][worst]:.3g} m along {"xyz"[worst]} is too far '
                    f'for a cable; a constant force does the same')
        return None

    def signature(self, state: State) -> Signature:
        azimuth = np.array(state.platform.geometry.actuator_azimuth)
        return Signature(state.platform.x[:, :2] @ (np.cos(azimuth), np.sin(azimuth)),
                         'platform position towards the leg, m')
