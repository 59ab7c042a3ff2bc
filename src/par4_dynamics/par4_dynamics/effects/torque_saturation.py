"""Torque that a drive cannot deliver."""

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
    single,
)
from par4_dynamics.state import State


class TorqueSaturation(Effect):
    """tau_i += clip(tau_i, -limit_i, limit_i) - tau_i: what the limit takes off the needed torque.

    A recorded command exceeds the limit while the machine gets the limit only, and moves as it
    then must: the torque that this motion needs is within the limit, so that no motion shows the
    effect and it has no shapes to search. Flat tops of the recorded torque do.
    """

    name = 'torque_saturation'
    phrase = 'saturation of the drives'
    parameters = (EffectParameter('limit', 'N m', 'joint', is_shape=True, positive=True),)
    needs_nominal = True
    fixed_coefficients = True
    shows = False

    def shapes(self, state: State) -> tuple[Shape, ...]:
        return ()

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        torque, limit = state.known.torque, single(shape['limit'])
        return (np.clip(torque, -limit, limit) - torque)[..., None]

    def coefficients(self, values: Values) -> np.ndarray:
        return np.ones_like(values['limit'])[None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        limit, level = values['limit'], base['coulomb_friction']
        worst = beyond(limit, std['limit'], low=level)
        if worst is not None:
            return (f'a drive limited to {limit[worst]:.3g} N m could not move its joint against '
                    f'Coulomb friction of {level[worst]:.3g} N m')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.known.torque, 'torque of the model, N m')
