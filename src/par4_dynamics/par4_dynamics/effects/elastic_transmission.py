"""A transmission that twists under its load."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import (
    FAST,
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
    beyond,
)
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.effects.transmission import (
    MOTOR_SHARE,
    Springs,
    one_a_joint,
    transmission_columns,
    transmitted_torque,
)
from par4_dynamics.state import State

STIFFNESSES = (1e2, 1e6)
"""N m/rad, of the arms of a Par4."""
RESONANCES = (1.0, 500.0)
"""Hz, of an axis, whose stiffness may be any: of its load, half of its inertia, on its spring."""


def believed_stiffnesses(inertia: float | None) -> tuple[float, float]:
    """Return the least and the greatest stiffness of a transmission, N m/rad.

    `inertia` (kg m2) is that of a single axis, None of the arms of a Par4.
    """
    if inertia is None:
        return STIFFNESSES
    low, high = (max(inertia, 1e-30) * (1.0 - MOTOR_SHARE) * (2.0 * np.pi * frequency) ** 2
                 for frequency in RESONANCES)
    return low, high


class ElasticTransmission(Effect):
    """tau += change of the load's torque at q_load = q - tau_load / k, encoders on the motors.

    The load swings on its transmissions against motors that move as measured, lightly damped: the
    torque that twists them is integrated with the compliances 1/k that the shape holds, one
    `expanded_at_<joint>` each, and is the nominal one without them. Columns are exact where the
    coefficients equal those. A joint without elasticity has the stiffness 0 in its place.
    """

    name = 'elastic_transmission'
    phrase = 'elasticity of the transmission'
    parameters = (EffectParameter('stiffness', 'N m/rad', 'joint'),)
    shared = True
    separable = ((0,), (1,), (2,), (3,))
    needs_nominal = True
    tolerance = 2.0

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        compliance = np.array([shape.get(name, 0.0) for name in _names(state.joints)])
        return transmission_columns(state, -Springs(state).torque(compliance)[0])

    def coefficients(self, values: Values) -> np.ndarray:
        return one_a_joint(_inverse(values['stiffness']))

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        return {'stiffness': _inverse(np.diagonal(coefficients))}

    def expansion(self, coefficients: np.ndarray) -> Shape:
        """Return the shape that is exact at the coefficients (J,)."""
        return dict(zip(_names(len(coefficients)), map(float, coefficients)))

    def shape_of_sets(self, shape: Shape, sets: tuple[int, ...]) -> Shape:
        kept = [_name(joint) for joint in sets]
        return {name: value for name, value in shape.items() if name in kept}

    def torque(self, state: State, values: Values, joints: tuple[int, ...]) -> np.ndarray:
        compliance = self.coefficients(values)[:, 0]
        return self.columns(state, self.expansion(compliance)) @ compliance

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        compliance = _inverse(values['stiffness'])
        spread = std['stiffness'] * compliance ** 2
        worst = beyond(compliance, spread, low=0.0)
        if worst is not None:
            return (f'a transmission twists with its load, not against it: found a stiffness of '
                    f'{1.0 / compliance[worst]:.3g} N m/rad')
        low, high = believed_stiffnesses(
            float(base['actuator_inertia'][0]) if FAST in base else None)
        softest = int(np.argmax(compliance))
        if beyond(compliance[softest], spread[softest], 1.0 / high, 1.0 / low) is not None:
            return (f'a stiffness of {1.0 / max(compliance[softest], 1e-30):.3g} N m/rad is not '
                    f'one of a transmission, expected {low:.3g} to {high:.3g}')
        return None

    def signature(self, state: State) -> Signature:
        twist = time_rate(state, time_rate(state, transmitted_torque(state)))
        return Signature(twist, 'curvature of the load torque in time, N m/s2')


def _names(joints: int) -> list[str]:
    return [_name(joint) for joint in range(joints)]


def _name(joint: int) -> str:
    return f'expanded_at_{joint}'


def _inverse(values: np.ndarray) -> np.ndarray:
    """Return 1 / values, 0 where they are 0."""
    return np.divide(1.0, values, out=np.zeros(np.shape(values)), where=np.not_equal(values, 0.0))
