"""Directions of one leg as the URDF of chains and tree have them, in frames parallel to `base`."""

from __future__ import annotations

import math

import numpy as np

from par4_kinematics.geometry import Geometry
from par4_sim.description.urdf import UP

SIDES = (-1.0, 1.0)
"""Where the two of a pair of rods or bars are."""


def outward_of(geometry: Geometry, leg: int) -> np.ndarray:
    """Return e_i (3,)."""
    return np.array((geometry.packed[4 + 4 * leg], geometry.packed[5 + 4 * leg], 0.0))


def sideways_of(geometry: Geometry, leg: int) -> np.ndarray:
    """Return z x e_i (3,), the axis about which q_i turns the arm downward."""
    return np.cross(UP, outward_of(geometry, leg))


def plate_joint_of(geometry: Geometry, leg: int) -> np.ndarray:
    """Return the vector (3,), m, from D (legs 2, 3) or D' (legs 0, 1) to B_i."""
    return np.array((geometry.packed[6 + 4 * leg], geometry.packed[7 + 4 * leg], 0.0))


def swing_and_tilt(geometry: Geometry, rod: np.ndarray, angle: float, leg: int
                   ) -> tuple[float, float]:
    """Return the turns, rad, that take a rod of `leg` from vertical into the direction rod (3,).

    In the frame of the arm at q_i = angle: first about e_i (tilt), then about z x e_i (swing).
    """
    rod = rod / np.linalg.norm(rod)
    outward, sideways = outward_of(geometry, leg), sideways_of(geometry, leg)
    along_arm = rod @ (math.cos(angle) * outward - math.sin(angle) * UP)
    above_arm = rod @ (math.sin(angle) * outward + math.cos(angle) * UP)
    return math.atan2(-along_arm, -above_arm), math.asin(rod @ sideways)
