"""The mass of rods and bars spread along them, where (20) has point masses at their ends."""

from __future__ import annotations

import numpy as np

from par4_dynamics.base_terms import UNMODELLED, unmodelled_columns
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


class DistributedRods(Effect):
    """tau += m_5, m_3 (torque of a distributed kg of rods, bars minus that of their end masses).

    Beside that of the rods, the column of the bars looks like theta inertia of the wrong sign. A
    machine may have heavy rods without heavy bars, but not the reverse.
    """

    name = 'distributed_rods'
    phrase = 'mass distributed along rods and bars'
    parameters = (EffectParameter('rod_mass', 'kg', 'machine'),
                  EffectParameter('bar_mass', 'kg', 'machine', default=0.0, nonnegative=True))
    shared = True
    is_body = True
    separable = ((0,), (0, 1))
    needs_platform = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return unmodelled_columns(state)[..., [UNMODELLED.index('rod_mass'),
                                               UNMODELLED.index('bar_mass')]]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        mass = float(values['rod_mass'][0])
        # two rods hang from each half plate by half, with two legs each: 2 m_5 of m_1', m_2'
        ceiling = 0.5 * float(min(base['platform_mass_1'][0], base['platform_mass_2'][0]))
        if beyond(mass, std['rod_mass'][0], low=0.0) is not None:
            return f'a rod cannot weigh {mass:.3g} kg'
        if beyond(mass, std['rod_mass'][0], high=ceiling) is not None:
            return (f'two rods of {mass:.3g} kg are more than the half plate they belong to '
                    f'weighs ({2 * ceiling:.3g} kg)')
        bar = float(values['bar_mass'][0])
        if beyond(bar, std['bar_mass'][0], 0.0, 2.0 * ceiling) is not None:
            return f'a bar of {bar:.3g} kg beside rods of {mass:.3g} kg is none of this machine'
        return None

    def signature(self, state: State) -> Signature:
        return Signature(self.columns(state, {})[..., 0], 'relative acceleration of the rod ends '
                         'as torque per rod mass, N m/kg')
