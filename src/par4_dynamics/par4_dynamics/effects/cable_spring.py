"""A cable or hose that pulls the platform towards where it is fixed."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature

SOFTEST, STIFFEST = 2.0, 500.0
"""N/m, ten times a stiff hose."""
FARTHEST = 5.0
"""m from the origin of `base`: from farther away the pull would not change with the pose."""


class CableSpring(Effect):
    """tau += J_1^T stiffness (p - anchor): a spring without length from D, at p, to its anchor."""

    name = 'cable_spring'
    phrase = 'a cable that pulls like a spring'
    parameters = (EffectParameter('stiffness', 'N/m', 'machine'),
                  EffectParameter('anchor', 'm', 'machine', size=3))
    shared = True
    needs_platform = True

    def columns(self, state, shape):  # noqa: ARG002
        stretch = state.x.copy()
        stretch[:, 3] = 0.0
        return np.stack([state.torque_of_force(force) for force in (stretch, *np.eye(4)[:3])],
                        axis=-1)

    def coefficients(self, values):
        stiffness = values['stiffness']
        return np.stack((stiffness, *(-stiffness * part for part in values['anchor'])))

    def values(self, coefficients, shape):  # noqa: ARG002
        stiffness = coefficients[0]
        return {'stiffness': stiffness, 'anchor': -coefficients[1:, 0] / stiffness[0]}

    def implausible(self, values, base):  # noqa: ARG002
        stiffness = float(values['stiffness'][0])
        distance = float(np.linalg.norm(values['anchor']))
        if not stiffness > 0:
            return f'a cable pulls back, found a stiffness of {stiffness:.3g} N/m'
        if stiffness < SOFTEST:
            return (f'a stiffness of {stiffness:.3g} N/m is that of no cable, expected at least '
                    f'{SOFTEST:g} N/m')
        if stiffness > STIFFEST:
            return f'a stiffness of {stiffness:.3g} N/m is ten times that of a stiff hose'
        if distance > FARTHEST:
            return (f'an anchor {distance:.3g} m from the base is too far for a cable; a constant '
                    f'force does the same')
        return None

    def signature(self, state):
        azimuth = np.array(state.geometry.actuator_azimuth)
        return Signature(state.x[:, :2] @ (np.cos(azimuth), np.sin(azimuth)),
                         'platform position towards the leg, m')
