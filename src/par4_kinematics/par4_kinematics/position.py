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

from par4_kinematics.arrays import as_matching_rows, as_rows, four, put_four, two
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import FOREARM, HOME, LEGS, POSE_NAMES, Geometry
from par4_kinematics.leg import (
    arm_direction,
    bar_lever,
    closed_leg,
    forearm_vector,
    plate_joint,
)
from par4_kinematics.linear_solve import combined, dot, inverse_columns
from par4_kinematics.reach import unreached_legs

CONVERGED = 1e-12
"""Loop opening (m) at which Newton's iteration stops."""
MAX_ITERATIONS = 30
SAME_ARM = 1e-6
"""Difference of an arm's direction (rad) up to which a closed pose is in the assembly mode."""


@numba.njit(cache=True, error_model='numpy', nogil=True)
def forearm(packed, x, angle, leg):
    """Return the vector A_i B_i of one leg in `base`, m."""
    return forearm_of(packed, x[0], x[1], x[2], math.cos(x[3]), math.sin(x[3]), math.cos(angle),
                      math.sin(angle), leg)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def forearm_of(packed, x, y, z, cosine, sine, cos_q, sin_q, leg):
    """Return the vector A_i B_i of one leg in `base`, m; cosine and sine of theta."""
    along, across, up = plate_joint(packed, x, y, z, cosine, sine, leg)
    return forearm_vector(packed, along, across, up, cos_q, sin_q, leg)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def inverse_sample(packed, x, q):
    """Write the joint positions of one pose to q (4,); return -1, or the leg that cannot reach."""
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    for leg in range(4):
        along, across, up = plate_joint(packed, x[0], x[1], x[2], cosine, sine, leg)
        reached, cos_q, sin_q = arm_direction(packed, along, across, up, leg)
        if not reached:
            return leg
        q[leg] = math.atan2(sin_q, cos_q)
    return -1


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _opening(packed, ab, leg):
    """Return (|A_i B_i|^2 - l_i^2) / 2, m2: near enough l_i times what the loop is open."""
    return 0.5 * (dot(ab, ab) - packed[FOREARM + leg] * packed[FOREARM + leg])


@numba.njit(cache=True, error_model='numpy', nogil=True)
def forward_sample(packed, cosines, sines, row, x):
    """Improve the pose x[row] until it closes the loops of one sample; return the iterations.

    Newton's iteration on (|A_i B_i|^2 - l^2) / 2. Returns -1 if it does not converge to the
    assembly mode in which the elbows point outward and the platform hangs below them.

    Args:
        packed: of the geometry.
        cosines, sines: of the joint positions, (n, 4).
        row: which sample.
        x: poses (n, 4).
    """
    p_x, p_y, p_z, theta = x[row, 0], x[row, 1], x[row, 2], x[row, 3]
    cos_0, cos_1, cos_2, cos_3 = (cosines[row, 0], cosines[row, 1], cosines[row, 2],
                                  cosines[row, 3])
    sin_0, sin_1, sin_2, sin_3 = sines[row, 0], sines[row, 1], sines[row, 2], sines[row, 3]
    for iteration in range(MAX_ITERATIONS):
        cosine, sine = math.cos(theta), math.sin(theta)
        ab_0 = forearm_of(packed, p_x, p_y, p_z, cosine, sine, cos_0, sin_0, 0)
        ab_1 = forearm_of(packed, p_x, p_y, p_z, cosine, sine, cos_1, sin_1, 1)
        ab_2 = forearm_of(packed, p_x, p_y, p_z, cosine, sine, cos_2, sin_2, 2)
        ab_3 = forearm_of(packed, p_x, p_y, p_z, cosine, sine, cos_3, sin_3, 3)
        open_0, open_1 = _opening(packed, ab_0, 0), _opening(packed, ab_1, 1)
        open_2, open_3 = _opening(packed, ab_2, 2), _opening(packed, ab_3, 3)
        if max(abs(open_0), abs(open_1), abs(open_2), abs(open_3)) < CONVERGED * packed[1]:
            x[row, 0], x[row, 1], x[row, 2], x[row, 3] = p_x, p_y, p_z, theta
            if abs(theta) > 0.5 * math.pi:
                return -1
            for leg in range(4):
                _, _, _, cos_q, sin_q = closed_leg(packed, p_x, p_y, p_z, cosine, sine, leg)
                if not abs(cos_q - cosines[row, leg]) + abs(sin_q - sines[row, leg]) < SAME_ARM:
                    return -1
            return iteration
        inverse = inverse_columns(
            ab_0, ab_1, ab_2, ab_3, -bar_lever(packed, ab_0[0], ab_0[1], cosine, sine),
            -bar_lever(packed, ab_1[0], ab_1[1], cosine, sine))
        s_x, s_y, s_z, turn = combined(inverse, open_0, open_1, open_2, open_3)
        if not abs(s_x) + abs(s_y) + abs(s_z) + abs(turn) < math.inf:
            return -1
        longest = max(abs(s_x), abs(s_y), abs(s_z), 0.5 * packed[1] * abs(turn))
        scale = 1.0 if longest < 0.5 * packed[1] else 0.5 * packed[1] / longest
        p_x, p_y, p_z, theta = (p_x - scale * s_x, p_y - scale * s_y, p_z - scale * s_z,
                                theta - scale * turn)
    return -1


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _direction_rows(packed, x, turns, cosines, sines):
    for row in range(x.shape[0]):
        p_x, p_y, p_z, _ = four(x, row)
        cosine, sine = two(turns, row)
        _, _, _, cos_0, sin_0 = closed_leg(packed, p_x, p_y, p_z, cosine, sine, 0)
        _, _, _, cos_1, sin_1 = closed_leg(packed, p_x, p_y, p_z, cosine, sine, 1)
        _, _, _, cos_2, sin_2 = closed_leg(packed, p_x, p_y, p_z, cosine, sine, 2)
        _, _, _, cos_3, sin_3 = closed_leg(packed, p_x, p_y, p_z, cosine, sine, 3)
        put_four(cosines, row, (cos_0, cos_1, cos_2, cos_3))
        put_four(sines, row, (sin_0, sin_1, sin_2, sin_3))


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _forward_rows(packed, cosines, sines, start, home, x):
    for row in range(x.shape[0]):
        if row == 0:
            x[row] = start
        elif row == 1:
            x[row] = x[row - 1]
        else:  # constant velocity is a good guess within a log
            for axis in range(4):
                x[row, axis] = 2.0 * x[row - 1, axis] - x[row - 2, axis]
        if forward_sample(packed, cosines, sines, row, x) < 0:
            x[row] = home
            if forward_sample(packed, cosines, sines, row, x) < 0:
                return row
    return -1


def turns_of(x: np.ndarray) -> np.ndarray:
    """Return cos theta and sin theta (n, 2) of the poses x (n, 4)."""
    turns = np.empty((len(x), 2))
    np.cos(x[:, 3], out=turns[:, 0])
    np.sin(x[:, 3], out=turns[:, 1])
    return turns


def inverse_kinematics(geometry: Geometry, x: ArrayLike, turns: np.ndarray | None = None
                       ) -> np.ndarray:
    """Return the joint positions q (..., 4), rad, of the poses x (..., 4), m and rad.

    Args:
        geometry: dimensions of the robot.
        x: poses.
        turns: `turns_of` the rows of x where it is known.

    Raises:
        UnreachableError: a pose that a leg cannot reach; names sample, pose and legs.
        InputError: wrong shape or a value that is not finite.
    """
    rows, leading = as_rows(x, 'pose x')
    cosines, sines = np.empty_like(rows), np.empty_like(rows)
    _direction_rows(geometry.packed, rows, turns_of(rows) if turns is None else turns, cosines,
                    sines)
    q = np.arctan2(sines, cosines, out=cosines)
    lost = np.isnan(q)
    if lost.any():
        row = int(np.argmax(lost.any(axis=1)))
        pose = ', '.join(f'{name} {value:.4g}'
                         for name, value in zip(POSE_NAMES, rows[row], strict=True))
        raise UnreachableError(f'pose {row} ({pose}): {unreached_legs(geometry, rows[row])}; '
                               f'bring the pose into the workspace')
    return q.reshape((*leading, LEGS))


def forward_kinematics(geometry: Geometry, q: ArrayLike, start: ArrayLike = HOME) -> np.ndarray:
    """Return the poses x (..., 4), m and rad, of the joint positions q (..., 4), rad.

    Rows are solved in order, each from the solution of the rows before it, so that a log takes a
    few iterations a sample. A row that fails from there is tried again from the home pose.

    Args:
        geometry: dimensions of the robot.
        q: joint positions.
        start: pose near the first sample.

    Raises:
        UnreachableError: joint positions for which the mechanism does not close in this assembly
            mode.
        InputError: wrong shape or a value that is not finite.
    """
    rows, leading = as_rows(q, 'joint positions q')
    first, _ = as_rows(start, 'start pose')
    x = np.empty_like(rows)
    home = mid_height_home(geometry)
    row = _forward_rows(geometry.packed, np.cos(rows), np.sin(rows), first[0], home, x)
    if row >= 0:
        angles = ', '.join(f'{angle:.4g}' for angle in rows[row])
        raise UnreachableError(
            f'joint positions {row} ({angles}): the mechanism does not close with them in its '
            f'working assembly mode; check the order, sign and zero of the joints')
    return x.reshape((*leading, LEGS))


def closes(geometry: Geometry, q: ArrayLike) -> np.ndarray:
    """Return whether the mechanism closes with joint positions q (..., 4) in its working mode.

    Raises:
        InputError: wrong shape or a value that is not finite.
    """
    rows, leading = as_rows(q, 'joint positions q')
    x, closed = np.empty_like(rows), np.ones(len(rows), dtype=bool)
    home, cosines, sines = mid_height_home(geometry), np.cos(rows), np.sin(rows)
    begin = 0
    while begin < len(rows):
        # a row that does not close ends a pass; the next one begins behind it
        row = _forward_rows(geometry.packed, cosines[begin:], sines[begin:], home, home, x[begin:])
        if row < 0:
            break
        closed[begin + row] = False
        begin += row + 1
    return closed.reshape(leading)


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
            opening[row, leg] = math.hypot(*vector) - geometry.forearm_lengths[leg]
    return opening.reshape((*leading, LEGS))
