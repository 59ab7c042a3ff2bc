"""The six terms of (20), each a parameter with its column of torque per unit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from par4_dynamics.rigid_body import (
    COLUMNS,
    rigid_body_columns,
    rigid_body_torque,
    value_table,
)
from par4_dynamics.state import State
from par4_kinematics.robot import Bodies


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

UNMODELLED = COLUMNS[len(BASE_TERMS):]
"""Parameters of the full mechanism that (20) leaves out, in the order of their columns."""


def base_terms(state: State) -> tuple[BaseTerm, ...]:
    """Return the terms that apply: all six, or those of a single axis."""
    return tuple(term for term in BASE_TERMS
                 if state.geometry is not None or not term.needs_platform)


def base_columns(state: State) -> np.ndarray:
    """Return the regressor W of (22), (n, J, p), in the order of `base_terms(state)`."""
    if state.geometry is None:
        return np.stack((state.qdd, np.sign(state.qd), state.qd), axis=-1)
    return rigid_body_columns(state, len(BASE_TERMS))


def unmodelled_columns(state: State) -> np.ndarray:
    """Return the columns (n, 4, 3) of `UNMODELLED`: full mechanism minus (20), per unit."""
    return rigid_body_columns(state)[..., len(BASE_TERMS):]


def torque_of_values(state: State, values: Mapping[str, np.ndarray]) -> np.ndarray:
    """Return the torque (n, J), N m, of base terms and `UNMODELLED` with these values.

    Args:
        state: the motion.
        values: name -> one number or (J,); those that are not named are zero.
    """
    if state.geometry is not None:
        return rigid_body_torque(state, value_table(values))
    chi = np.stack([np.broadcast_to(values.get(term.name, 0.0), (state.joints,))
                    for term in base_terms(state)])
    return np.einsum('njp,pj->nj', base_columns(state), chi)


def values_of_bodies(bodies: Bodies) -> dict[str, float]:
    """Return the values of `UNMODELLED` for known rods, bars and theta inertia."""
    return {name: getattr(bodies, name) for name in UNMODELLED}


def distributed_torque(bodies: Bodies, state: State) -> np.ndarray:
    """Return the torque (n, J), N m, that known rods, bars and theta inertia add to (20)."""
    return torque_of_values(state, values_of_bodies(bodies))
