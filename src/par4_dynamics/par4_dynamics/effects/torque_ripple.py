"""Torque periodic in the joint angle, in proportion to the load."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.cogging import Cogging
from par4_dynamics.effects.effect import Base, EffectParameter, Shape, Values, beyond
from par4_dynamics.state import State

LARGEST = 0.3


class TorqueRipple(Cogging):
    """tau_i += a_i tau_i sin(N q_i + phi_i), summed over the orders N: in proportion to torque."""

    name = 'torque_ripple'
    phrase = 'torque ripple'
    parameters = (EffectParameter('relative', '1', 'joint', per_order=True),
                  *Cogging.parameters[1:])
    least_turns = 1.0  # it goes with the load, which gravity and springs do not
    needs_nominal = True
    scales = True
    variables = 2

    def height(self, state: State) -> np.ndarray:
        return state.scaled

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return self.height(state)[..., None] * super().columns(state, shape)

    def coefficients(self, values: Values) -> np.ndarray:
        return super().coefficients({**values, 'amplitude': values['relative']})

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        cogging = super().values(coefficients, shape)
        return {'relative': cogging.pop('amplitude'), **cogging}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        relative = values['relative']
        worst = beyond(relative, std['relative'], high=LARGEST)
        if worst is not None:
            return (f'a ripple of {relative.flat[worst]:.3g} of the torque is more than a drive of '
                    f'a machine has, expected at most {LARGEST:g}')
        return None
