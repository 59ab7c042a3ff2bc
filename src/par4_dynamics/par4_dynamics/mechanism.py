"""Equations of motion of the whole mechanism in the coordinates X of its four freedoms.

M(X) Xddot + c(X, Xdot) = G^T tau with qdot = G Xdot, G = J_q^-1 J_x. The loops are closed by
construction. Kinetic energy is that of the lumped bodies of (20) minus, for distributed rods and
bars, m_5/6 |v_B - v_A|^2 a forearm and m_3/6 |v_D' - v_D|^2 for the bars, which is exact for
uniform slender bodies. Derived here from the energy, independently of `rigid_body`'s forces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.state import GRAVITY
from par4_kinematics.arrays import as_matching_rows
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import ARM, LEGS, PACKED, Geometry
from par4_kinematics.leg import (
    arm_direction,
    curvature,
    forearm_vector,
    plate_joint,
    plate_velocity,
    tangent,
)
from par4_kinematics.linear_solve import factor_in_place, solve_factored
from par4_kinematics.position import inverse_kinematics


@dataclass(frozen=True)
class LumpedBodies:
    """Base parameters of the rigid bodies and what (20) leaves out; kg, m, N m.

    Attributes:
        actuator_inertia: i_act of each joint, (4,) kg m2.
        platform_mass_1, platform_mass_2: m_1', m_2' at D and D', kg.
        arm_gravity: g (L_G m_4 + L m_5) of each joint, (4,) N m.
        rod_mass: m_5 of one distributed rod, 0 for end masses, kg.
        bar_mass: m_3 of one distributed bar, 0 for end masses, kg.
        theta_inertia: kg m2 at theta.
    """

    actuator_inertia: np.ndarray
    platform_mass_1: float
    platform_mass_2: float
    arm_gravity: np.ndarray
    rod_mass: float = 0.0
    bar_mass: float = 0.0
    theta_inertia: float = 0.0

    @property
    def packed(self) -> np.ndarray:
        """The values as the compiled kernels take them, (13,)."""
        return np.concatenate((
            np.broadcast_to(self.actuator_inertia, (LEGS,)),
            (self.platform_mass_1, self.platform_mass_2),
            np.broadcast_to(self.arm_gravity, (LEGS,)),
            (self.rod_mass, self.bar_mass, self.theta_inertia))).astype(float)


@dataclass(frozen=True)
class PhysicalBodies:
    """Masses of the single bodies behind lumped ones, for engines that want every body.

    Attributes:
        motor_inertia: i_a + i_m of each joint without the forearm's share, (4,) kg m2.
        half_plate_1, half_plate_2: m_1, m_2, kg.
        arm_moment: L_G m_4 of each arm, (4,) kg m.
        rod_mass, bar_mass: one rod, one bar, kg.
    """

    motor_inertia: np.ndarray
    half_plate_1: float
    half_plate_2: float
    arm_moment: np.ndarray
    rod_mass: float
    bar_mass: float


def physical_bodies(geometry: Geometry, bodies: LumpedBodies, rod_mass: float, bar_mass: float
                    ) -> PhysicalBodies:
    """Return the single bodies whose lumped parameters are `bodies`: the base parameters rule.

    m_1 = m_1' - m_3 - 2 m_5, i_a + i_m = i_act - m_5 L^2, L_G m_4 = arm_gravity / g - L m_5.

    Raises:
        InputError: a negative mass or inertia results.
    """
    arm = np.array(geometry.arm_lengths)
    plate = bar_mass + 2.0 * rod_mass
    result = PhysicalBodies(
        motor_inertia=np.broadcast_to(bodies.actuator_inertia, (LEGS,)) - rod_mass * arm ** 2,
        half_plate_1=bodies.platform_mass_1 - plate,
        half_plate_2=bodies.platform_mass_2 - plate,
        arm_moment=np.broadcast_to(bodies.arm_gravity, (LEGS,)) / GRAVITY - rod_mass * arm,
        rod_mass=rod_mass, bar_mass=bar_mass)
    for name, value, unit in (
            ('motor inertia i_a + i_m', result.motor_inertia.min(), 'kg m2'),
            ('mass m_1 of half plate 1', result.half_plate_1, 'kg'),
            ('mass m_2 of half plate 2', result.half_plate_2, 'kg'),
            ('rod mass', rod_mass, 'kg'), ('bar mass', bar_mass, 'kg')):
        if value < 0:
            raise InputError(
                f'{name}: {value:.4g} {unit} is negative with a rod of {rod_mass:g} kg and a bar '
                f'of {bar_mass:g} kg; the base parameters hold the shares of rods and bars, lower '
                f'rod_mass and bar_mass or raise the base parameters')
    return result


MASS, RATES, BIAS, OFFSETS, COSINES, SINES, SPEEDS = 0, 4, 8, 9, 10, 11, 12
"""First rows, in what `equations_sample` writes, of the mass matrix M, of G with qdot = G Xdot
(four rows each), of c and g with M Xddot + c = G^T tau and qddot = G Xddot + g, and of cos q,
sin q, qdot."""
EQUATION_ROWS = 13
ACTUATORS = PACKED
PLATES, WEIGHTS, RODS, THETA, GRAVITY_AT = (ACTUATORS + 4, ACTUATORS + 6, ACTUATORS + 10,
                                            ACTUATORS + 12, ACTUATORS + 13)
"""Where `packed_mechanism` has the actuator inertias, both lumped masses, the gravity moments of
the arms, the masses of rod and bar, the inertia of theta and gravity."""
MECHANISM = GRAVITY_AT + 3
"""Length of what `packed_mechanism` returns."""


def packed_mechanism(geometry: Geometry, bodies: LumpedBodies, gravity: ArrayLike) -> np.ndarray:
    """Return (44,): Geometry.packed, LumpedBodies.packed and gravity (3,) m/s2 in `base`."""
    return np.concatenate((geometry.packed, bodies.packed, gravity))


@numba.njit(cache=True, error_model='numpy', nogil=True)
def equations_sample(constants, motion, equations):
    """Write the equations of motion of one pose and velocity; return -1 or an unreachable leg.

    Args:
        constants: of `packed_mechanism`, which may be followed by others.
        motion: pose and velocity in its first two rows (2, 4).
        equations: (EQUATION_ROWS, 4) or more, written; one array, because each that is passed to
            a compiled function costs time.
    """
    xd_0, xd_1, xd_2, xd_3 = motion[1, 0], motion[1, 1], motion[1, 2], motion[1, 3]
    gravity_x, gravity_y, gravity_z = (
        constants[GRAVITY_AT], constants[GRAVITY_AT + 1], constants[GRAVITY_AT + 2])
    bar = constants[3]
    cosine, sine = math.cos(motion[0, 3]), math.sin(motion[0, 3])
    m_1, m_2 = constants[PLATES], constants[PLATES + 1]
    # of the two rods of a forearm and of the two bars; see the module's docstring
    rod, bars = constants[RODS] / 3.0, constants[RODS + 1] / 3.0
    # D' = D + u(theta): u' = bar (-cos, -sin), u'' thetad^2 = bar (sin, -cos) thetad^2
    u_x, u_y = -bar * cosine, -bar * sine
    w_x, w_y = bar * sine * xd_3 * xd_3, -bar * cosine * xd_3 * xd_3
    # each forearm takes rod [1 u']^T [1 u'] of its end at the plate off the lumped masses;
    # sums in scalars, so that they stay in registers
    total = m_1 + m_2
    m_00 = m_11 = m_22 = total - 4.0 * rod
    m_10 = m_20 = m_21 = m_32 = 0.0
    m_30, m_31 = (m_2 - 2.0 * rod) * u_x, (m_2 - 2.0 * rod) * u_y
    m_33 = (m_2 - bars - 2.0 * rod) * bar * bar + constants[THETA]
    b_0, b_1 = m_2 * w_x - total * gravity_x, m_2 * w_y - total * gravity_y
    b_2 = -total * gravity_z
    # u' is normal to u'', so the centripetal part has no moment about theta
    b_3 = -m_2 * (u_x * gravity_x + u_y * gravity_y)

    for leg in range(4):
        along, across, up = plate_joint(constants, motion[0, 0], motion[0, 1], motion[0, 2],
                                        cosine, sine, leg)
        reached, cos_q, sin_q = arm_direction(constants, along, across, up, leg)
        if not reached:
            return leg
        ab_x, ab_y, ab_z = forearm_vector(constants, along, across, up, cos_q, sin_q, leg)
        t_x, t_y, t_z = tangent(constants, cos_q, sin_q, leg)
        reciprocal = 1.0 / (ab_x * t_x + ab_y * t_y + ab_z * t_z)
        g_0, g_1, g_2 = ab_x * reciprocal, ab_y * reciprocal, ab_z * reciprocal
        g_3 = u_x * g_0 + u_y * g_1 if leg < 2 else 0.0
        speed = g_0 * xd_0 + g_1 * xd_1 + g_2 * xd_2 + g_3 * xd_3
        v_x, v_y = plate_velocity(constants, xd_0, xd_1, xd_3, cosine, sine, leg)
        offset = -reciprocal * curvature(constants, ab_x, ab_y, ab_z, v_x, v_y, xd_2, xd_3, speed,
                                         cos_q, sin_q, cosine, sine, leg)
        equations[COSINES, leg], equations[SINES, leg] = cos_q, sin_q
        equations[SPEEDS, leg], equations[OFFSETS, leg] = speed, offset
        row = RATES + leg
        equations[row, 0], equations[row, 1] = g_0, g_1
        equations[row, 2], equations[row, 3] = g_2, g_3
        # inertia about the joint less that of the forearm's shares on the arm: |dA/dq| = L_i
        arm = constants[ARM + leg]
        inertia = constants[ACTUATORS + leg] - rod * arm * arm
        weight = constants[WEIGHTS + leg] / GRAVITY * (
            sin_q * (gravity_x * constants[4 + 4 * leg] + gravity_y * constants[5 + 4 * leg])
            + cos_q * gravity_z)
        push = inertia * offset + weight
        e_0, e_1, e_2, e_3 = 0.0, 0.0, 0.0, 0.0
        if rod != 0.0:
            e_0, e_1, e_2 = rod * t_x, rod * t_y, rod * t_z
            # acceleration of B - A with Xddot = 0 and qddot = 0, and what offset adds
            inward = arm * cos_q * speed * speed
            r_x = inward * constants[4 + 4 * leg] - t_x * offset
            r_y = inward * constants[5 + 4 * leg] - t_y * offset
            r_z = -arm * sin_q * speed * speed - t_z * offset
            if leg < 2:
                e_3 = u_x * e_0 + u_y * e_1
                r_x += w_x
                r_y += w_y
                b_3 -= rod * (u_x * r_x + u_y * r_y)
                push += e_0 * w_x + e_1 * w_y
            b_0 -= rod * r_x
            b_1 -= rod * r_y
            b_2 -= rod * r_z
        b_0 += g_0 * push
        b_1 += g_1 * push
        b_2 += g_2 * push
        b_3 += g_3 * push
        # M = ... + inertia g g^T + e g^T + g e^T
        f_0, f_1, f_2, f_3 = (inertia * g_0 + e_0, inertia * g_1 + e_1, inertia * g_2 + e_2,
                              inertia * g_3 + e_3)
        m_00 += g_0 * f_0 + e_0 * g_0
        m_10 += g_1 * f_0 + e_1 * g_0
        m_11 += g_1 * f_1 + e_1 * g_1
        m_20 += g_2 * f_0 + e_2 * g_0
        m_21 += g_2 * f_1 + e_2 * g_1
        m_22 += g_2 * f_2 + e_2 * g_2
        m_30 += g_3 * f_0 + e_3 * g_0
        m_31 += g_3 * f_1 + e_3 * g_1
        m_32 += g_3 * f_2 + e_3 * g_2
        m_33 += g_3 * f_3 + e_3 * g_3
    for axis, value in enumerate((b_0, b_1, b_2, b_3)):
        equations[BIAS, axis] = value
    for axis, value in enumerate((m_00, m_10, m_20, m_30)):
        equations[MASS, axis] = equations[MASS + axis, 0] = value
    equations[MASS + 1, 1], equations[MASS + 2, 2], equations[MASS + 3, 3] = m_11, m_22, m_33
    equations[MASS + 2, 1] = equations[MASS + 1, 2] = m_21
    equations[MASS + 3, 1] = equations[MASS + 1, 3] = m_31
    equations[MASS + 3, 2] = equations[MASS + 2, 3] = m_32
    return -1


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _forward_rows(constants, x, xd, tau, xdd):
    motion, equations = np.empty((2, 4)), np.empty((EQUATION_ROWS, 4))
    for row in range(x.shape[0]):
        motion[0], motion[1] = x[row], xd[row]
        equations_sample(constants, motion, equations)
        for axis in range(4):
            xdd[row, axis] = -equations[BIAS, axis]
            for leg in range(4):
                xdd[row, axis] += equations[RATES + leg, axis] * tau[row, leg]
        factor_in_place(equations)
        solve_factored(equations, xdd[row])


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _mass_rows(constants, x, mass, rates):
    motion, equations = np.zeros((2, 4)), np.empty((EQUATION_ROWS, 4))
    for row in range(x.shape[0]):
        motion[0] = x[row]
        equations_sample(constants, motion, equations)
        mass[row], rates[row] = equations[MASS:RATES], equations[RATES:BIAS]


STANDARD_GRAVITY = np.array((0.0, 0.0, -GRAVITY))


def forward_dynamics(geometry: Geometry, bodies: LumpedBodies, x: ArrayLike, xd: ArrayLike,
                     tau: ArrayLike) -> np.ndarray:
    """Return xdd (..., 4) of the frictionless mechanism under joint torques tau (..., 4), N m.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    (x_rows, xd_rows, tau_rows), leading = as_matching_rows({'x': x, 'xd': xd, 'tau': tau})
    inverse_kinematics(geometry, x_rows)
    xdd = np.empty_like(x_rows)
    _forward_rows(packed_mechanism(geometry, bodies, STANDARD_GRAVITY), x_rows, xd_rows, tau_rows,
                  xdd)
    return xdd.reshape((*leading, LEGS))


def joint_mass_matrix(geometry: Geometry, bodies: LumpedBodies, x: ArrayLike) -> np.ndarray:
    """Return J^T M J (..., 4, 4), kg m2: the inertia that the four actuators feel at poses x."""
    (x_rows,), leading = as_matching_rows({'x': x})
    inverse_kinematics(geometry, x_rows)
    mass, rates = (np.empty((len(x_rows), LEGS, LEGS)) for _ in range(2))
    _mass_rows(packed_mechanism(geometry, bodies, STANDARD_GRAVITY), x_rows, mass, rates)
    jacobian = np.linalg.inv(rates)
    return (np.swapaxes(jacobian, -1, -2) @ mass @ jacobian).reshape((*leading, LEGS, LEGS))


def kinetic_energy(geometry: Geometry, bodies: LumpedBodies, x: ArrayLike, xd: ArrayLike
                   ) -> np.ndarray:
    """Return the kinetic energy (...,), J."""
    (x_rows, xd_rows), leading = as_matching_rows({'x': x, 'xd': xd})
    inverse_kinematics(geometry, x_rows)
    mass, rates = (np.empty((len(x_rows), LEGS, LEGS)) for _ in range(2))
    _mass_rows(packed_mechanism(geometry, bodies, STANDARD_GRAVITY), x_rows, mass, rates)
    return 0.5 * np.einsum('ni,nij,nj->n', xd_rows, mass, xd_rows).reshape(leading)


def potential_energy(geometry: Geometry, bodies: LumpedBodies, x: ArrayLike) -> np.ndarray:
    """Return the potential energy (...,), J, zero with the platform and arms at z = 0."""
    q = inverse_kinematics(geometry, x)
    x = np.asarray(x, dtype=float)
    return (GRAVITY * (bodies.platform_mass_1 + bodies.platform_mass_2) * x[..., 2]
            - np.sum(np.broadcast_to(bodies.arm_gravity, (LEGS,)) * np.sin(q), axis=-1))
