"""The friction of a simulated joint, with real sticking; shared by all plants.

F(v) opposes the motion: F = f_c + f_v v + F_s exp(-(v / v_s)^2) for v > 0. At rest it takes any
value up to the breakaway level f_c + F_s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numba
import numpy as np

from par4_kinematics.geometry import LEGS


def _zeros() -> np.ndarray:
    return np.zeros(LEGS)


@dataclass(frozen=True)
class Friction:
    """Friction of the four joints, each (4,).

    Attributes:
        coulomb: f_c, N m.
        viscous: f_v, N m s/rad.
        stribeck_torque: F_s above f_c at rest, N m.
        stribeck_velocity: v_s, rad/s.
    """

    coulomb: np.ndarray = field(default_factory=_zeros)
    viscous: np.ndarray = field(default_factory=_zeros)
    stribeck_torque: np.ndarray = field(default_factory=_zeros)
    stribeck_velocity: np.ndarray = field(default_factory=lambda: np.ones(LEGS))

    @property
    def packed(self) -> np.ndarray:
        """(4, 4): one row a joint, as the compiled kernels take it."""
        return np.stack([np.broadcast_to(part, (LEGS,)).astype(float) for part in (
            self.coulomb, self.viscous, self.stribeck_torque, self.stribeck_velocity)], axis=1)


@numba.njit(cache=True, error_model='numpy')
def dry_friction(law, speed):
    """Return the speed-independent part plus Stribeck's of one joint at |speed|, N m."""
    ratio = speed / law[3]
    return law[0] + law[2] * math.exp(-ratio * ratio)
