"""Inverse and forward kinematics: joint positions q against pose X = (x, y, z, theta) of D.

Leg i: arm A_i = P_i + L (cos q_i e_i - sin q_i z), forearm |A_i B_i| = l; q positive downward from
the horizontal, elbow outward. B_i moves with D (legs 2, 3) or with D' = D + h (-sin theta,
cos theta, 0) (legs 0, 1); both half plates translate only.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_matching_rows, as_rows
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import HOME, LEGS, POSE_NAMES, Geometry
from par4_kinematics.leg import arm_direction, forearm_vector, plate_joint
from par4_kinematics.linear_solve import solve_in_place
from par4_kinematics.reach import unreached_legs

CONVERGED = 1e-12
"""Loop opening (m) at which Newton's iteration stops."""
MAX_ITERATIONS = 30


@numba.njit(cache=True, error_model='numpy')
def forearm(packed, x, angle, leg):
    """Return the vector A_i B_i of one leg in `base`, m."""
    along, across, up = plate_joint(packed, x[0], x[1], x[2], math.cos(x[3]),
                                    math.sin(x[3]), leg)
    return forearm_vector(packed, along, across, up, math.cos(angle), math.sin(angle), leg)


@numba.njit(cache=True, error_model='numpy')
def inverse_sample(packed, x, q):
    """Write the joint positions of one pose to q (4,); return -1, or the leg that cannot reach."""
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    for leg in range(4):
        along, across, up = plate_joint(packed, x[0], x[1], x[2], cosine, sine, leg)
        reached, cos_q, sin_q = arm_direction(packed, along, across, up)
        if not reached:
            return leg
        q[leg] = math.atan2(sin_q, cos_q)
    return -1


@numba.njit(cache=True, error_model='numpy')
def forward_sample(packed, q, x):
    """Improve the pose x (4,) in place until it closes the loops of q; return the iterations.

    Newton's iteration on (|A_i B_i|^2 - l^2) / 2. Returns -1 if it does not converge to the
    assembly mode in which the elbows point outward and the platform hangs below them.
    """
    matrix = np.empty((4, 4))
    step = np.empty((4, 1))
    angles = np.empty(4)
    for iteration in range(MAX_ITERATIONS):
        worst = 0.0
        for leg in range(4):
            ab_x, ab_y, ab_z = forearm(packed, x, q[leg], leg)
            matrix[leg, 0], matrix[leg, 1], matrix[leg, 2] = ab_x, ab_y, ab_z
            matrix[leg, 3] = 0.0
            if leg < 2:
                matrix[leg, 3] = -packed[3] * (math.cos(x[3]) * ab_x + math.sin(x[3]) * ab_y)
            opening = 0.5 * (ab_x * ab_x + ab_y * ab_y + ab_z * ab_z - packed[1] * packed[1])
            step[leg, 0] = opening
            worst = max(worst, abs(opening) / packed[1])
        if worst < CONVERGED:
            if inverse_sample(packed, x, angles) >= 0 or abs(x[3]) > 0.5 * math.pi:
                return -1
            for leg in range(4):
                if abs(angles[leg] - q[leg]) > 1e-6:
                    return -1
            return iteration
        if not solve_in_place(matrix, step) > 1e-12:
            return -1
        scale = 1.0
        for axis in range(3):
            scale = min(scale, 0.5 * packed[1] / max(abs(step[axis, 0]), 1e-300))
        scale = min(scale, 1.0 / max(abs(step[3, 0]), 1e-300))
        for axis in range(4):
            x[axis] -= scale * step[axis, 0]
    return -1


@numba.njit(cache=True, error_model='numpy')
def _inverse_rows(packed, x, q):
    for row in range(x.shape[0]):
        leg = inverse_sample(packed, x[row], q[row])
        if leg >= 0:
            return row, leg
    return -1, -1


@numba.njit(cache=True, error_model='numpy')
def _forward_rows(packed, q, start, home, x):
    for row in range(q.shape[0]):
        if row == 0:
            x[row] = start[0]
        elif row == 1:
            x[row] = x[row - 1]
        else:  # constant velocity is a good guess within a log
            x[row] = 2.0 * x[row - 1] - x[row - 2]
        if forward_sample(packed, q[row], x[row]) < 0:
            x[row] = home
            if forward_sample(packed, q[row], x[row]) < 0:
                return row
    return -1


def inverse_kinematics(geometry: Geometry, x: ArrayLike) -> np.ndarray:
    """Return the joint positions q (..., 4), rad, of the poses x (..., 4), m and rad.

    Raises:
        UnreachableError: a pose that a leg cannot reach; names sample, pose and legs.
        InputError: wrong shape or a value that is not finite.
    """
    rows, leading = as_rows(x, 'pose x')
    q = np.empty_like(rows)
    row, _ = _inverse_rows(geometry.packed, rows, q)
    if row >= 0:
        pose = ', '.join(f'{name} {value:.4g}'
                         for name, value in zip(POSE_NAMES, rows[row], strict=True))
        raise UnreachableError(f'pose {row} ({pose}): {unreached_legs(geometry, rows[row])}; '
                               f'bring the pose into the workspace')
    return q.reshape((*leading, LEGS))


def forward_kinematics(geometry: Geometry, q: ArrayLike, start: ArrayLike = HOME) -> np.ndarray:
    """Return the poses x (..., 4), m and rad, of the joint positions q (..., 4), rad.

    Rows are taken in order and each starts from the ones before (a log is solved in a few
    iterations a sample); a row that fails from there is tried again from the home pose.

    Args:
        geometry: dimensions of the robot.
        q: joint positions.
        start: pose near the first sample.

    Raises:
        UnreachableError: joint positions that no pose of this assembly mode closes.
        InputError: wrong shape or a value that is not finite.
    """
    rows, leading = as_rows(q, 'joint positions q')
    first, _ = as_rows(start, 'start pose')
    x = np.empty_like(rows)
    home = mid_height_home(geometry)
    row = _forward_rows(geometry.packed, rows, first[:1], home, x)
    if row >= 0:
        angles = ', '.join(f'{angle:.4g}' for angle in rows[row])
        raise UnreachableError(
            f'joint positions {row} ({angles}): the mechanism does not close with them in its '
            f'working assembly mode; check the order, sign and zero of the joints')
    return x.reshape((*leading, LEGS))


def mid_height_home(geometry: Geometry) -> np.ndarray:
    """Return a pose (4,) on the axis with the arms near the horizontal, whatever the size."""
    across = (geometry.base_radius + geometry.arm_length - geometry.platform_radius)
    if across < geometry.forearm_length:
        return np.array((0.0, -0.5 * geometry.platform_bar_length,
                         -math.sqrt(geometry.forearm_length ** 2 - across ** 2), 0.0))
    return np.array(HOME)


def loop_opening(geometry: Geometry, q: ArrayLike, x: ArrayLike) -> np.ndarray:
    """Return |A_i B_i| - l (..., 4), m, of joint positions q against poses x."""
    (q_rows, x_rows), leading = as_matching_rows({'q': q, 'x': x})
    opening = np.empty_like(q_rows)
    for row in range(len(q_rows)):
        for leg in range(LEGS):
            vector = forearm(geometry.packed, x_rows[row], q_rows[row, leg], leg)
            opening[row, leg] = math.hypot(*vector) - geometry.forearm_length
    return opening.reshape((*leading, LEGS))
