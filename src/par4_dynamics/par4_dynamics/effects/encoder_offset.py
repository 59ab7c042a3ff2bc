"""Joint encoders whose zeros are not where the model has them."""

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
from par4_dynamics.state import State

LARGEST = math.radians(12.0)
"""A zero that was set by eye is right to 10 degrees; more is a belt that skipped."""


class EncoderOffset(Effect):
    """tau(q) -> tau(q - o), q = q_true + o being read: tau -= (dtau/dq) o, the slope at q - o / 2.

    The torque is that of the bodies, of what pulls at the platform, and of what is bound to where a
    joint is, such as cogging.
    Through the platform the offset of one joint changes the torque of all, so the coefficients
    are shared: one for each joint's offset.
    """

    name = 'encoder_offset'
    phrase = 'a zero error of the joint encoders'
    parameters = (EffectParameter('offset', 'rad', 'joint'),)
    shared = True
    separable = ((0,), (1,), (2,), (3,))
    needs_platform = True
    needs_nominal = True
    variables = 3

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        there = state.halfway
        return -(there.load_by_q + there.angle_torque_by_q)

    def halfway(self, state: State, values: Values) -> State:
        return state.moved(state.q - 0.5 * values['offset'], state.qd, state.qdd)

    def coefficients(self, values: Values) -> np.ndarray:
        offset = values['offset']
        return np.tile(offset[:, None], len(offset))

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        return {'offset': np.diagonal(coefficients).copy()}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        offset = values['offset']
        worst = beyond(offset, std['offset'], -LARGEST, LARGEST)
        if worst is not None:
            return (f'an encoder zero {math.degrees(offset[worst]):.3g} degrees off would be seen, '
                    f'more than {math.degrees(LARGEST):g} are not believed')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
