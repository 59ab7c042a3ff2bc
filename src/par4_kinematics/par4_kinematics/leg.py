"""One leg at one sample, in scalars: what kinematics and equations of motion are made of.

cos q and sin q follow from the closure of the leg without any angle; compiled, these functions
vanish into their callers. They neither branch nor leave early where a result is not finite, so
that a loop over samples made of them can be compiled to vector instructions.
"""

from __future__ import annotations

import math

import numba

from par4_kinematics.geometry import ARM, FOREARM


@numba.njit(cache=True, error_model='numpy')
def plate_joint(packed, x, y, z, cosine, sine, leg):
    """Return B_i - P_i: components along e_i, across it and up, m, for D at x, y, z.

    cosine and sine are those of theta.
    """
    along, across = packed[4 + 4 * leg], packed[5 + 4 * leg]
    px = x + packed[6 + 4 * leg]
    py = y + packed[7 + 4 * leg]
    if leg < 2:
        px -= packed[3] * sine
        py += packed[3] * cosine
    return px * along + py * across - packed[2], -px * across + py * along, z


@numba.njit(cache=True, error_model='numpy')
def arm_direction(packed, along, across, up, leg):
    """Return whether the leg reaches its plate joint, cos q and sin q, NaN where it does not.

    The arm's end must be l from the plate joint: along cos q - up sin q = k with
    k = (|v|^2 + L^2 - l^2) / (2 L); of the two solutions the one with the elbow outward.
    """
    arm, forearm = packed[ARM + leg], packed[FOREARM + leg]
    plane = along * along + up * up
    needed = (plane + across * across + arm * arm - forearm * forearm) / (2.0 * arm)
    left = plane - needed * needed
    root = math.sqrt(left)
    return (left >= 0.0, (along * needed - up * root) / plane,
            (-up * needed - along * root) / plane)


@numba.njit(cache=True, error_model='numpy')
def forearm_vector(packed, along, across, up, cos_q, sin_q, leg):
    """Return A_i B_i in `base`, m, from B_i - P_i (along, across, up) and the arm's direction."""
    arm = packed[ARM + leg]
    inward = along - arm * cos_q
    cos_azimuth, sin_azimuth = packed[4 + 4 * leg], packed[5 + 4 * leg]
    return (inward * cos_azimuth - across * sin_azimuth,
            inward * sin_azimuth + across * cos_azimuth, up + arm * sin_q)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def closed_leg(packed, x, y, z, cosine, sine, leg):
    """Return A_i B_i in `base`, m, cos q and sin q of a pose; NaN where the leg cannot reach."""
    along, across, up = plate_joint(packed, x, y, z, cosine, sine, leg)
    _, cos_q, sin_q = arm_direction(packed, along, across, up, leg)
    ab_x, ab_y, ab_z = forearm_vector(packed, along, across, up, cos_q, sin_q, leg)
    return ab_x, ab_y, ab_z, cos_q, sin_q


@numba.njit(cache=True, error_model='numpy')
def tangent(packed, cos_q, sin_q, leg):
    """Return dA_i/dq_i in `base`, m/rad."""
    arm = packed[ARM + leg]
    return (-arm * sin_q * packed[4 + 4 * leg], -arm * sin_q * packed[5 + 4 * leg], -arm * cos_q)


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def joint_lever(packed, ab_x, ab_y, ab_z, cos_q, sin_q, leg):
    """Return the leg's entry of J_q, A_iB_i . dA_i/dq_i, m2/rad; positive, elbow outward."""
    t_x, t_y, t_z = tangent(packed, cos_q, sin_q, leg)
    return ab_x * t_x + ab_y * t_y + ab_z * t_z


@numba.njit(cache=True, error_model='numpy', forceinline=True)
def bar_lever(packed, ab_x, ab_y, cosine, sine):
    """Return h (cos theta ABx + sin theta ABy), m2/rad: -c of legs 0, 1 at D, c of 2, 3 at D'."""
    return packed[3] * (cosine * ab_x + sine * ab_y)


@numba.njit(cache=True, error_model='numpy')
def plate_velocity(packed, vx, vy, rate, cosine, sine, leg):
    """Return x and y of the velocity of B_i, m/s; vx, vy of D, rate = thetad."""
    if leg < 2:
        return vx - packed[3] * cosine * rate, vy - packed[3] * sine * rate
    return vx, vy


@numba.njit(cache=True, error_model='numpy')
def curvature(packed, ab_x, ab_y, ab_z, vb_x, vb_y, vb_z, rate, qd, cos_q, sin_q, cosine, sine,
              leg):
    """Return b_i of J_x Xddot = j_q qddot + b, m2/s2: what velocities alone accelerate.

    From differentiating A_iB_i . (v_B - v_A) = 0; v_B of `plate_velocity`, rate = thetad.
    """
    t_x, t_y, t_z = tangent(packed, cos_q, sin_q, leg)
    v_x, v_y, v_z = vb_x - t_x * qd, vb_y - t_y * qd, vb_z - t_z * qd
    turning = 0.0
    if leg < 2:
        turning = packed[3] * (ab_x * sine - ab_y * cosine) * rate * rate
    outward = packed[ARM + leg] * (
        cos_q * (ab_x * packed[4 + 4 * leg] + ab_y * packed[5 + 4 * leg]) - sin_q * ab_z)
    return -(v_x * v_x + v_y * v_y + v_z * v_z + turning + outward * qd * qd)
