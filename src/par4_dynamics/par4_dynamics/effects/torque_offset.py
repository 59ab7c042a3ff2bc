"""A constant torque on each joint."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Base, Effect, EffectParameter, Shape, Signature, Values
from par4_dynamics.state import State


class TorqueOffset(Effect):
    """tau_i += o_i: a zero error of the amplifier or a constant load."""

    name = 'torque_offset'
    phrase = 'constant torque offset'
    parameters = (EffectParameter('offset', 'N m', 'joint'),)
    needs_both_ways = True
    told_by_speeds = True
    variables = 0

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return np.ones((*state.q.shape, 1))

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        return None

    def signature(self, state: State) -> Signature:
        return Signature(np.broadcast_to(state.t[:, None], state.q.shape), 'time, s')
