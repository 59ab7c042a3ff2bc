"""Diagnosed parameters of the blind study against those that are hidden.

A hidden value and a diagnosed one are compared where they mean the same, some after a conversion:
what all joints share belongs to the base parameters, so a difference between joints is measured
against the mean of the joints that are not named; phases are compared modulo a turn and in the
angles that encoders read (an error z of a zero turns the phase of order N by N z); effects of the
same torque while a joint moves, of which one is told for both, are added; a compliance is the
inverse of a stiffness. Left out are `LEFT_OUT`, differences told for all four joints (the
deviations of single values do not say that of a difference), parameters without a deviation or
with none (fixed, or of another shape of the law), and the mass of bars where rods are real.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from par4_dynamics.effects.catalogue import CATALOGUE

LEFT_OUT = {'backlash': 'its gap is read from how rattling looks, not fitted'}
"""Effect -> why its parameters are not compared."""
DIFFERENCES = {name for name, effect in CATALOGUE.items() if effect.against_the_others}
"""Effects whose common part the base parameters have."""
HIDDEN_AS = {('theta_inertia', 'inertia'): 'theta_inertia',
             ('joint_inertia_difference', 'inertia'): 'actuator_inertia',
             ('elastic_transmission', 'stiffness'): 'compliance'}
"""(effect, diagnosed parameter) -> hidden one, where their names differ."""
SAME_TORQUE = {'torque_offset': 'offset', 'coulomb_asymmetry': 'asymmetry'}
"""Effect -> its size, of those that have the same torque while a joint moves."""
NOT_TOLD = {('rods', 'bar_mass')}
"""(kind, parameter) whose hidden value is not recorded."""
ONLY_HIDDEN = {'damping_ratio', 'motor_share', 'exponent'}
"""Parameters with a default that a hidden machine may leave to it; then they are not compared."""
FORMS = {'nonlinear_viscous': {'quadratic', 'torque', 'exponent'}}
"""Effect -> parameters of its several forms, of which a hidden one gives those of its own."""
WIDTH = 1.96
"""Deviations on either side of a 95 % interval."""


@dataclass(frozen=True)
class Compared:
    """One number of a diagnosed cause.

    Attributes:
        effect, parameter: whose.
        found, std, truth: in the unit of the parameter.
    """

    effect: str
    parameter: str
    found: float
    std: float
    truth: float

    @property
    def covered(self) -> bool:
        """Whether the 95 % interval holds the truth."""
        return abs(self.found - self.truth) <= WIDTH * self.std

    def within(self, share: float) -> bool:
        """Return whether the value is within a share of the truth."""
        return abs(self.found - self.truth) <= share * abs(self.truth)


def compared(outcome: dict[str, Any]) -> Iterator[Compared]:
    """Yield the numbers of the causes of an outcome that are named like what is hidden."""
    hidden = {item['effect']: item for item in outcome['hidden']}
    for cause in outcome['causes']:
        item = hidden.get(cause['effect'])
        if item is None or cause['effect'] in LEFT_OUT:
            continue
        forms = set(item['values']) & FORMS.get(cause['effect'], set())
        for parameter, value in cause['values'].items():
            if parameter in ONLY_HIDDEN - set(item['values']):
                continue
            if (outcome['kind'], parameter) not in NOT_TOLD and (
                    not forms or parameter in forms):
                yield from _numbers(cause, parameter, value, _as_told(item, hidden, outcome))


def _as_told(item: dict[str, Any], hidden: dict[str, Any], outcome: dict[str, Any]
             ) -> dict[str, Any]:
    """Return the values of a hidden effect as a diagnosis can tell them."""
    values = dict(item['values'])
    if {'phase', 'periods'} <= set(values) and 'encoder_offset' in hidden:
        zeros = hidden['encoder_offset']['values']['offset']
        values['phase'] = np.subtract(values['phase'], np.multiply(values['periods'], zeros))
    own = SAME_TORQUE.get(item['effect'])
    for name, parameter in SAME_TORQUE.items():
        if own and name in hidden and name not in {
                item['effect'], *(cause['effect'] for cause in outcome['causes'])}:
            values[own] = np.add(values[own], hidden[name]['values'][parameter])
    return values


def _numbers(cause: dict[str, Any], parameter: str, value: Any, values: dict[str, Any]
             ) -> Iterator[Compared]:
    effect, joints = cause['effect'], cause['joints']
    stds = cause['stds'].get(parameter)
    told = values.get(HIDDEN_AS.get((effect, parameter), parameter), 0.0)
    if stds is None:
        return
    found, stds = np.atleast_1d(value), np.atleast_1d(stds)
    truth = _truth(effect, parameter, np.asarray(told, dtype=float), joints, len(found))
    if truth is None:
        return
    for one, std, true in zip(found, stds, truth):
        if std > 0.0 and math.isfinite(true):
            if parameter == 'phase':
                one = true + math.remainder(one - true, 2.0 * math.pi)
            yield Compared(effect, parameter, float(one), float(std), float(true))


def _truth(effect: str, parameter: str, told: np.ndarray, joints: list[int], count: int
           ) -> np.ndarray | None:
    """Return the hidden value of each diagnosed number, or None where they cannot be compared."""
    if parameter == 'stiffness' and effect == 'elastic_transmission':
        with np.errstate(divide='ignore'):
            told = 1.0 / told
    if effect in DIFFERENCES:
        rest = [joint for joint in range(4) if joint not in joints]
        if not rest:
            return None
        told = np.broadcast_to(told, (4,))
        common = told[rest].mean()
        told = (1.0 + told) / (1.0 + common) - 1.0 if effect == 'drive_gain_error' else (
            told - common)
    if told.shape == (4,):
        if count == len(joints):
            return told[joints]
        return np.array([told[np.flatnonzero(told)].mean()]) if count == 1 and told.any() else None
    return np.broadcast_to(told, (count,)) if told.shape in ((), (1,), (count,)) else None
