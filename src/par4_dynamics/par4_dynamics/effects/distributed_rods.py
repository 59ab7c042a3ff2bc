"""The mass of the forearm rods spread along them, where (20) has two point masses."""

from __future__ import annotations

from par4_dynamics.base_terms import UNMODELLED, unmodelled_columns
from par4_dynamics.effects.effect import Effect, EffectParameter, Signature


class DistributedRods(Effect):
    """tau += m_5 (torque of one kg of distributed rods minus that of their end masses)."""

    name = 'distributed_rods'
    phrase = 'mass distributed along the forearm rods'
    parameters = (EffectParameter('rod_mass', 'kg', 'machine'),)
    shared = True
    needs_platform = True

    def columns(self, state, shape):  # noqa: ARG002
        return unmodelled_columns(state)[..., [UNMODELLED.index('rod_mass')]]

    def implausible(self, values, base):
        mass = float(values['rod_mass'][0])
        # two rods hang from each half plate by half, with two legs each: 2 m_5 of m_1', m_2'
        ceiling = 0.5 * float(min(base['platform_mass_1'][0], base['platform_mass_2'][0]))
        if mass < 0:
            return f'a rod cannot weigh {mass:.3g} kg'
        if mass > ceiling:
            return (f'two rods of {mass:.3g} kg are more than the half plate they belong to '
                    f'weighs ({2 * ceiling:.3g} kg)')
        return None

    def signature(self, state):
        return Signature(self.columns(state, {})[..., 0], 'relative acceleration of the rod ends '
                         'as torque per rod mass, N m/kg')
