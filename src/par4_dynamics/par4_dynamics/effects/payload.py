"""A mass on one half of the platform."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from par4_dynamics.base_terms import PLATFORM_MASSES
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
from par4_dynamics.rigid_body import COLUMNS, rigid_body_columns
from par4_dynamics.state import State
from par4_kinematics.errors import InputError

HEAVIEST = 20.0
"""kg; ten times what such a robot carries."""


class Payload(Effect):
    """tau += mass (column of m_1' or m_2' in (20)): a mass at D (half 1, the tool) or D' (half 2).

    In one run it cannot be told from the base parameter; runs with and without it can.
    """

    name = 'payload'
    phrase = 'a payload'
    parameters = (EffectParameter('mass', 'kg', 'machine'),
                  EffectParameter('half', '1', 'machine', default=1.0, is_shape=True))
    shared = True
    is_body = True
    of_base = True
    needs_platform = True

    def shapes(self, state: State) -> tuple[Shape, ...]:
        return ({'half': 1.0}, {'half': 2.0})

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        # between the halves the mass is shared, so that the shape has a derivative
        columns = rigid_body_columns(state)[..., [COLUMNS.index(name) for name in PLATFORM_MASSES]]
        return columns @ [[2.0 - single(shape['half'])], [single(shape['half']) - 1.0]]

    def shape_of(self, values: Values) -> Shape:
        if values['half'] not in (1.0, 2.0):
            raise InputError(f'effect payload, half: expected 1 (at D) or 2 (at D\'), found '
                             f'{values["half"]:g}')
        return {'half': float(values['half'])}

    def base_part(self, values: Values) -> Mapping[str, np.ndarray]:
        return {name: share * values['mass'] for name, share in zip(
            PLATFORM_MASSES, (2.0 - values['half'], values['half'] - 1.0))}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        mass = float(values['mass'][0])
        if beyond(mass, std['mass'][0], low=0.0) is not None:
            return f'a payload cannot weigh {mass:.3g} kg'
        if beyond(mass, std['mass'][0], high=HEAVIEST) is not None:
            return f'a payload of {mass:.3g} kg is more than such a robot can carry'
        return None

    def signature(self, state: State) -> Signature:
        return Signature(self.columns(state, {'half': 1.0})[..., 0],
                         'torque of a mass at D, N m/kg')
