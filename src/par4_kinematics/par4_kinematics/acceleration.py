"""Second order kinematics: Xddot = J qddot + Jdot qdot, both ways and for whole logs.

The paper prints it, behind (24), without the dot of Jdot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_matching_rows, four, put_four, two
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.leg import bar_lever, closed_leg, curvature, joint_lever, plate_velocity
from par4_kinematics.linear_solve import combined, inverse_columns
from par4_kinematics.position import forward_kinematics, inverse_kinematics, turns_of


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


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def joint_speed(packed, reach, xd, cosine, sine, leg):
    """Return qd of one leg; reach of `closed_leg`, xd a tuple of four."""
    ab_x, ab_y, ab_z, cos_q, sin_q = reach
    v_x, v_y = plate_velocity(packed, xd[0], xd[1], xd[3], cosine, sine, leg)
    return (ab_x * v_x + ab_y * v_y + ab_z * xd[2]) / joint_lever(packed, ab_x, ab_y, ab_z, cos_q,
                                                                  sin_q, leg)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def bias(packed, reach, xd, qd, cosine, sine, leg):
    """Return b_i of J_x Xddot = J_q qddot + b of one leg; reach of `closed_leg`."""
    ab_x, ab_y, ab_z, cos_q, sin_q = reach
    v_x, v_y = plate_velocity(packed, xd[0], xd[1], xd[3], cosine, sine, leg)
    return curvature(packed, ab_x, ab_y, ab_z, v_x, v_y, xd[2], xd[3], qd, cos_q, sin_q, cosine,
                     sine, leg)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def joint_acceleration(packed, reach, xd, xdd, qd, cosine, sine, leg):
    """Return qdd of one leg; reach of `closed_leg`, xd and xdd tuples of four."""
    ab_x, ab_y, ab_z, cos_q, sin_q = reach
    # what multiplies velocities in J_x Xdot multiplies accelerations in J_x Xddot
    a_x, a_y = plate_velocity(packed, xdd[0], xdd[1], xdd[3], cosine, sine, leg)
    return (ab_x * a_x + ab_y * a_y + ab_z * xdd[2]
            - bias(packed, reach, xd, qd, cosine, sine, leg)) / joint_lever(
                packed, ab_x, ab_y, ab_z, cos_q, sin_q, leg)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _pull(packed, reach, rate, leg):
    """Return j_q times a rate of one joint."""
    return rate * joint_lever(packed, reach[0], reach[1], reach[2], reach[3], reach[4], leg)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def closed_legs(packed, x, y, z, cosine, sine):
    """Return `closed_leg` of all legs and the columns of J_x^-1 at D."""
    reach_0 = closed_leg(packed, x, y, z, cosine, sine, 0)
    reach_1 = closed_leg(packed, x, y, z, cosine, sine, 1)
    reach_2 = closed_leg(packed, x, y, z, cosine, sine, 2)
    reach_3 = closed_leg(packed, x, y, z, cosine, sine, 3)
    return (reach_0, reach_1, reach_2, reach_3), inverse_columns(
        reach_0, reach_1, reach_2, reach_3,
        -bar_lever(packed, reach_0[0], reach_0[1], cosine, sine),
        -bar_lever(packed, reach_1[0], reach_1[1], cosine, sine))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def joint_speeds(packed, reaches, xd, cosine, sine):
    """Return qd, a tuple of four, of the platform's xd; reaches of `closed_legs`."""
    return (joint_speed(packed, reaches[0], xd, cosine, sine, 0),
            joint_speed(packed, reaches[1], xd, cosine, sine, 1),
            joint_speed(packed, reaches[2], xd, cosine, sine, 2),
            joint_speed(packed, reaches[3], xd, cosine, sine, 3))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def joint_accelerations(packed, reaches, xd, xdd, qd, cosine, sine):
    """Return qdd, a tuple of four, of the platform's xd and xdd; reaches of `closed_legs`."""
    return (joint_acceleration(packed, reaches[0], xd, xdd, qd[0], cosine, sine, 0),
            joint_acceleration(packed, reaches[1], xd, xdd, qd[1], cosine, sine, 1),
            joint_acceleration(packed, reaches[2], xd, xdd, qd[2], cosine, sine, 2),
            joint_acceleration(packed, reaches[3], xd, xdd, qd[3], cosine, sine, 3))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def platform_speed(packed, reaches, inverse, qd):
    """Return xd, a tuple of four, of the joints' qd; reaches and inverse of `closed_legs`."""
    return combined(inverse, _pull(packed, reaches[0], qd[0], 0),
                    _pull(packed, reaches[1], qd[1], 1), _pull(packed, reaches[2], qd[2], 2),
                    _pull(packed, reaches[3], qd[3], 3))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def platform_acceleration(packed, reaches, inverse, xd, qd, qdd, cosine, sine):
    """Return xdd, a tuple of four, of xd and the joints' qd and qdd; see `platform_speed`."""
    return combined(inverse,
                    _pull(packed, reaches[0], qdd[0], 0)
                    + bias(packed, reaches[0], xd, qd[0], cosine, sine, 0),
                    _pull(packed, reaches[1], qdd[1], 1)
                    + bias(packed, reaches[1], xd, qd[1], cosine, sine, 1),
                    _pull(packed, reaches[2], qdd[2], 2)
                    + bias(packed, reaches[2], xd, qd[2], cosine, sine, 2),
                    _pull(packed, reaches[3], qdd[3], 3)
                    + bias(packed, reaches[3], xd, qd[3], cosine, sine, 3))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def joint_rates(packed, x, xd, xdd, cosine, sine):
    """Return qd and qdd of one sample, tuples of four like x, xd, xdd; cosine, sine of theta."""
    reaches, _ = closed_legs(packed, x[0], x[1], x[2], cosine, sine)
    qd = joint_speeds(packed, reaches, xd, cosine, sine)
    return qd, joint_accelerations(packed, reaches, xd, xdd, qd, cosine, sine)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def platform_rates(packed, x, qd, qdd, cosine, sine):
    """Return xd and xdd of one sample, tuples of four like x, qd, qdd; cosine, sine of theta."""
    reaches, inverse = closed_legs(packed, x[0], x[1], x[2], cosine, sine)
    xd = platform_speed(packed, reaches, inverse, qd)
    return xd, platform_acceleration(packed, reaches, inverse, xd, qd, qdd, cosine, sine)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _joint_rate_rows(packed, x, xd, xdd, turns, qd, qdd):
    for row in range(x.shape[0]):
        cosine, sine = two(turns, row)
        speeds, changes = joint_rates(packed, four(x, row), four(xd, row), four(xdd, row), cosine,
                                      sine)
        put_four(qd, row, speeds)
        put_four(qdd, row, changes)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _platform_rate_rows(packed, x, turns, qd, qdd, xd, xdd):
    for row in range(x.shape[0]):
        cosine, sine = two(turns, row)
        speed, change = platform_rates(packed, four(x, row), four(qd, row), four(qdd, row), cosine,
                                       sine)
        put_four(xd, row, speed)
        put_four(xdd, row, change)


def joint_motion(geometry: Geometry, x: ArrayLike, xd: ArrayLike, xdd: ArrayLike) -> JointMotion:
    """Return the joint motion of a platform motion (..., 4).

    Raises:
        UnreachableError: a pose that a leg cannot reach.
        InputError: shapes that do not match or values that are not finite.
    """
    (x_rows, xd_rows, xdd_rows), leading = as_matching_rows({'x': x, 'xd': xd, 'xdd': xdd})
    q = inverse_kinematics(geometry, x_rows)
    qd, qdd = np.empty_like(q), np.empty_like(q)
    turns = turns_of(x_rows)
    _joint_rate_rows(geometry.packed, x_rows, xd_rows, xdd_rows, turns, qd, qdd)
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
    shape = (*leading, LEGS)
    rows = platform_motion_at(geometry, forward_kinematics(geometry, q_rows), qd_rows, qdd_rows)
    return PlatformMotion(rows.x.reshape(shape), rows.xd.reshape(shape), rows.xdd.reshape(shape))


def platform_motion_at(geometry: Geometry, x: np.ndarray, qd: np.ndarray, qdd: np.ndarray,
                       turns: np.ndarray | None = None) -> PlatformMotion:
    """Return the platform motion at known poses x (n, 4) for joint rates (n, 4).

    `turns` is `turns_of(x)` where it is known.
    """
    xd, xdd = np.empty_like(x), np.empty_like(x)
    _platform_rate_rows(geometry.packed, x, turns_of(x) if turns is None else turns, qd, qdd, xd,
                        xdd)
    return PlatformMotion(x, xd, xdd)


def half_plate_accelerations(geometry: Geometry, x: np.ndarray, xd: np.ndarray, xdd: np.ndarray
                             ) -> np.ndarray:
    """Return the accelerations of D and, by (15), of D', (2, n, 3), m/s2, of a motion (n, 4)."""
    theta, thetad, thetadd = x[:, 3], xd[:, 3], xdd[:, 3]
    sine, cosine = np.sin(theta), np.cos(theta)
    relative = geometry.platform_bar_length * np.column_stack((
        sine * thetad ** 2 - cosine * thetadd, -cosine * thetad ** 2 - sine * thetadd,
        np.zeros_like(theta)))
    return np.stack((xdd[:, :3], xdd[:, :3] + relative))
