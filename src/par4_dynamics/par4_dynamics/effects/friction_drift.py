"""Friction that falls while the machine warms up."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Effect, EffectParameter, Signature
from par4_dynamics.effects.grid import around

SHARES = np.geomspace(0.05, 3.2, 7)
"""Time constants over the duration of a log: beyond, the drift is a straight line."""


class FrictionDrift(Effect):
    """tau -= a (1 - exp(-t / T)) friction: Coulomb and viscous alike lose the share a.

    t counts from the first stamp of the log; friction is that of (20), at t = 0.
    """

    name = 'friction_drift'
    phrase = 'friction that changes while the machine warms up'
    parameters = (EffectParameter('drop', '1', 'machine'),
                  EffectParameter('time_constant', 's', 'machine', is_shape=True))
    shared = True
    needs_nominal = True

    def shapes(self, state):
        return tuple({'time_constant': float(share * state.t[-1])} for share in SHARES)

    def refined(self, shape, step):
        return around('time_constant', shape['time_constant'], (SHARES[1] / SHARES[0]) ** step)

    def columns(self, state, shape):
        warm = -np.expm1(-state.t / shape['time_constant'])
        return (-warm[:, None] * state.nominal.friction)[..., None]

    def implausible(self, values, base):  # noqa: ARG002
        drop, constant = float(values['drop'][0]), float(values['time_constant'][0])
        if not 0.0 <= drop < 1.0:
            return (f'friction that warms up falls, by less than all of it; found a share of '
                    f'{drop:.3g}')
        if constant <= 0.0:
            return f'a time constant must be positive, found {constant:.3g} s'
        return None

    def signature(self, state):
        return Signature(np.broadcast_to(state.t[:, None], state.q.shape), 'time, s')
