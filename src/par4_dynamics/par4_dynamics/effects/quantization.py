"""Steps in the recorded position or torque."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature, beyond

LARGEST = 1.0


class Quantization(Effect):
    """Rounds a recorded signal to whole steps: of position in rad, of torque in N m.

    It adds noise to a record and no torque to a motion: it has no columns, nothing to search for.
    """

    name = 'quantization'
    phrase = 'quantization of the recorded signal'
    parameters = (EffectParameter('step', 'rad', 'joint', other_unit='N m', is_shape=True),)

    def shapes(self, state):  # noqa: ARG002
        return ()

    def columns(self, state, shape):  # noqa: ARG002
        return np.zeros((*state.q.shape, 0))

    def coefficients(self, values):
        return np.zeros((0, len(values['step'])))

    def values(self, coefficients, shape):
        return {'step': np.full(coefficients.shape[1], shape['step'])}

    def implausible(self, values, std, base):  # noqa: ARG002
        step = values['step']
        worst = beyond(step, std['step'], 0.0, LARGEST)
        if worst is not None:
            return (f'a step must be positive and at most {LARGEST:g} rad or N m, found '
                    f'{step[worst]:.3g}')
        return None

    def signature(self, state):
        return Signature(state.q, 'joint position, rad')
