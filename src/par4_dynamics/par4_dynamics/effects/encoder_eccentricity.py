"""Joint encoders whose discs do not sit centred on their shafts."""

from __future__ import annotations

import math

import numpy as np

from par4_dynamics.effects.cogging import LEAST_TURNS
from par4_dynamics.effects.effect import (
    FAST,
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
    beyond,
)
from par4_dynamics.effects.shifted import shift_columns
from par4_dynamics.state import State

LARGEST = math.radians(2.0)
"""A disc of 20 mm radius that sits 0.7 mm beside its shaft, or a magnet that sits half a millimetre
beside its chip."""
LARGEST_OF_AXIS = math.radians(5.0)
"""Of any machine: a small disc, a magnet beside its chip, or a bent coupling."""


class EncoderEccentricity(Effect):
    """tau(q) -> tau(q - A sin(q + phi)): q is read, q - A sin(q + phi) is true.

    The slopes of tau are those halfway between both (`Effect.halfway`).
    Speed and acceleration change with it, viscous friction too. The coefficients are shared, as
    those of `EncoderOffset`: A_i cos(phi_i) and A_i sin(phi_i) of each joint.
    """

    name = 'encoder_eccentricity'
    phrase = 'an eccentric joint encoder'
    parameters = (EffectParameter('amplitude', 'rad', 'joint'),
                  EffectParameter('phase', 'rad', 'joint', qualifies=True))
    shared = True
    separable = ((0, 1), (2, 3), (4, 5), (6, 7))
    needs_turning = True
    needs_nominal = True
    variables = 3

    def shapes(self, state: State) -> tuple[Shape, ...]:
        if state.geometry is not None:
            return ({},)
        # an axis must come by the same angle again, at another speed, before a wave of its reading
        # is told from whatever else depends on the position
        span = float(np.max(np.ptp(state.q, axis=0)))
        return ({},) if span >= LEAST_TURNS * 2.0 * np.pi else ()

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        sine, cosine = np.sin(state.q), np.cos(state.q)
        viscous = state.known.whole['viscous_friction'] * np.eye(state.joints)
        columns = []
        for wave, slope in ((sine, cosine), (cosine, -sine)):
            rate = slope * state.qd
            # the second derivative of either wave is its opposite
            change = shift_columns(state.halfway, wave, rate,
                                   slope * state.qdd - wave * state.qd ** 2)
            columns.append(-change - viscous * rate[:, None, :])
        return np.stack(columns, axis=-1).reshape(*state.q.shape, 2 * state.joints)

    def halfway(self, state: State, values: Values) -> State:
        angle, half = state.q + values['phase'], 0.5 * values['amplitude']
        wave, slope = half * np.sin(angle), half * np.cos(angle)
        return state.moved(state.q - wave, state.qd * (1.0 - slope),
                           state.qdd * (1.0 - slope) + wave * state.qd ** 2)

    def coefficients(self, values: Values) -> np.ndarray:
        amplitude, phase = values['amplitude'], values['phase']
        waves = np.stack((amplitude * np.cos(phase), amplitude * np.sin(phase)), axis=1)
        return np.tile(waves.reshape(-1, 1), len(amplitude))

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        in_phase, across = (np.diagonal(coefficients[first::2]) for first in (0, 1))
        return {'amplitude': np.hypot(in_phase, across), 'phase': np.arctan2(across, in_phase)}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        amplitude = values['amplitude']
        largest = LARGEST_OF_AXIS if FAST in base else LARGEST
        worst = beyond(amplitude, std['amplitude'], -largest, largest)
        if worst is not None:
            return (f'an eccentricity of {math.degrees(amplitude[worst]):.3g} degrees is more than '
                    f'a badly mounted encoder has')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
