"""Friction that falls while the machine warms up."""

from __future__ import annotations

import numpy as np

from par4_dynamics.base_terms import FRICTION
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
from par4_dynamics.effects.grid import around
from par4_dynamics.state import State

SHARES = np.geomspace(0.05, 3.2, 7)
"""Time constants over the duration of a log: beyond, the drift is a straight line."""


class FrictionDrift(Effect):
    """tau -= (1 - exp(-t / T)) (a D + b V), D the dry friction, V that of the lubricant, at t = 0.

    D is f_c sign(qd) of (20) with what effects add to it, such as Stribeck friction, V f_v qd with
    what effects add to that (`Effect.friction_term`); a is the drop, b the viscous drop. Warming
    thins a lubricant, so that V falls more than D; a model that gives one number has both fall by
    it. t counts from the first stamp of the log.
    """

    name = 'friction_drift'
    phrase = 'friction that changes while the machine warms up'
    parameters = (EffectParameter('drop', '1', 'machine',
                                  meaning='t counts from the first stamp of each log'),
                  EffectParameter('viscous_drop', '1', 'machine', default='drop'),
                  EffectParameter('time_constant', 's', 'machine', is_shape=True, positive=True))
    shared = True
    needs_nominal = True
    variables = 2

    def shapes(self, state: State) -> tuple[Shape, ...]:
        return tuple({'time_constant': float(share * state.t[-1])} for share in SHARES)

    def refined(self, shape: Shape, step: float) -> tuple[Shape, ...]:
        return around('time_constant', single(shape['time_constant']),
                      (SHARES[1] / SHARES[0]) ** step)

    def dry_share(self, t: np.ndarray, values: Values) -> np.ndarray:
        return 1.0 - values['drop'][0] * _warm(t, float(values['time_constant'][0]))

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        warm = _warm(state.t, single(shape['time_constant']))[:, None]
        return np.stack([
            -warm * (state.known.values[name] * of_level + state.friction.get(name, 0.0))
            for name, of_level in zip(FRICTION, (state.direction, state.qd))], axis=-1)

    def begun(self, values: Values, base: Base, begin: float) -> tuple[Values, Base]:
        # 1 - a (1 - exp(-(t + b) / T)) = c (1 - a' (1 - exp(-t / T))), a the drop, b the beginning,
        # with c = 1 - a (1 - exp(-b / T)), a' = a exp(-b / T) / c; before the log by more than T
        # counts as T
        left = np.exp(np.minimum(-begin / values['time_constant'], 1.0))
        values, base = dict(values), dict(base)
        for friction, drop in zip(FRICTION, ('drop', 'viscous_drop')):
            scale = 1.0 - values[drop] * (1.0 - left)
            base[friction] = scale * base[friction]
            values[drop] = values[drop] * left / scale
        return values, base

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        for kind, name in (('Coulomb', 'drop'), ('viscous', 'viscous_drop')):
            drop = float(values[name][0])
            if beyond(drop, std[name][0], 0.0, 1.0) is not None:
                return (f'{kind} friction that warms up falls, by no more than all of it; found a '
                        f'share of {drop:.3g}')
        constant = float(values['time_constant'][0])
        if beyond(constant, std['time_constant'][0], low=0.0) is not None:
            return f'a time constant must be positive, found {constant:.3g} s'
        return None

    def signature(self, state: State) -> Signature:
        return Signature(np.broadcast_to(state.t[:, None], state.q.shape), 'time, s')


def _warm(t: np.ndarray, time_constant: float) -> np.ndarray:
    """Return how much of the way from cold to warm has gone at times t (n,), 0 to 1."""
    return -np.expm1(-t / time_constant)
