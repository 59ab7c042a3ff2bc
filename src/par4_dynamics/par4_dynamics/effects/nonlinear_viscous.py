"""Viscous friction that is not proportional to speed."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import (
    CERTAIN,
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
from par4_dynamics.effects.grid import around
from par4_dynamics.state import State

QUADRATIC = 2.0
EXPONENTS = (0.25, 0.35, 0.5, 0.7, 1.4, QUADRATIC, 2.8)
"""Not near 0 and 1, which are Coulomb and viscous friction."""
ALIKE = 0.15
"""Distance of an exponent from 0 or 1 within which the torque is Coulomb or viscous friction of
joints that differ in it, if that is certain; or one of two that all but cancel."""
ROUNDED = 0.01
"""Distance of an exponent from 2 within which the law is told as the quadratic one."""
SPEED = 3.0
"""rad/s, at which its size is judged on the arms of a Par4."""


class NonlinearViscous(Effect):
    """tau_i += f_2 qd |qd| + F sign(qd) |qd / (1 rad/s)|^a, either or both of the forms.

    Columns and coefficients are those of one form: an exponent of 2 without `torque` is the
    quadratic one.
    """

    name = 'nonlinear_viscous'
    told_by_speeds = True
    phrase = 'friction that is not linear in speed'
    friction_term = 'viscous_friction'
    parameters = (EffectParameter('quadratic', 'N m s2/rad2', 'joint', default=0.0,
                                  at_unit_speed=True),
                  EffectParameter('torque', 'N m', 'joint', default=0.0, at_unit_speed=True),
                  EffectParameter('exponent', '1', 'joint', default=QUADRATIC, qualifies=True,
                                  positive=True))

    def shapes(self, state: State) -> tuple[Shape, ...]:
        return tuple({'exponent': exponent} for exponent in EXPONENTS)

    def refined(self, shape: Shape, step: float) -> tuple[Shape, ...]:
        return around('exponent', single(shape['exponent']), np.sqrt(2.0) ** step)

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return (state.direction * np.abs(state.qd) ** single(shape['exponent']))[..., None]

    def coefficients(self, values: Values) -> np.ndarray:
        return np.where(values['torque'] == 0.0, values['quadratic'], values['torque'])[None]

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        torque, none = coefficients[0], np.zeros_like(coefficients[0])
        exponent = single(shape['exponent'])
        quadratic = abs(exponent - QUADRATIC) < ROUNDED
        return {'quadratic': torque if quadratic else none,
                'torque': none if quadratic else torque,
                'exponent': np.full_like(torque, QUADRATIC if quadratic else exponent)}

    def shape_of(self, values: Values) -> Shape:
        return {'exponent': float(values['exponent']) if values['torque'] else QUADRATIC}

    def torque(self, state: State, values: Values, joints: tuple[int, ...]) -> np.ndarray:
        none = np.zeros_like(values['torque'])
        return (super().torque(state, {**values, 'torque': none}, joints)
                + super().torque(state, {**values, 'quadratic': none}, joints))

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        acting = values['torque'] != 0.0
        powers, spread, sizes = (part[acting] for part in (
            values['exponent'], std['exponent'], values['torque']))
        for power, name in ((0.0, 'Coulomb'), (1.0, 'viscous')):
            apart = np.abs(powers - power)
            # less than nothing of nearly the same law: two that all but cancel
            if np.any((apart + CERTAIN * spread < ALIKE) | ((apart < ALIKE) & (sizes < 0.0))):
                return (f'friction that grows with speed to the power {powers[0]:.3g} is {name} '
                        f'friction')
        speed = np.broadcast_to(base.get(FAST, SPEED), values['torque'].shape)
        torque, spread = (part['quadratic'] * speed ** 2
                          + part['torque'] * speed ** values['exponent'] for part in (values, std))
        friction = base['coulomb_friction'] + base['viscous_friction'] * speed
        worst = beyond(torque, spread, low=-friction)
        if worst is not None:
            return (f'{torque[worst]:.3g} N m at {speed[worst]:.3g} rad/s would make friction '
                    f'drive the joint')
        # the friction of an axis may follow such a law alone; the arms of a Par4 are known better
        worst = None if FAST in base else beyond(torque, spread, high=3.0 * friction)
        if worst is not None:
            return (f'{torque[worst]:.3g} N m at {speed[worst]:.3g} rad/s is more than three times '
                    f'the friction there, {friction[worst]:.3g} N m')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.qd, 'joint speed, rad/s')
