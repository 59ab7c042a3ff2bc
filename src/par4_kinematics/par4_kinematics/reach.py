"""How far from a pose the legs end that cannot reach it: what errors tell."""

from __future__ import annotations

import math

import numpy as np

from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.leg import plate_joint


def leg_gaps(geometry: Geometry, x: np.ndarray) -> np.ndarray:
    """Return what stays open between forearm and plate joint of each leg at pose x (4,), m.

    At the best position of the arm; 0 where the leg reaches. The elbow can be anywhere on a circle
    in the plane of the arm, and must be as far from the plate joint as the forearm is long.
    """
    gaps = np.zeros(LEGS)
    for leg in range(LEGS):
        along, across, up = plate_joint(geometry.packed, x[0], x[1], x[2], math.cos(x[3]),
                                        math.sin(x[3]), leg)
        arm, rod = geometry.arm_lengths[leg], geometry.forearm_lengths[leg]
        in_plane = math.hypot(along, up)
        nearest = math.hypot(in_plane - arm, across)
        farthest = math.hypot(in_plane + arm, across)
        gaps[leg] = max(nearest - rod, rod - farthest, 0.0)
    return gaps


def unreached_legs(geometry: Geometry, x: np.ndarray) -> str:
    """Return in words which legs cannot reach pose x (4,), and by how much."""
    gaps = leg_gaps(geometry, x)
    lost = np.flatnonzero(gaps >= min(gaps.max(), 1e-12))  # on the very edge rounding leaves 0
    return ', '.join(f'leg {leg} cannot reach it by {gaps[leg]:.3g} m' for leg in lost)
