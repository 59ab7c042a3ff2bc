"""Friction of joints as a rigid-body engine takes it: motors that hold, and a torque."""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.geometry import LEGS
from par4_sim.machines.friction import (
    BACK_COULOMB,
    DRY_DROP,
    FORWARD_COULOMB,
    LOAD_COEFFICIENT,
    PRESLIDING_DISTANCE,
    STRIBECK_TORQUE,
    behind_load_friction,
    bending_torque,
    bent,
    dry_friction,
    flowing_friction,
    friction_at,
)
from par4_sim.machines.machine import Machine

STANDSTILL = 1e-12
"""Speed of a joint, rad/s, that the solver's rounding leaves to one that is held."""


@numba.njit(cache=True, error_model='numpy')
def _smooth_friction(laws, time, velocity, moved, bending):
    """Return the friction (4,), N m, that is not dry; `bending` (4,) goes on by `moved`, rad."""
    laws, torque = friction_at(laws, time), np.empty(4)
    for joint in range(4):
        torque[joint] = flowing_friction(laws, joint, velocity[joint])
        if laws[joint, PRESLIDING_DISTANCE] > 0.0:
            bending[joint] = bent(laws, joint, bending[joint], moved[joint])
            torque[joint] += bending_torque(laws, joint, bending[joint])
        else:  # dry levels that differ between the directions: a symmetric one and this
            torque[joint] += 0.5 * (laws[joint, FORWARD_COULOMB] - laws[joint, BACK_COULOMB])
    return torque


class JointFriction:
    """Friction of a machine's joints as an engine takes it: dry levels apart from a torque.

    Attributes:
        varies: whether the dry levels do.
        bears_load: whether they depend on the torque that goes on behind the friction.
        load: that torque in the last step (4,), N m; None where it is not known.
    """

    def __init__(self, machine: Machine) -> None:
        self._laws = machine.friction.packed
        self.bears_load = bool(np.any(self._laws[:, LOAD_COEFFICIENT]))
        self.varies = self.bears_load or bool(np.any(self._laws[:, (STRIBECK_TORQUE, DRY_DROP)]))
        self.restart(np.zeros(LEGS))

    def restart(self, q: np.ndarray) -> None:
        """Begin at joint positions q (4,) with unbent contacts."""
        self._q = q
        self._bending = np.zeros(LEGS)
        self.load: np.ndarray | None = None

    @property
    def at_rest(self) -> np.ndarray:
        """Dry friction of resting, unloaded joints (4,), N m."""
        return self.dry(0.0, np.zeros(LEGS), np.zeros(LEGS))

    def torque(self, time: float, q: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the friction (4,), N m, that is not dry; contacts bend on to q (4,)."""
        moved, self._q = q - self._q, q
        return _smooth_friction(self._laws, time, velocity, moved, self._bending)

    def dry(self, time: float, velocity: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Return the torque (4,), N m, up to which a joint is held, `torque` (4,) driving it."""
        laws, result = friction_at(self._laws, time), np.empty(LEGS)
        for joint in range(LEGS):
            speed = abs(velocity[joint])
            level = 0.5 * sum(dry_friction(laws, joint, side, speed) for side in (-1.0, 1.0))
            if speed > STANDSTILL:
                direction = math.copysign(1.0, velocity[joint])
                load = behind_load_friction(laws, joint, direction,
                                            torque[joint] - direction * level)
            else:  # what holds a joint tells which part of its torque goes on
                load = torque[joint] if self.load is None else self.load[joint]
            result[joint] = level + laws[joint, LOAD_COEFFICIENT] * abs(load)
        return result
