"""A base that does not stand level."""

from __future__ import annotations

import math

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

STEEPEST = math.radians(5.0)


class BaseTilt(Effect):
    """tau += torque of the change of gravity in `base`, to first order in the tilt.

    The base is turned by about_x = a around its x axis, then by about_y = b around its y axis:
    gravity in `base` is R_y(b)^T R_x(a)^T (0, 0, -g) = g (cos a sin b, -sin a, -cos a cos b), to
    first order g (b, -a, -1). It pulls at the masses m_1' at D and m_2' at D' and at the arms, of
    potential energy -(k / g) gravity . (cos q e_i - sin q z) with the arm gravity k of (20).
    """

    name = 'base_tilt'
    phrase = 'a tilted base'
    parameters = (EffectParameter('about_x', 'rad', 'machine', default=0.0,
                                  meaning='turned about x of `base` by a, then about its y by b, '
                                          'gravity in it is g (b, -a, -1)'),
                  EffectParameter('about_y', 'rad', 'machine', default=0.0))
    shared = True
    needs_platform = True
    needs_nominal = True
    variables = 0

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return np.stack([self._torque(state, change)
                         for change in (np.array((0.0, -GRAVITY)), np.array((GRAVITY, 0.0)))],
                        axis=-1)

    def _torque(self, state, change):
        """Return the torque (n, 4) of a change of gravity along x and y, (2,) m/s2."""
        values, theta = state.known.whole, state.platform.x[:, 3]
        azimuth = np.array(state.platform.geometry.actuator_azimuth)
        pull = np.zeros_like(state.platform.x)
        pull[:, :2] = change
        at_d = state.torque_of_force(pull)
        # D' = D + h (-sin theta, cos theta, 0)
        pull[:, 3] = -state.platform.geometry.platform_bar_length * (
            np.cos(theta) * change[0] + np.sin(theta) * change[1])
        at_d2 = state.torque_of_force(pull)
        outward = change[0] * np.cos(azimuth) + change[1] * np.sin(azimuth)
        return (values['arm_gravity'] / GRAVITY * np.sin(state.q) * outward
                - values['platform_mass_1'] * at_d - values['platform_mass_2'] * at_d2)

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        tilt, spread = (math.hypot(float(part['about_x'][0]), float(part['about_y'][0]))
                        for part in (values, std))
        if beyond(tilt, spread, high=STEEPEST) is not None:
            return (f'a tilt of {math.degrees(tilt):.3g} degrees would be seen by eye, more than '
                    f'{math.degrees(STEEPEST):g} are not believed')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
