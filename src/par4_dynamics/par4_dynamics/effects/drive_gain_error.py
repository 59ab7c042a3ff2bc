"""A drive whose torque constant is not the one that the record was scaled with."""

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

SMALLEST, LARGEST = -0.6, 1.5
"""A true gain of 2.5 times the nominal one, and of that part of it: a motor of another winding or a
shunt of another value. A wrong unit is farther off."""


class DriveGainError(Effect):
    """tau_i += e_i tau_i: recorded is (1 + e) times what the motion needs."""

    name = 'drive_gain_error'
    phrase = 'error of the drive gain'
    against_the_others = True
    parameters = (EffectParameter('relative', '1', 'joint'),)
    needs_nominal = True
    scales = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return state.scaled[..., None]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        relative = values['relative']
        worst = beyond(relative, std['relative'], SMALLEST, LARGEST)
        if worst is not None:
            return (f'a record that is wrong by {relative[worst]:.3g} of the torque has a wrong '
                    f'unit, not an error of the drive gain; expected {SMALLEST:g} to {LARGEST:g}')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.delivered, 'torque of the model, N m')
