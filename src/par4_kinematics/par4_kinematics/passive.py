"""The passive joints: how fast each turns, and the force of friction in them on the platform.

A forearm is two parallel rods with a ball at both ends; the half plates are joined by two bars
with a pivot at both ends. A rod, r = A_i B_i, turns with w = r x (v_B - v_A) / l^2: the smallest
angular velocity that its ends allow, without spin about itself. Its elbow ball turns with
w - qd_i a_i, a_i = z x e_i being the axis of the arm; its plate ball with w, for half plates only
translate; the pivots of the bars turn with thetad.

Friction with the moment m = coulomb w / |w| + viscous w in every joint takes the power
sum m . w. By virtual work the rods carry their moments as the force (m_A + m_B) x r / l^2 at B
and its opposite at A, m_A and m_B being those of elbow and plate ball.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_matching_rows, as_rows
from par4_kinematics.geometry import FOREARM, LEGS, Geometry
from par4_kinematics.position import forearm, inverse_kinematics
from par4_kinematics.velocity import arm_tangent, joint_velocity

GROUPS = 2 * LEGS + 1
"""Groups of passive joints that turn alike: elbows of legs 0..3, plate balls of legs 0..3, bars."""
BALLS_PER_GROUP = 2
"""A forearm has two rods."""
BAR_PIVOTS = 4
"""Two bars, a pivot at both ends."""


@numba.njit(cache=True, error_model='numpy', nogil=True)
def passive_rates_sample(packed, x, xd, q, qd, rates):
    """Write the relative angular velocity of each group, in `base`, to rates (9, 3), rad/s.

    Rows 0..3: rod relative to arm at the elbow of each leg; rows 4..7: rod relative to half plate;
    row 8: (0, 0, thetad).
    """
    for leg in range(4):
        square = packed[FOREARM + leg] * packed[FOREARM + leg]
        r_x, r_y, r_z = forearm(packed, x, q[leg], leg)
        t_x, t_y, t_z = arm_tangent(packed, q[leg], leg)
        v_x, v_y, v_z = xd[0] - t_x * qd[leg], xd[1] - t_y * qd[leg], xd[2] - t_z * qd[leg]
        if leg < 2:
            v_x -= packed[3] * math.cos(x[3]) * xd[3]
            v_y -= packed[3] * math.sin(x[3]) * xd[3]
        w_x = (r_y * v_z - r_z * v_y) / square
        w_y = (r_z * v_x - r_x * v_z) / square
        w_z = (r_x * v_y - r_y * v_x) / square
        rates[4 + leg, 0], rates[4 + leg, 1], rates[4 + leg, 2] = w_x, w_y, w_z
        rates[leg, 0] = w_x + packed[5 + 4 * leg] * qd[leg]
        rates[leg, 1] = w_y - packed[4 + 4 * leg] * qd[leg]
        rates[leg, 2] = w_z
    rates[8, 0], rates[8, 1], rates[8, 2] = 0.0, 0.0, xd[3]


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _moment_per_rate(rate, coulomb, viscous, slip_rate):
    """Return moment over angular velocity of one joint, N m s/rad."""
    speed = math.sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2])
    if speed == 0.0:
        return viscous  # the moment is zero whatever is returned
    share = math.tanh(speed / slip_rate) if slip_rate > 0.0 else 1.0
    return viscous + coulomb * share / speed


@numba.njit(cache=True, error_model='numpy', nogil=True)
def passive_force_sample(packed, x, q, rates, coulomb, viscous, slip_rate, force):
    """Write what it takes to turn the passive joints to force (4,): N on D, N m about theta.

    The force on X = (x, y, z, theta) that overcomes the friction; the joints act on the mechanism
    with its opposite. force . xd is the power that friction takes.

    Args:
        packed, x, q: Geometry.packed, pose (4,), joint positions (4,).
        rates: (9, 3) of `passive_rates_sample`.
        coulomb, viscous: of one ball or pivot, N m and N m s/rad.
        slip_rate: Coulomb friction acts with tanh(|w| / slip_rate), rad/s; 0 for a sharp sign.
        force: (4,), written.
    """
    force[0], force[1], force[2] = 0.0, 0.0, 0.0
    force[3] = BAR_PIVOTS * _moment_per_rate(rates[8], coulomb, viscous, slip_rate) * rates[8, 2]
    for leg in range(4):
        square = packed[FOREARM + leg] * packed[FOREARM + leg]
        elbow = BALLS_PER_GROUP * _moment_per_rate(rates[leg], coulomb, viscous, slip_rate)
        plate = BALLS_PER_GROUP * _moment_per_rate(rates[4 + leg], coulomb, viscous, slip_rate)
        m_x = elbow * rates[leg, 0] + plate * rates[4 + leg, 0]
        m_y = elbow * rates[leg, 1] + plate * rates[4 + leg, 1]
        m_z = elbow * rates[leg, 2] + plate * rates[4 + leg, 2]
        r_x, r_y, r_z = forearm(packed, x, q[leg], leg)
        t_x, t_y, t_z = arm_tangent(packed, q[leg], leg)
        f_x = (m_y * r_z - m_z * r_y) / square
        f_y = (m_z * r_x - m_x * r_z) / square
        f_z = (m_x * r_y - m_y * r_x) / square
        # at the arm: the opposite force at A and the elbow's moment about the arm's axis
        turning = packed[5 + 4 * leg] * rates[leg, 0] - packed[4 + 4 * leg] * rates[leg, 1]
        torque = elbow * turning - f_x * t_x - f_y * t_y - f_z * t_z
        # qd = (r . v_B) / (r . dA/dq): along the rod its ends move alike
        along = torque / (r_x * t_x + r_y * t_y + r_z * t_z)
        f_x, f_y, f_z = f_x + along * r_x, f_y + along * r_y, f_z + along * r_z
        force[0] += f_x
        force[1] += f_y
        force[2] += f_z
        if leg < 2:
            force[3] -= packed[3] * (math.cos(x[3]) * f_x + math.sin(x[3]) * f_y)


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _rates_rows(packed, x, xd, q, qd, rates):
    for row in range(x.shape[0]):
        passive_rates_sample(packed, x[row], xd[row], q[row], qd[row], rates[row])


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _force_rows(packed, x, q, rates, coulomb, viscous, slip_rate, force):
    for row in range(x.shape[0]):
        passive_force_sample(packed, x[row], q[row], rates[row], coulomb, viscous, slip_rate,
                             force[row])


def passive_rates(geometry: Geometry, x: ArrayLike, xd: ArrayLike) -> np.ndarray:
    """Return the relative angular velocities (..., 9, 3), rad/s, of poses x moving with xd.

    Groups in the order of `GROUPS`, vectors in `base`.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    (x_rows, xd_rows), leading = as_matching_rows({'pose x': x, 'velocity xd': xd})
    q = inverse_kinematics(geometry, x_rows)
    qd = joint_velocity(geometry, x_rows, xd_rows)
    rates = np.empty((len(x_rows), GROUPS, 3))
    _rates_rows(geometry.packed, x_rows, xd_rows, q, qd, rates)
    return rates.reshape((*leading, GROUPS, 3))


def passive_friction_force(geometry: Geometry, x: ArrayLike, rates: np.ndarray, coulomb: float,
                           viscous: float, slip_rate: float = 0.0) -> np.ndarray:
    """Return the force (..., 4) on D and about theta that overcomes friction in all 20 joints.

    Args:
        geometry: dimensions.
        x: poses (..., 4) of D and theta.
        rates: (..., 9, 3), rad/s, as `passive_rates` returns them.
        coulomb, viscous: of one ball or pivot, N m and N m s/rad.
        slip_rate: see `passive_force_sample`, rad/s.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    x_rows, leading = as_rows(x, 'pose x')
    force = np.empty_like(x_rows)
    _force_rows(geometry.packed, x_rows, inverse_kinematics(geometry, x_rows),
                rates.reshape((-1, GROUPS, 3)), coulomb, viscous, slip_rate, force)
    return force.reshape((*leading, LEGS))
