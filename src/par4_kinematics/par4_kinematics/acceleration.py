"""Second order kinematics: Xddot = J qddot + Jdot qdot, both ways and for whole logs.

The dots of this relation and of (15) are missing in the paper's print.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_matching_rows
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.leg import curvature, plate_velocity
from par4_kinematics.linear_solve import solve_in_place
from par4_kinematics.position import forward_kinematics, inverse_kinematics
from par4_kinematics.velocity import AT_D, jacobians_sample


@dataclass(frozen=True)
class JointMotion:
    """Joint positions, velocities, accelerations (..., 4); rad, rad/s, rad/s2."""

    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray


@dataclass(frozen=True)
class PlatformMotion:
    """Pose, velocity, acceleration (..., 4) of D and theta; m, rad and their time derivatives."""

    x: np.ndarray
    xd: np.ndarray
    xdd: np.ndarray


@numba.njit(cache=True, error_model='numpy')
def _curvatures(packed, x, xd, q, qd, j_x, result):
    """Write b (4,) of J_x Xddot = J_q qddot + b; the first columns of j_x (4, 4) are A_iB_i."""
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    for leg in range(4):
        v_x, v_y = plate_velocity(packed, xd[0], xd[1], xd[3], cosine, sine, leg)
        result[leg] = curvature(packed, j_x[leg, 0], j_x[leg, 1], j_x[leg, 2], v_x, v_y, xd[2],
                                xd[3], qd[leg], math.cos(q[leg]), math.sin(q[leg]), cosine, sine,
                                leg)


@numba.njit(cache=True, error_model='numpy')
def _to_joint_rows(packed, x, xd, xdd, q, qd, qdd):
    j_x, j_q, b = np.empty((4, 4)), np.empty(4), np.empty(4)
    for row in range(x.shape[0]):
        jacobians_sample(packed, x[row], q[row], AT_D, j_x, j_q)
        for leg in range(4):
            total = 0.0
            for axis in range(4):
                total += j_x[leg, axis] * xd[row, axis]
            qd[row, leg] = total / j_q[leg]
        _curvatures(packed, x[row], xd[row], q[row], qd[row], j_x, b)
        for leg in range(4):
            total = -b[leg]
            for axis in range(4):
                total += j_x[leg, axis] * xdd[row, axis]
            qdd[row, leg] = total / j_q[leg]


@numba.njit(cache=True, error_model='numpy')
def _to_platform_rows(packed, q, qd, qdd, x, xd, xdd):
    j_x, matrix = np.empty((4, 4)), np.empty((4, 4))
    j_q, b = np.empty(4), np.empty(4)
    column = np.empty((4, 1))
    for row in range(q.shape[0]):
        jacobians_sample(packed, x[row], q[row], AT_D, j_x, j_q)
        matrix[:] = j_x
        for leg in range(4):
            column[leg, 0] = j_q[leg] * qd[row, leg]
        solve_in_place(matrix, column)
        xd[row] = column[:, 0]
        _curvatures(packed, x[row], xd[row], q[row], qd[row], j_x, b)
        matrix[:] = j_x
        for leg in range(4):
            column[leg, 0] = j_q[leg] * qdd[row, leg] + b[leg]
        solve_in_place(matrix, column)
        xdd[row] = column[:, 0]


def joint_motion(geometry: Geometry, x: ArrayLike, xd: ArrayLike, xdd: ArrayLike) -> JointMotion:
    """Return the joint motion of a platform motion (..., 4).

    Raises:
        UnreachableError: a pose that a leg cannot reach.
        InputError: shapes that do not match or values that are not finite.
    """
    (x_rows, xd_rows, xdd_rows), leading = as_matching_rows({'x': x, 'xd': xd, 'xdd': xdd})
    q = inverse_kinematics(geometry, x_rows)
    qd, qdd = np.empty_like(q), np.empty_like(q)
    _to_joint_rows(geometry.packed, x_rows, xd_rows, xdd_rows, q, qd, qdd)
    shape = (*leading, LEGS)
    return JointMotion(q.reshape(shape), qd.reshape(shape), qdd.reshape(shape))


def platform_motion(geometry: Geometry, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike
                    ) -> PlatformMotion:
    """Return the platform motion of a joint motion (..., 4); rows are solved in order.

    Raises:
        UnreachableError: joint positions with which the mechanism does not close.
        InputError: shapes that do not match or values that are not finite.
    """
    (q_rows, qd_rows, qdd_rows), leading = as_matching_rows({'q': q, 'qd': qd, 'qdd': qdd})
    x = forward_kinematics(geometry, q_rows)
    xd, xdd = np.empty_like(x), np.empty_like(x)
    _to_platform_rows(geometry.packed, q_rows, qd_rows, qdd_rows, x, xd, xdd)
    shape = (*leading, LEGS)
    return PlatformMotion(x.reshape(shape), xd.reshape(shape), xdd.reshape(shape))
