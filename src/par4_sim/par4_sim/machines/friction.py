"""The friction of a simulated joint, with real sticking; shared by all plants.

F opposes the motion. While a joint moves with v > 0 (v < 0: the mirror image)

    F = f_c + F_s exp(-|v / v_s|^a) + f_v v + f_2 v^2 + f_p v^p + mu |tau_load|

where f_c and f_v may differ between the directions and tau_load is the torque that goes on behind
the friction. As the machine warms up, the dry part of F (f_c, F_s, mu) and the part that flows
(f_v, f_2, f_p) each lose a share of their own. At rest F takes any value up to the breakaway
level. With presliding (Dahl) f_c acts through the bending of the contact: f_c z with
dz/dq = (1 - z sign(v)) / x_s instead of f_c sign(v).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numba
import numpy as np

from par4_kinematics.geometry import LEGS

(FORWARD_COULOMB, BACK_COULOMB, FORWARD_VISCOUS, BACK_VISCOUS, STRIBECK_TORQUE, STRIBECK_VELOCITY,
 STRIBECK_EXPONENT, QUADRATIC, POWER_TORQUE, POWER_EXPONENT, LOAD_COEFFICIENT, PRESLIDING_DISTANCE,
 DRY_DROP, FLOWING_DROP, WARMING_TIME) = range(15)
"""Columns of `Friction.packed`."""
DRY = (FORWARD_COULOMB, BACK_COULOMB, STRIBECK_TORQUE, LOAD_COEFFICIENT)
FLOWING = (FORWARD_VISCOUS, BACK_VISCOUS, QUADRATIC, POWER_TORQUE)
"""The levels that warming lowers: of the friction between surfaces, and of the lubricant."""


def _zeros() -> np.ndarray:
    return np.zeros(LEGS)


@dataclass(frozen=True)
class Friction:
    """Friction of the four joints, each (4,) but for warming.

    Attributes:
        coulomb: f_c, N m, the mean of both directions.
        viscous: f_v, N m s/rad, the mean of both directions.
        coulomb_asymmetry: half the difference of f_c between forward and back, N m.
        viscous_asymmetry: half the difference of f_v between forward and back, N m s/rad.
        stribeck_torque: F_s above f_c at rest, N m.
        stribeck_velocity, stribeck_exponent: v_s, rad/s, and a.
        quadratic: f_2, N m s2/rad2.
        power_torque, power_exponent: f_p, N m at 1 rad/s, and p.
        load_coefficient: mu.
        presliding_distance: x_s, rad; 0 = Coulomb friction that sticks.
        dry_drop, flowing_drop: shares that the two parts of the friction lose while warming up.
        warming_time: a part is 1 - drop (1 - exp(-t / warming_time)) of what it was at t = 0, s.
    """

    coulomb: np.ndarray = field(default_factory=_zeros)
    viscous: np.ndarray = field(default_factory=_zeros)
    coulomb_asymmetry: np.ndarray = field(default_factory=_zeros)
    viscous_asymmetry: np.ndarray = field(default_factory=_zeros)
    stribeck_torque: np.ndarray = field(default_factory=_zeros)
    stribeck_velocity: np.ndarray = field(default_factory=lambda: np.ones(LEGS))
    stribeck_exponent: np.ndarray = field(default_factory=lambda: np.full(LEGS, 2.0))
    quadratic: np.ndarray = field(default_factory=_zeros)
    power_torque: np.ndarray = field(default_factory=_zeros)
    power_exponent: np.ndarray = field(default_factory=lambda: np.ones(LEGS))
    load_coefficient: np.ndarray = field(default_factory=_zeros)
    presliding_distance: np.ndarray = field(default_factory=_zeros)
    dry_drop: float = 0.0
    flowing_drop: float = 0.0
    warming_time: float = 1.0

    @property
    def packed(self) -> np.ndarray:
        """(4, 15): one row a joint, as the compiled kernels take it; see the columns above."""
        return np.stack([np.broadcast_to(part, (LEGS,)).astype(float) for part in (
            self.coulomb + self.coulomb_asymmetry, self.coulomb - self.coulomb_asymmetry,
            self.viscous + self.viscous_asymmetry, self.viscous - self.viscous_asymmetry,
            self.stribeck_torque, self.stribeck_velocity, self.stribeck_exponent, self.quadratic,
            self.power_torque, self.power_exponent, self.load_coefficient, self.presliding_distance,
            self.dry_drop, self.flowing_drop, self.warming_time)], axis=1)

    @property
    def is_dry(self) -> np.ndarray:
        """Whether each joint can stick, (4,) bool."""
        laws = self.packed
        plateau = (laws[:, FORWARD_COULOMB] > 0) | (laws[:, BACK_COULOMB] > 0)
        return ((plateau & (laws[:, PRESLIDING_DISTANCE] == 0.0))
                | (laws[:, STRIBECK_TORQUE] > 0) | (laws[:, LOAD_COEFFICIENT] > 0))


@numba.njit(cache=True, error_model='numpy')
def friction_at(laws, time):
    """Return the laws (4, 15) with the levels that warming has left at a time, s."""
    if laws[0, DRY_DROP] == 0.0 and laws[0, FLOWING_DROP] == 0.0:
        return laws
    warm = 1.0 - math.exp(-time / laws[0, WARMING_TIME])
    now = laws.copy()
    for joint in range(laws.shape[0]):
        for column in DRY:
            now[joint, column] *= 1.0 - laws[joint, DRY_DROP] * warm
        for column in FLOWING:
            now[joint, column] *= 1.0 - laws[joint, FLOWING_DROP] * warm
    return now


@numba.njit(cache=True, error_model='numpy')
def dry_friction(laws, joint, direction, speed):
    """Return what of one joint's friction does not vanish with its speed, N m.

    Args:
        laws, joint: `friction_at` and whose row.
        direction: > 0 for forward, else back.
        speed: |v|, rad/s.
    """
    level = 0.0
    if laws[joint, PRESLIDING_DISTANCE] == 0.0:
        level = laws[joint, FORWARD_COULOMB] if direction > 0.0 else laws[joint, BACK_COULOMB]
    if laws[joint, STRIBECK_TORQUE] != 0.0:
        ratio = speed / laws[joint, STRIBECK_VELOCITY]
        level += laws[joint, STRIBECK_TORQUE] * math.exp(-ratio ** laws[joint, STRIBECK_EXPONENT])
    return level


@numba.njit(cache=True, error_model='numpy')
def flowing_friction(laws, joint, velocity):
    """Return what of one joint's friction vanishes with its velocity, N m, signed."""
    slope = laws[joint, FORWARD_VISCOUS] if velocity > 0.0 else laws[joint, BACK_VISCOUS]
    torque = slope * velocity
    if laws[joint, QUADRATIC] != 0.0:
        torque += laws[joint, QUADRATIC] * velocity * abs(velocity)
    if laws[joint, POWER_TORQUE] != 0.0:
        torque += laws[joint, POWER_TORQUE] * math.copysign(
            abs(velocity) ** laws[joint, POWER_EXPONENT], velocity)
    return torque


@numba.njit(cache=True, error_model='numpy')
def bent(laws, joint, bending, moved):
    """Return the bending z of a contact that was `bending` before the joint moved by `moved`."""
    end = 1.0 if moved > 0.0 else -1.0
    return end + (bending - end) * math.exp(-abs(moved) / laws[joint, PRESLIDING_DISTANCE])


@numba.njit(cache=True, error_model='numpy')
def bending_torque(laws, joint, bending):
    """Return Coulomb friction through the bending of the contact, N m, signed."""
    return (laws[joint, FORWARD_COULOMB] if bending > 0.0 else laws[joint, BACK_COULOMB]) * bending


@numba.njit(cache=True, error_model='numpy')
def behind_load_friction(laws, joint, direction, torque):
    """Return the torque left of `torque` behind friction mu |tau_load| in the given direction.

    tau_load = torque - mu |tau_load| direction, solved for tau_load.
    """
    if laws[joint, LOAD_COEFFICIENT] == 0.0:
        return torque
    side = direction if torque > 0.0 else -direction
    return torque / (1.0 + laws[joint, LOAD_COEFFICIENT] * side)
