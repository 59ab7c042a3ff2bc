"""Joint encoders whose zeros are not where the model has them."""

from __future__ import annotations

import math

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature

LARGEST = math.radians(5.0)


class EncoderOffset(Effect):
    """tau(q) -> tau(q - o), q = q_true + o being read: to first order tau -= (dtau/dq) o.

    Through the platform the offset of one joint changes the torque of all, so the coefficients
    are shared: one for each joint's offset.
    """

    name = 'encoder_offset'
    phrase = 'a zero error of the joint encoders'
    parameters = (EffectParameter('offset', 'rad', 'joint'),)
    shared = True
    needs_platform = True
    needs_nominal = True

    def columns(self, state, shape):  # noqa: ARG002
        return -state.torque_by_q

    def coefficients(self, values):
        offset = values['offset']
        return np.tile(offset[:, None], len(offset))

    def values(self, coefficients, shape):  # noqa: ARG002
        return {'offset': np.diagonal(coefficients).copy()}

    def implausible(self, values, base):  # noqa: ARG002
        offset = float(np.max(np.abs(values['offset'])))
        if offset > LARGEST:
            return (f'an encoder zero {math.degrees(offset):.3g} degrees off would be seen, more '
                    f'than {math.degrees(LARGEST):g} are not believed')
        return None

    def signature(self, state):
        return Signature(state.q, 'joint position, rad')
