"""Torque of the mechanism at unit parameters, by column: (20) and what it leaves out.

Generalised forces of the platform are (force on D, moment about theta); a force f on D' is
(f, -h (cos theta f_x + sin theta f_y)), so that J_1^T of it equals J_2^T f of (17). Accelerations
carry gravity: a + g z.

The last three columns are the difference between the true mechanism and (20), exactly: a uniform
slender rod with end accelerations a_A, a_B loads its ends with m/6 (2 a_A + a_B) and
m/6 (a_A + 2 a_B); minus the half masses of (20) that is, for the two rods of a forearm,
m_5/3 (a_B - a_A) at A and its opposite at B; likewise for the two bars between D and D'.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.direction import mean_sign
from par4_dynamics.state import GRAVITY, State
from par4_kinematics.acceleration import closed_legs, joint_rates, platform_rates
from par4_kinematics.arrays import four, put_four, two
from par4_kinematics.geometry import ARM, HOME, LEGS
from par4_kinematics.leg import joint_lever, tangent
from par4_kinematics.linear_solve import dot
from par4_kinematics.position import forward_sample

COLUMNS = ('actuator_inertia', 'platform_mass_1', 'platform_mass_2', 'arm_gravity',
           'coulomb_friction', 'viscous_friction', 'rod_mass', 'bar_mass', 'theta_inertia')
"""Parameter of each column: those of (20) in the order of (23), then what (20) leaves out."""
NO_BENDS = (0.0, 0.0, 0.0, 0.0)
"""Of joints whose speeds are those of the instants."""


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _stretch(packed, reach, b_x, b_y, b_z, qd, qdd, leg):
    """Return the acceleration of B_i less that of A_i, b being that of B_i, m/s2."""
    t_x, t_y, t_z = tangent(packed, reach[3], reach[4], leg)
    inward = packed[ARM + leg] * qd * qd
    radial = inward * reach[3]
    return (b_x - t_x * qdd + radial * packed[4 + 4 * leg],
            b_y - t_y * qdd + radial * packed[5 + 4 * leg],
            b_z - t_z * qdd - inward * reach[4])


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _leg_columns(packed, reach, column, loads, stretch, qd, qdd, period, bend, leg):
    """Return the nine `COLUMNS` of one joint, N m per unit.

    Args:
        packed: of the geometry.
        reach: of `closed_leg`.
        column: what one unit of this loop's opening moves, a column of J_x^-1.
        loads: generalised forces on the platform of both masses, the rods, the bars and of
            theta's inertia: what is not zero of them.
        stretch: of `_stretch`.
        qd, qdd: of this joint.
        period: of the samples, s.
        bend: of this joint's speed where it turns, rad/s.
        leg: its number.
    """
    mass_1, mass_2, moment_2, rods, moment_rods, moment_bars, moment_theta = loads
    lever = joint_lever(packed, reach[0], reach[1], reach[2], reach[3], reach[4], leg)
    return (qdd, lever * dot(column, mass_1),
            lever * (dot(column, mass_2) + column[3] * moment_2), -reach[3],
            mean_sign(qd, qdd, period, bend), qd,
            lever * (dot(column, rods) + column[3] * moment_rods)
            + dot(stretch, tangent(packed, reach[3], reach[4], leg)) / 3.0,
            lever * column[3] * moment_bars, lever * column[3] * moment_theta)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def columns_sample(packed, x, rate, xdd, qd, qdd, period, bends, cosine, sine):
    """Return for each joint its nine `COLUMNS` of one sample, N m per unit.

    Args:
        packed: of the geometry.
        x: pose, a tuple of four like xdd, qd, qdd.
        rate: thetad.
        xdd: acceleration of D and thetadd.
        qd, qdd: of the joints.
        period: of the samples, s; zero: an instant.
        bends: of the joints' speeds where they turn, rad/s, a tuple of four.
        cosine, sine: of theta.
    """
    bar = packed[3]
    # acceleration of D' relative to D (15)
    r_x = bar * (sine * rate * rate - cosine * xdd[3])
    r_y = bar * (-cosine * rate * rate - sine * xdd[3])
    a_x, a_y, a_z = xdd[0], xdd[1], xdd[2]
    reaches, inverse = closed_legs(packed, x[0], x[1], x[2], cosine, sine)
    stretch_0 = _stretch(packed, reaches[0], a_x + r_x, a_y + r_y, a_z, qd[0], qdd[0], 0)
    stretch_1 = _stretch(packed, reaches[1], a_x + r_x, a_y + r_y, a_z, qd[1], qdd[1], 1)
    stretch_2 = _stretch(packed, reaches[2], a_x, a_y, a_z, qd[2], qdd[2], 2)
    stretch_3 = _stretch(packed, reaches[3], a_x, a_y, a_z, qd[3], qdd[3], 3)
    # of the rods at D', then of all
    s_x, s_y = stretch_0[0] + stretch_1[0], stretch_0[1] + stretch_1[1]
    rods = (-(s_x + stretch_2[0] + stretch_3[0]) / 3.0, -(s_y + stretch_2[1] + stretch_3[1]) / 3.0,
            -(stretch_0[2] + stretch_1[2] + stretch_2[2] + stretch_3[2]) / 3.0)
    loads = ((a_x, a_y, a_z + GRAVITY), (a_x + r_x, a_y + r_y, a_z + GRAVITY),
             -bar * (cosine * (a_x + r_x) + sine * (a_y + r_y)), rods,
             bar / 3.0 * (cosine * s_x + sine * s_y), bar / 3.0 * (cosine * r_x + sine * r_y),
             xdd[3])
    return (_leg_columns(packed, reaches[0], inverse[0], loads, stretch_0, qd[0], qdd[0],
                         period, bends[0], 0),
            _leg_columns(packed, reaches[1], inverse[1], loads, stretch_1, qd[1], qdd[1],
                         period, bends[1], 1),
            _leg_columns(packed, reaches[2], inverse[2], loads, stretch_2, qd[2], qdd[2],
                         period, bends[2], 2),
            _leg_columns(packed, reaches[3], inverse[3], loads, stretch_3, qd[3], qdd[3],
                         period, bends[3], 3))


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _weighted(columns, table, leg):
    """Return the nine columns of a joint times its values, table[9 * leg : 9 * leg + 9]."""
    return (columns[0] * table[9 * leg] + columns[1] * table[9 * leg + 1]
            + columns[2] * table[9 * leg + 2] + columns[3] * table[9 * leg + 3]
            + columns[4] * table[9 * leg + 4] + columns[5] * table[9 * leg + 5]
            + columns[6] * table[9 * leg + 6] + columns[7] * table[9 * leg + 7]
            + columns[8] * table[9 * leg + 8])


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def _torque_sample(packed, table, x, rate, xdd, qd, qdd, period, bends, cosine, sine):
    """Return the four torques, N m, of one sample; table of `value_table`."""
    joints = columns_sample(packed, x, rate, xdd, qd, qdd, period, bends, cosine, sine)
    return (_weighted(joints[0], table, 0), _weighted(joints[1], table, 1),
            _weighted(joints[2], table, 2), _weighted(joints[3], table, 3))


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _torque_rows(packed, table, x, xd, xdd, turns, qd, qdd, period, bends, torque):
    for row in range(x.shape[0]):
        cosine, sine = two(turns, row)
        put_four(torque, row, _torque_sample(
            packed, table, four(x, row), four(xd, row)[3], four(xdd, row), four(qd, row),
            four(qdd, row), period, bends, cosine, sine))


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _column_rows(packed, x, xd, xdd, turns, qd, qdd, period, bends, columns):
    for row in range(x.shape[0]):
        cosine, sine = two(turns, row)
        joints = columns_sample(packed, four(x, row), four(xd, row)[3], four(xdd, row),
                                four(qd, row), four(qdd, row), period, bends, cosine, sine)
        for leg in range(4):
            for column in range(columns.shape[2]):
                columns[row, leg, column] = joints[leg][column]


@numba.njit(cache=True, error_model='numpy', nogil=True)
def torque_of_platform_sample(packed, table, motion, torque):
    """Write the torques (4,) of one sample; return whether they are finite.

    Args:
        packed: of the geometry.
        table: of `value_table`.
        motion: x, xd, xdd, (3, 4); what is not finite or not reachable makes torques that are
            not finite.
        torque: written.
    """
    x, xd, xdd = four(motion, 0), four(motion, 1), four(motion, 2)
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    qd, qdd = joint_rates(packed, x, xd, xdd, cosine, sine)
    result = _torque_sample(packed, table, x, xd[3], xdd, qd, qdd, 0.0, NO_BENDS, cosine, sine)
    torque[0], torque[1], torque[2], torque[3] = result
    return math.isfinite(result[0] + result[1] + result[2] + result[3])


@numba.njit(cache=True, error_model='numpy', nogil=True)
def torque_of_joints_sample(packed, table, motion, torque):
    """Do as `torque_of_platform_sample` with motion = q, qd, qdd, (3, 4)."""
    q, qd, qdd = four(motion, 0), four(motion, 1), four(motion, 2)
    directions, x = np.empty((2, 4)), np.empty((1, 4))
    for leg in range(4):
        directions[0, leg], directions[1, leg] = math.cos(q[leg]), math.sin(q[leg])
        x[0, leg] = HOME[leg]
    if forward_sample(packed, directions[:1], directions[1:], 0, x) < 0:
        return False
    pose = four(x, 0)
    cosine, sine = math.cos(pose[3]), math.sin(pose[3])
    xd, xdd = platform_rates(packed, pose, qd, qdd, cosine, sine)
    result = _torque_sample(packed, table, pose, xd[3], xdd, qd, qdd, 0.0, NO_BENDS, cosine, sine)
    torque[0], torque[1], torque[2], torque[3] = result
    return math.isfinite(result[0] + result[1] + result[2] + result[3])


def value_table(values: Mapping[str, ArrayLike]) -> np.ndarray:
    """Return (36,): for each joint the values of `COLUMNS`, as the kernels take them.

    Args:
        values: parameter -> one number or four; those that are not named are zero.
    """
    table = np.zeros((LEGS, len(COLUMNS)))
    for name, value in values.items():
        table[:, COLUMNS.index(name)] = value
    return table.reshape(-1)


def rigid_body_torque(state: State, table: np.ndarray) -> np.ndarray:
    """Return the torque (n, 4), N m, that the parameters make; table of `value_table`."""
    x, xd, xdd, qd, qdd = _motion(state)
    torque = np.empty_like(x)
    _torque_rows(state.platform.geometry.packed, table, x, xd, xdd, state.turns, qd, qdd,
                 state.period, state.bends, torque)
    return torque


def rigid_body_columns(state: State, count: int = len(COLUMNS)) -> np.ndarray:
    """Return the torque (n, 4, count) of each of the first `COLUMNS` at one unit of its parameter.

    Units: N m per kg m2, kg, kg, N m, N m, N m s/rad, kg, kg, kg m2.
    """
    x, xd, xdd, qd, qdd = _motion(state)
    columns = np.empty((len(x), LEGS, count))
    _column_rows(state.platform.geometry.packed, x, xd, xdd, state.turns, qd, qdd, state.period,
                 state.bends, columns)
    return columns


def _motion(state: State) -> list[np.ndarray]:
    return [np.ascontiguousarray(part, dtype=float)
            for part in (*state.platform[1:], state.qd, state.qdd)]
