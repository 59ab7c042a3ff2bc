"""Forces on the platform and in the passive joints of a simulated machine."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numba
import numpy as np

from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.passive import passive_force_sample, passive_rates_sample

REST_RATE = 0.02
"""Rate (rad/s) at which Coulomb friction of passive joints has three quarters of its level.

Only actuated joints truly stick: while the four of them stand still nothing else can move."""


@dataclass(frozen=True)
class PlatformForces:
    """What acts on the platform besides rods and gravity.

    Attributes:
        force: (3,) N on D in `base`, constant.
        spring: stiffness along x, y, z of `base` (3,), N/m, pulling D towards `anchor`.
        anchor: where the spring is fixed, (3,) m.
        viscous_drag, quadratic_drag: N s/m, N s2/m2, against the velocity of D.
        theta_coulomb, theta_viscous: N m, N m s/rad, against thetad.
        pivot_coulomb, pivot_viscous: of each passive pivot, N m, N m s/rad.
    """

    force: np.ndarray = field(default_factory=lambda: np.zeros(3))
    spring: np.ndarray = field(default_factory=lambda: np.zeros(3))
    anchor: np.ndarray = field(default_factory=lambda: np.zeros(3))
    viscous_drag: float = 0.0
    quadratic_drag: float = 0.0
    theta_coulomb: float = 0.0
    theta_viscous: float = 0.0
    pivot_coulomb: float = 0.0
    pivot_viscous: float = 0.0

    @property
    def is_none(self) -> bool:
        """Whether nothing acts."""
        return not np.any(np.delete(self.packed, (6, 7, 8)))

    @property
    def has_pivots(self) -> bool:
        """Whether the passive pivots resist."""
        return self.pivot_coulomb > 0.0 or self.pivot_viscous > 0.0

    @property
    def packed(self) -> np.ndarray:
        """The values as the compiled kernels take them, (15,)."""
        return np.concatenate((
            self.force, np.broadcast_to(self.spring, (3,)), self.anchor,
            (self.viscous_drag, self.quadratic_drag, self.theta_coulomb, self.theta_viscous,
             self.pivot_coulomb, self.pivot_viscous))).astype(float)

    def generalised_force(self, geometry: Geometry, x: np.ndarray, xd: np.ndarray, q: np.ndarray,
                          qd: np.ndarray) -> np.ndarray:
        """Return the force on D, N, and the moment about theta, N m, (4,), of one motion."""
        force = np.empty(LEGS)
        platform_force_sample(self.packed, x, xd, force)
        if self.has_pivots:
            add_pivot_force(self.packed, geometry.packed, x, xd, q, qd, force)
        return force


@numba.njit(cache=True, error_model='numpy')
def platform_force_sample(platform, x, xd, force):
    """Write the generalised force (4,) on D and theta, N and N m, of all but the pivots."""
    speed = math.sqrt(xd[0] * xd[0] + xd[1] * xd[1] + xd[2] * xd[2])
    drag = platform[9] + platform[10] * speed
    for axis in range(3):
        force[axis] = (platform[axis] - platform[3 + axis] * (x[axis] - platform[6 + axis])
                       - drag * xd[axis])
    force[3] = -platform[11] * math.tanh(xd[3] / REST_RATE) - platform[12] * xd[3]


@numba.njit(cache=True, error_model='numpy')
def add_pivot_force(platform, packed, x, xd, q, qd, force):
    """Add the friction of the passive pivots to the generalised force (4,)."""
    rates, taken = np.empty((9, 3)), np.empty(4)
    passive_rates_sample(packed, x, xd, q, qd, rates)
    passive_force_sample(packed, x, q, rates, platform[13], platform[14], REST_RATE, taken)
    for axis in range(4):
        force[axis] -= taken[axis]
