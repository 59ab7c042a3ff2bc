"""Torque constant of a drive that is not what the record was scaled with."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature

LARGEST = 0.5


class DriveGainError(Effect):
    """tau_i += e_i tau_i: recorded is (1 + e) times what the motion needs."""

    name = 'drive_gain_error'
    phrase = 'error of the drive gain'
    against_the_others = True
    parameters = (EffectParameter('relative', '1', 'joint'),)
    needs_nominal = True

    def columns(self, state, shape):  # noqa: ARG002
        return state.nominal.torque[..., None]

    def implausible(self, values, base):  # noqa: ARG002
        relative = values['relative']
        if np.any(np.abs(relative) > LARGEST):
            worst = relative[np.argmax(np.abs(relative))]
            return (f'a drive gain that is wrong by {worst:.3g} of itself is a wrong unit, not an '
                    f'error; expected at most {LARGEST:g}')
        return None

    def signature(self, state):
        return Signature(state.nominal.torque, 'torque of the model, N m')
