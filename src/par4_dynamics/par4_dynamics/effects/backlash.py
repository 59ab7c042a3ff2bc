"""A dead zone between a motor and its load."""

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
from par4_dynamics.effects.transmission import (
    half_assumed,
    one_a_joint,
    transmission_columns,
    transmitted_torque,
)
from par4_dynamics.state import State

CROSSING = 0.01
"""s that a load takes through the dead zone: assumed, less than a torque filter resolves."""
WIDEST = 0.05
"""rad."""


class Backlash(Effect):
    """tau += change of the load's torque at q_load = q - gap/2 sign(tau_load).

    To first order in the gap, encoders on the motors; where the load changes its sign, the shift
    goes from one side to the other over `CROSSING`.
    """

    name = 'backlash'
    phrase = 'backlash of the transmission'
    parameters = (EffectParameter('gap', 'rad', 'joint', nonnegative=True),)
    shared = True
    needs_nominal = True
    looks_around = True
    variables = 2

    def shapes(self, state: State) -> tuple[Shape, ...]:
        # an axis that does not hang leans on either side by its inertia alone: it rattles at most
        return ({},) if state.geometry is not None or state.hanging else ()

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return transmission_columns(state, -0.5 * _side(state.t, transmitted_torque(state)))

    def coefficients(self, values: Values) -> np.ndarray:
        return one_a_joint(values['gap'])

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        return {'gap': np.diagonal(coefficients).copy()}

    def assumes(self, values: Values) -> str | None:
        return half_assumed('gap is smaller')

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        gap = values['gap']
        worst = beyond(gap, std['gap'], low=0.0)
        if worst is not None:
            return f'a gap cannot be negative, found {gap[worst]:.3g} rad'
        worst = beyond(gap, std['gap'], high=WIDEST)
        if worst is not None:
            return (f'a gap of {gap[worst]:.3g} rad is not backlash of a machine, expected at most '
                    f'{WIDEST:g} rad')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(transmitted_torque(state), 'load torque, N m')


def _side(t: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Return sign(load) (n, J) averaged over `CROSSING` with a weight that rises and falls."""
    side = np.sign(load)
    if len(t) < 2:
        return side
    half = max(1, round(0.5 * CROSSING / float(np.median(np.diff(t)))))
    weight = np.hanning(2 * half + 3)[1:-1]
    weight /= weight.sum()
    padded = np.pad(side, ((half, half), (0, 0)), mode='edge')
    return np.stack([np.convolve(column, weight, mode='valid') for column in padded.T], axis=1)
