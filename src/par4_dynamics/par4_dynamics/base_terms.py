"""The six terms of (20), each a parameter with its column of torque per unit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from par4_dynamics.rigid_body import (
    COLUMNS,
    rigid_body_columns,
    rigid_body_torque,
    value_table,
)
from par4_dynamics.state import State
from par4_kinematics.robot import Bodies, Hanging


@dataclass(frozen=True)
class BaseTerm:
    """One of the base parameters chi of (23).

    Attributes:
        name: its name in `model.yaml`.
        unit: of the parameter.
        symbol: as in the paper.
        needs_platform: False for the terms of a single axis.
        nonnegative: True where physics forbids a negative value.
    """

    name: str
    unit: str
    symbol: str
    needs_platform: bool
    nonnegative: bool = True


BASE_TERMS = (
    BaseTerm('actuator_inertia', 'kg m2', 'i_act', False),
    BaseTerm('platform_mass_1', 'kg', "m_1'", True),
    BaseTerm('platform_mass_2', 'kg', "m_2'", True),
    BaseTerm('arm_gravity', 'N m', 'g (L_G m_4 + L m_5)', True, False),
    BaseTerm('coulomb_friction', 'N m', 'f_c', False),
    BaseTerm('viscous_friction', 'N m s/rad', 'f_v', False),
)
"""In the order of (23)."""
OFFSET = BaseTerm('torque_offset', 'N m', 'o', False, False)
"""Constant torque of a joint: no base parameter, but recordings may differ by it."""
INERTIA = 'actuator_inertia'
"""The base parameter that accelerations alone show."""
PLATFORM_MASSES = ('platform_mass_1', 'platform_mass_2')
"""Base parameters of the one platform, which no joint can have of its own."""
FRICTION = ('coulomb_friction', 'viscous_friction')
"""Base parameters that are no bodies."""

HANGING_TERMS: Mapping[Hanging, tuple[BaseTerm, ...]] = {
    'turning': (BaseTerm('gravity_sine', 'N m', 'a', False, False),
                BaseTerm('gravity_cosine', 'N m', 'b', False, False)),
    'sliding': (BaseTerm('gravity_load', 'N m', 'm g', False, False),)}
"""What gravity does to a single axis: a sin q + b cos q where it turns, a constant load where it
slides (its unit is then N)."""
AXIS_TERMS = (*(term for term in BASE_TERMS if not term.needs_platform),
              *HANGING_TERMS['turning'], *HANGING_TERMS['sliding'])
"""All terms that a single axis may have."""
TERMS: Mapping[str, BaseTerm] = {term.name: term for term in (*BASE_TERMS, *AXIS_TERMS)}
"""All terms of robots and axes, by name."""

UNMODELLED = COLUMNS[len(BASE_TERMS):]
"""Parameters of the full mechanism that (20) leaves out, in the order of their columns."""


def base_terms(state: State) -> tuple[BaseTerm, ...]:
    """Return the terms that apply: all six, or those of a single axis and of what hangs on it."""
    if state.geometry is not None:
        return BASE_TERMS
    hanging = () if state.hanging is None else HANGING_TERMS[state.hanging]
    return (*(term for term in BASE_TERMS if not term.needs_platform), *hanging)


def base_columns(state: State, terms: Sequence[BaseTerm] | None = None) -> np.ndarray:
    """Return the regressor W of (22), (n, J, p).

    Args:
        state: the motion.
        terms: whose columns, in that order; those of `base_terms(state)` by default.
    """
    whole = base_terms(state)
    columns = (rigid_body_columns(state, len(BASE_TERMS)) if state.geometry is not None else
               np.stack([_axis_column(state, term.name) for term in whole], axis=-1))
    if terms is None or tuple(terms) == whole:
        return columns
    return columns[..., [whole.index(term) for term in terms]]


def _axis_column(state: State, name: str) -> np.ndarray:
    """Return the torque (n, J) of a single axis per unit of one of `AXIS_TERMS`."""
    columns: dict[str, Callable[[], np.ndarray]] = {
        'actuator_inertia': lambda: state.qdd,
        'coulomb_friction': lambda: state.direction,
        'viscous_friction': lambda: state.qd,
        'gravity_sine': lambda: np.sin(state.q),
        'gravity_cosine': lambda: np.cos(state.q),
        'gravity_load': lambda: np.ones_like(state.q)}
    return columns[name]()


def unmodelled_columns(state: State) -> np.ndarray:
    """Return the columns (n, 4, 3) of `UNMODELLED`: full mechanism minus (20), per unit."""
    return rigid_body_columns(state)[..., len(BASE_TERMS):]


def torque_of_values(state: State, values: Mapping[str, np.ndarray | float]
                     ) -> np.ndarray:
    """Return the torque (n, J), N m, of base terms and `UNMODELLED` with these values.

    Args:
        state: the motion.
        values: name -> one number or (J,); those that are not named are zero.
    """
    torque = np.zeros_like(state.q)
    if state.geometry is not None:
        return rigid_body_torque(state, value_table(values)) if values else torque
    for term in AXIS_TERMS:
        if term.name in values:
            torque += _axis_column(state, term.name) * values[term.name]
    return torque


def values_of_bodies(bodies: Bodies) -> dict[str, float]:
    """Return the values of `UNMODELLED` for known rods, bars and theta inertia."""
    return {name: getattr(bodies, name) for name in UNMODELLED}


def distributed_torque(bodies: Bodies, state: State) -> np.ndarray:
    """Return the torque (n, J), N m, that known rods, bars and theta inertia add to (20)."""
    return torque_of_values(state, values_of_bodies(bodies))
