"""Steps in the recorded position or torque."""

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

LARGEST = 1.0


class Quantization(Effect):
    """Rounds a recorded signal to whole steps: of position in rad, of torque in N m.

    It adds noise to a record and no torque to a motion: it has no columns, nothing to search for.
    """

    name = 'quantization'
    phrase = 'quantization of the recorded signal'
    parameters = (EffectParameter('step', 'rad', 'joint', other_unit='N m', is_shape=True,
                                  positive=True),)
    shows = False

    def shapes(self, state: State) -> tuple[Shape, ...]:
        return ()

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return np.zeros((*state.q.shape, 0))

    def coefficients(self, values: Values) -> np.ndarray:
        return np.zeros((0, len(values['step'])))

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        return {'step': np.full(coefficients.shape[1], single(shape['step']))}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        step = values['step']
        worst = beyond(step, std['step'], 0.0, LARGEST)
        if worst is not None:
            return (f'a step must be positive and at most {LARGEST:g} rad or N m, found '
                    f'{step[worst]:.3g}')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
