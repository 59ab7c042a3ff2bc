"""Torque columns of the rigid bodies at unit parameters: (20) and what it leaves out.

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

import numba
import numpy as np

from par4_dynamics.state import GRAVITY, State
from par4_kinematics.linear_solve import solve_in_place
from par4_kinematics.velocity import AT_D, arm_tangent, jacobians_sample

COLUMNS = ('actuator_inertia', 'platform_mass_1', 'platform_mass_2', 'arm_gravity',
           'rod_mass', 'bar_mass', 'theta_inertia')
"""Parameter of each column of `rigid_body_columns`."""


@numba.njit(cache=True, error_model='numpy')
def columns_sample(packed, gravity, x, xd, xdd, q, qd, qdd, j_x, j_q, scratch, forces, columns):
    """Write the columns (4, 7) of one sample at unit parameters, N m per unit.

    j_x (4, 4) and j_q (4,) belong to D at this pose; scratch (4, 4) and forces (4, 5) are
    workspace.
    """
    bar = packed[3]
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    # acceleration of D' relative to D (15)
    rel_x = bar * (sine * xd[3] * xd[3] - cosine * xdd[3])
    rel_y = bar * (-cosine * xd[3] * xd[3] - sine * xdd[3])
    forces[:] = 0.0
    forces[0, 0], forces[1, 0], forces[2, 0] = xdd[0], xdd[1], xdd[2] + gravity
    f_x, f_y = xdd[0] + rel_x, xdd[1] + rel_y
    forces[0, 1], forces[1, 1], forces[2, 1] = f_x, f_y, xdd[2] + gravity
    forces[3, 1] = -bar * (cosine * f_x + sine * f_y)
    forces[3, 3] = bar / 3.0 * (cosine * rel_x + sine * rel_y)
    forces[3, 4] = xdd[3]
    for leg in range(4):
        cos_azimuth, sin_azimuth = packed[4 + 4 * leg], packed[5 + 4 * leg]
        t_x, t_y, t_z = arm_tangent(packed, q[leg], leg)
        inward = -packed[0] * math.cos(q[leg]) * qd[leg] * qd[leg]
        d_x = xdd[0] - t_x * qdd[leg] - inward * cos_azimuth
        d_y = xdd[1] - t_y * qdd[leg] - inward * sin_azimuth
        d_z = xdd[2] - t_z * qdd[leg] - packed[0] * math.sin(q[leg]) * qd[leg] * qd[leg]
        if leg < 2:
            d_x += rel_x
            d_y += rel_y
            forces[3, 2] += bar / 3.0 * (cosine * d_x + sine * d_y)
        forces[0, 2] -= d_x / 3.0
        forces[1, 2] -= d_y / 3.0
        forces[2, 2] -= d_z / 3.0
        columns[leg, 0] = qdd[leg]
        columns[leg, 3] = -math.cos(q[leg]) * gravity / GRAVITY
        columns[leg, 4] = (d_x * t_x + d_y * t_y + d_z * t_z) / 3.0
    for i in range(4):
        for j in range(4):
            scratch[i, j] = j_x[j, i]
    solve_in_place(scratch, forces)
    for leg in range(4):
        columns[leg, 1] = j_q[leg] * forces[leg, 0]
        columns[leg, 2] = j_q[leg] * forces[leg, 1]
        columns[leg, 4] += j_q[leg] * forces[leg, 2]
        columns[leg, 5] = j_q[leg] * forces[leg, 3]
        columns[leg, 6] = j_q[leg] * forces[leg, 4]


@numba.njit(cache=True, error_model='numpy')
def _columns_rows(packed, gravity, x, xd, xdd, q, qd, qdd, columns):
    j_x, scratch, j_q = np.empty((4, 4)), np.empty((4, 4)), np.empty(4)
    forces = np.empty((4, 5))
    for row in range(x.shape[0]):
        jacobians_sample(packed, x[row], q[row], AT_D, j_x, j_q)
        columns_sample(packed, gravity, x[row], xd[row], xdd[row], q[row], qd[row], qdd[row],
                       j_x, j_q, scratch, forces, columns[row])


def rigid_body_columns(state: State) -> np.ndarray:
    """Return the torque (n, 4, 7) of each of `COLUMNS` at one unit of its parameter.

    Units: N m per kg m2, kg, kg, N m, kg, kg, kg m2.
    """
    columns = np.empty((*state.q.shape, len(COLUMNS)))
    _columns_rows(state.geometry.packed, GRAVITY, state.x, state.xd, state.xdd, state.q, state.qd,
                  state.qdd, columns)
    return columns
