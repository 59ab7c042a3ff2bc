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
    single,
)
from par4_dynamics.effects.springs import DAMPING_RATIO, FIRST, Drive, Springs
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.effects.transmission import (
    MOTOR_SHARE,
    half_assumed,
    one_a_joint,
    transmission_columns,
)
from par4_dynamics.state import State

STIFFNESSES = (1e2, 1e6)
"""N m/rad, of the arms of a Par4."""
DAMPING_RATIOS = (2e-3, 0.35)
"""Of a transmission: from a bare steel shaft to twice what the softest rubber couplings have."""
MOTOR_SHARES = (0.05, 0.95)
"""Of the actuator inertia that turns with the motor: from a heavy arm to a high gear ratio."""
STEP = 1e-3
"""Of a compliance, for the slope of the torque."""
COMMON = 'damping_ratio', 'motor_share'
"""Names of what the transmissions of a machine have in common: those of a `Drive`."""
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
    `expanded_at_<joint>` each, and is the nominal one without them. Columns are the change of the
    torque with each compliance there; what this first order misses is shared out among them, so
    that they are exact where the coefficients equal those compliances. A joint without elasticity
    has the stiffness 0 in its place. The damping ratio is over the critical damping with which the
    two parts of the actuator's inertia, motor and arm, swing against each other; `motor_share` is
    that of the motor in it.
    """

    name = 'elastic_transmission'
    phrase = 'elasticity of the transmission'
    parameters = (
        EffectParameter('stiffness', 'N m/rad', 'joint', nonnegative=True),  # 0 is a rigid joint
        EffectParameter('damping_ratio', '1', 'machine', default=DAMPING_RATIO, is_shape=True,
                        meaning='how soon the load stops swinging on its spring: 0 is never, 1 is '
                                'without a swing, at 0.05 each swing is 0.73 of the one before, '
                                'where the two parts of the actuator inertia, motor and arm, swing '
                                'against each other'),
        EffectParameter('motor_share', '1', 'machine', default=MOTOR_SHARE, is_shape=True,
                        meaning='part of the actuator inertia on the side of motor and encoder; '
                                'the rest of it swings with the load'))
    shared = True
    separable = ((0,), (1,), (2,), (3,))
    needs_nominal = True
    looks_around = True
    memory = FIRST
    variables = 2

    def assumes(self, values: Values) -> str | None:
        if np.any(values['motor_share'] != MOTOR_SHARE):
            return None
        return half_assumed('stiffness is larger')

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        compliance, drive = self.exact_at(shape, state.joints), drive_of(shape)
        springs = Springs(state)
        spring, torque = springs.torque(compliance, drive)
        columns = (np.zeros((*torque.shape, state.joints)) if np.all(compliance > 0.0)
                   else transmission_columns(state, -spring, drive.motor_share))
        if not np.any(compliance > 0.0):
            return columns
        for joint in np.flatnonzero(compliance > 0.0):
            moved = compliance.copy()
            moved[joint] *= 1.0 + STEP
            columns[..., joint] = (springs.torque(moved, drive)[1] - torque) / (
                STEP * compliance[joint])
        missed = torque - columns @ compliance
        return columns + missed[..., None] * compliance / (compliance @ compliance)

    def coefficients(self, values: Values) -> np.ndarray:
        return one_a_joint(_inverse(values['stiffness']))

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        stiffness, drive = _inverse(np.diagonal(coefficients)), drive_of(shape)
        return {'stiffness': stiffness,
                **{name: np.full_like(stiffness, getattr(drive, name)) for name in COMMON}}

    def free_numbers(self, shape: Shape) -> int:
        return sum(name in shape for name in COMMON)

    def expansion(self, coefficients: np.ndarray, shape: Shape | None = None) -> Shape:
        """Return the shape that is exact at the coefficients (J,), with the drive of `shape`."""
        known = {name: value for name, value in (shape or {}).items() if name in COMMON}
        return {**dict(zip(_names(len(coefficients)), map(float, coefficients))), **known}

    def shape_of_joints(self, values: Values, joints: tuple[int, ...]) -> Shape:
        # about zero, where the shape of a single joint is, the series misses most of a soft one
        return self.expansion(self.coefficients(values)[:, 0],
                              super().shape_of_joints(values, joints))

    def exact_at(self, shape: Shape, joints: int) -> np.ndarray:
        return np.array([single(shape.get(name, 0.0)) for name in _names(joints)])

    def sets_of(self, shape: Shape) -> tuple[int, ...]:
        # what a rigid joint seems to twist is what other causes leave, and may have any sign
        soft = np.flatnonzero(self.exact_at(shape, len(self.separable)))
        return tuple(soft.tolist()) or super().sets_of(shape)

    def shape_of_sets(self, shape: Shape, sets: tuple[int, ...]) -> Shape:
        kept = [*map(_name, sets), *COMMON]
        return {name: value for name, value in shape.items() if name in kept}

    def passed(self, state: State, values: Values) -> np.ndarray:
        compliance, drive = self._springs_of(values)
        spring, _ = Springs(state).torque(compliance, drive)
        return np.where(compliance > 0.0, spring, state.known.load)

    def torque(self, state: State, values: Values, joints: tuple[int, ...]) -> np.ndarray:
        return Springs(state).torque(*self._springs_of(values))[1]

    def _springs_of(self, values: Values) -> tuple[np.ndarray, Drive]:
        """Return the compliances (J,), rad/(N m), of values, and what they have in common."""
        return (self.coefficients(values)[:, 0],
                Drive(*(float(values[name][0]) for name in COMMON)))

    def senseless(self, values: Values) -> str | None:
        least = float(np.min(values['damping_ratio']))
        if least < 0.0:
            return f'damping_ratio: expected 0 or more, found {least:g}'
        share = float(values['motor_share'][0])
        return (None if 0.0 < share < 1.0 else
                f'motor_share: expected more than 0 and less than 1, found {share:g}')

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        compliance = _inverse(values['stiffness'])
        spread = std['stiffness'] * compliance ** 2
        worst = beyond(compliance, spread, low=0.0)
        if worst is not None:
            return (f'a transmission twists with its load, not against it: found a stiffness of '
                    f'{1.0 / compliance[worst]:.3g} N m/rad')
        damping_ratio = values['damping_ratio'][:1]
        if beyond(damping_ratio, std['damping_ratio'][:1], *DAMPING_RATIOS) is not None:
            return (f'a damping ratio of {damping_ratio[0]:.3g} is not one of a transmission, '
                    f'expected {DAMPING_RATIOS[0]:g} to {DAMPING_RATIOS[1]:g}')
        share = values['motor_share'][:1]
        if beyond(share, std['motor_share'][:1], *MOTOR_SHARES) is not None:
            return (f'a motor with {100.0 * share[0]:.3g} % of the actuator inertia is none of a '
                    f'machine, expected {100.0 * MOTOR_SHARES[0]:g} to '
                    f'{100.0 * MOTOR_SHARES[1]:g} %')
        low, high = believed_stiffnesses(
            float(base['actuator_inertia'][0]) if FAST in base else None)
        softest = int(np.argmax(compliance))
        if beyond(compliance[softest], spread[softest], 1.0 / high, 1.0 / low) is not None:
            return (f'a stiffness of {1.0 / max(compliance[softest], 1e-30):.3g} N m/rad is not '
                    f'one of a transmission, expected {low:.3g} to {high:.3g}')
        return None

    def signature(self, state: State) -> Signature:
        twist = time_rate(state, time_rate(state, Springs(state).rigid()))
        return Signature(twist, 'curvature of the load torque in time, N m/s2')


def _names(joints: int) -> list[str]:
    return [_name(joint) for joint in range(joints)]


def drive_of(shape: Shape) -> Drive:
    """Return what the transmissions of a shape have in common."""
    return Drive(**{name: single(shape[name]) for name in COMMON if name in shape})


def _name(joint: int) -> str:
    return f'expanded_at_{joint}'


def _inverse(values: np.ndarray) -> np.ndarray:
    """Return 1 / values, 0 where they are 0."""
    return np.divide(1.0, values, out=np.zeros(np.shape(values)), where=np.not_equal(values, 0.0))
