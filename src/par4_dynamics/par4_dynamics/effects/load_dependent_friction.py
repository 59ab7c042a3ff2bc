"""Friction that grows with the load on the transmission."""

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

HIGHEST = 0.5


class LoadDependentFriction(Effect):
    """tau_i += mu_i |tau_load| sign(qd), tau_load the torque behind the friction."""

    name = 'load_dependent_friction'
    phrase = 'friction that grows with the load'
    friction_term = 'coulomb_friction'
    parameters = (EffectParameter(
        'coefficient', '1', 'joint',
        meaning='of the torque of all bodies, the actuator among them, and of forces on the '
                'platform; of what springs pass on, where the transmission is elastic'),)
    needs_nominal = True
    variables = 2

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return (np.abs(state.known.passed(state)) * state.direction)[..., None]

    def assumes(self, values: Values) -> str | None:
        return ('The whole inertia is taken to be load that the friction carries; where part of it '
                'turns before the transmission, the coefficient is larger.')

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        coefficient = values['coefficient']
        worst = beyond(coefficient, std['coefficient'], low=0.0)
        if worst is not None:
            return f'friction cannot fall with the load, found {coefficient[worst]:.3g} of it'
        worst = beyond(coefficient, std['coefficient'], high=HIGHEST)
        if worst is not None:
            return (f'a transmission that loses {coefficient[worst]:.3g} of its load is not one of '
                    f'a machine, expected at most {HIGHEST:g}')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(self.columns(state, {})[..., 0], 'size of the load, signed by the joint '
                         'speed, N m')
