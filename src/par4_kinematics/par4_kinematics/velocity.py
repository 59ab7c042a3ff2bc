"""Jacobians: J_x Xdot = J_q qdot at D (3) and at D' (11), J = J_x^-1 J_q, and their rates.

Row i of J_x is (A_iB_i, c_i); c_i = -h (cos theta ABx + sin theta ABy) for legs 0, 1 at D and the
same with + for legs 2, 3 at D', 0 otherwise. J_q = diag(A_iB_i . dA_i/dq_i); the sign printed in
(4) and (12) is a misprint.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_matching_rows, as_rows, four
from par4_kinematics.geometry import ARM, LEGS, Geometry
from par4_kinematics.leg import bar_lever, joint_lever, tangent
from par4_kinematics.linear_solve import solve_in_place
from par4_kinematics.position import forearm, inverse_kinematics

AT_D = 0.0
AT_D2 = 1.0
"""Which point the translation of J_x belongs to: D of half plate 1, D' of half plate 2."""


@numba.njit(cache=True, error_model='numpy', nogil=True)
def arm_tangent(packed, angle, leg):
    """Return dA_i/dq_i of one leg in `base`, m/rad."""
    return tangent(packed, math.cos(angle), math.sin(angle), leg)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def jacobians_sample(packed, x, q, point, j_x, j_q):
    """Write J_x (4, 4) and the diagonal of J_q (4,) of one sample, at D or D'."""
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    for leg in range(4):
        ab_x, ab_y, ab_z = forearm(packed, x, q[leg], leg)
        lever = point - 1.0 if leg < 2 else point
        j_x[leg, 0], j_x[leg, 1], j_x[leg, 2] = ab_x, ab_y, ab_z
        j_x[leg, 3] = lever * bar_lever(packed, ab_x, ab_y, cosine, sine)
        j_q[leg] = joint_lever(packed, ab_x, ab_y, ab_z, math.cos(q[leg]), math.sin(q[leg]), leg)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def jacobian_rates_sample(packed, x, xd, q, qd, point, j_x_rate, j_q_rate):
    """Write the time derivatives of J_x (4, 4) and of the diagonal of J_q (4,); xd is of D."""
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    for leg in range(4):
        ab_x, ab_y, ab_z = forearm(packed, x, q[leg], leg)
        t_x, t_y, t_z = arm_tangent(packed, q[leg], leg)
        v_x, v_y, v_z = xd[0] - t_x * qd[leg], xd[1] - t_y * qd[leg], xd[2] - t_z * qd[leg]
        if leg < 2:
            v_x -= packed[3] * cosine * xd[3]
            v_y -= packed[3] * sine * xd[3]
        lever = point - 1.0 if leg < 2 else point
        j_x_rate[leg, 0], j_x_rate[leg, 1], j_x_rate[leg, 2] = v_x, v_y, v_z
        j_x_rate[leg, 3] = lever * packed[3] * (
            cosine * v_x + sine * v_y + xd[3] * (cosine * ab_y - sine * ab_x))
        # d2A/dq2 = A's radius vector reversed: -L (cos q e - sin q z)
        radial = -packed[ARM + leg] * math.cos(q[leg])
        n_x, n_y = radial * packed[4 + 4 * leg], radial * packed[5 + 4 * leg]
        n_z = packed[ARM + leg] * math.sin(q[leg])
        j_q_rate[leg] = (v_x * t_x + v_y * t_y + v_z * t_z
                         + qd[leg] * (ab_x * n_x + ab_y * n_y + ab_z * n_z))


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _part_rows(packed, x, q, point, j_x, j_q):
    for row in range(x.shape[0]):
        jacobians_sample(packed, x[row], q[row], point, j_x[row], j_q[row])


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _jacobian_rows(packed, x, q, point, jacobian):
    matrix, j_q = np.empty((4, 4)), np.empty(4)
    for row in range(x.shape[0]):
        jacobians_sample(packed, x[row], q[row], point, matrix, j_q)
        jacobian[row] = 0.0
        for leg in range(4):
            jacobian[row, leg, leg] = j_q[leg]
        solve_in_place(matrix, jacobian[row])


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _jacobian_rate_rows(packed, x, xd, q, qd, point, rate):
    j_x, j_x_rate, jacobian = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 4))
    matrix = np.empty((4, 4))
    j_q, j_q_rate = np.empty(4), np.empty(4)
    for row in range(x.shape[0]):
        jacobians_sample(packed, x[row], q[row], point, j_x, j_q)
        jacobian_rates_sample(packed, x[row], xd[row], q[row], qd[row], point, j_x_rate, j_q_rate)
        matrix[:] = j_x
        jacobian[:] = 0.0
        for leg in range(4):
            jacobian[leg, leg] = j_q[leg]
        solve_in_place(matrix, jacobian)
        for i in range(4):
            for j in range(4):
                total = 0.0
                for k in range(4):
                    total -= j_x_rate[i, k] * jacobian[k, j]
                rate[row, i, j] = total
            rate[row, i, i] += j_q_rate[i]
        matrix[:] = j_x
        solve_in_place(matrix, rate[row])


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _moved_rows(jacobian, rate, moved):
    for row in range(jacobian.shape[0]):
        q_0, q_1, q_2, q_3 = four(rate, row)
        for axis in range(4):  # added up as `einsum` does, two by two
            moved[row, axis] = ((jacobian[row, axis, 0] * q_0 + jacobian[row, axis, 2] * q_2)
                                + (jacobian[row, axis, 1] * q_1 + jacobian[row, axis, 3] * q_3))


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _carried_rows(jacobian, force, carried):
    for row in range(jacobian.shape[0]):
        f_0, f_1, f_2, f_3 = four(force, row)
        for joint in range(4):
            carried[row, joint] = (jacobian[row, 0, joint] * f_0 + jacobian[row, 1, joint] * f_1
                                   + jacobian[row, 2, joint] * f_2 + jacobian[row, 3, joint] * f_3)


def moved_by(jacobian: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Return J qd (n, 4): the platform's rate by those of the joints (n, 4); J is (n, 4, 4)."""
    moved = np.empty((len(jacobian), 4))
    _moved_rows(np.ascontiguousarray(jacobian), np.ascontiguousarray(qd), moved)
    return moved


def carried_by(jacobian: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Return J^T f (n, 4): the joint torques, N m, that carry forces f (n, 4) on the platform."""
    carried = np.empty((len(jacobian), 4))
    _carried_rows(np.ascontiguousarray(jacobian), np.array(force, order='C'), carried)
    return carried


def jacobian_parts(geometry: Geometry, x: ArrayLike, point: float = AT_D
                   ) -> tuple[np.ndarray, np.ndarray]:
    """Return J_x (..., 4, 4) of (3) or (11) and the diagonal of J_q (..., 4) at poses x."""
    rows, leading = as_rows(x, 'pose x')
    q = inverse_kinematics(geometry, rows)
    j_x, j_q = np.empty((len(rows), LEGS, LEGS)), np.empty_like(rows)
    _part_rows(geometry.packed, rows, q, point, j_x, j_q)
    return j_x.reshape((*leading, LEGS, LEGS)), j_q.reshape((*leading, LEGS))


def jacobian(geometry: Geometry, x: ArrayLike, point: float = AT_D) -> np.ndarray:
    """Return the Jacobian J (..., 4, 4) at poses x (..., 4), m and rad: point velocity = J qdot.

    It is J_1 (2) for the point D or, with point = AT_D2, J_2 (10) for D'. The first three rows are
    the velocity of the point in `base`, the fourth is thetadot. Singular poses (theta = 90 degrees)
    give infinities.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    rows, leading = as_rows(x, 'pose x')
    q = inverse_kinematics(geometry, rows)
    result = np.empty((len(rows), LEGS, LEGS))
    _jacobian_rows(geometry.packed, rows, q, point, result)
    return result.reshape((*leading, LEGS, LEGS))


def jacobian_rate(geometry: Geometry, x: ArrayLike, xd: ArrayLike, point: float = AT_D
                  ) -> np.ndarray:
    """Return dJ/dt (..., 4, 4) at poses x moving with xd = (velocity of D, thetadot).

    J-dot = J_x^-1 (J_q-dot - J_x-dot J), from differentiating J_x J = J_q.
    """
    (x_rows, xd_rows), leading = as_matching_rows({'pose x': x, 'velocity xd': xd})
    q = inverse_kinematics(geometry, x_rows)
    qd = joint_velocity(geometry, x_rows, xd_rows)
    rate = np.empty((len(x_rows), LEGS, LEGS))
    _jacobian_rate_rows(geometry.packed, x_rows, xd_rows, q, qd, point, rate)
    return rate.reshape((*leading, LEGS, LEGS))


def joint_velocity(geometry: Geometry, x: ArrayLike, xd: ArrayLike) -> np.ndarray:
    """Return qd (..., 4), rad/s, of poses x moving with xd (velocity of D, thetadot)."""
    j_x, j_q = jacobian_parts(geometry, x)
    return np.einsum('...ij,...j->...i', j_x, np.asarray(xd, dtype=float)) / j_q


def condition_number(geometry: Geometry, x: ArrayLike) -> np.ndarray:
    """Return the condition number (...,) of J_x (3) at poses x (..., 4), m and rad.

    The theta column is divided by h, so that all columns have one unit.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    j_x, _ = jacobian_parts(geometry, x)
    return np.linalg.cond(j_x / np.array((1.0, 1.0, 1.0, geometry.platform_bar_length)))
