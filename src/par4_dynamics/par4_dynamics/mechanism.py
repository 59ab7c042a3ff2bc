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
from par4_kinematics.acceleration import velocity_product
from par4_kinematics.arrays import as_matching_rows
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.linear_solve import solve_in_place
from par4_kinematics.position import inverse_kinematics, inverse_sample
from par4_kinematics.velocity import AT_D, arm_tangent, jacobian_rates_sample, jacobians_sample


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
    arm = geometry.arm_length
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


@numba.njit(cache=True, error_model='numpy')
def equations_sample(packed, bodies, gravity, x, xd, q, qd, mass, bias, rates, offsets):
    """Write the equations of motion of one pose and velocity; return -1 or an unreachable leg.

    Args:
        packed, bodies: Geometry.packed, LumpedBodies.packed.
        gravity: (3,) m/s2 in `base`.
        x, xd: pose and velocity (4,).
        q, qd: joint positions and velocities (4,), written.
        mass: M (4, 4), written.
        bias: c (4,), written, so that M Xddot + c = G^T tau.
        rates: G (4, 4), written.
        offsets: g (4,), written, so that qddot = G Xddot + g.
    """
    leg_out = inverse_sample(packed, x, q)
    if leg_out >= 0:
        return leg_out
    bar = packed[3]
    cosine, sine = math.cos(x[3]), math.sin(x[3])
    j_x, j_x_rate = np.empty((4, 4)), np.empty((4, 4))
    j_q, j_q_rate = np.empty(4), np.empty(4)
    jacobians_sample(packed, x, q, AT_D, j_x, j_q)
    for leg in range(4):
        qd[leg] = 0.0
        for axis in range(4):
            rates[leg, axis] = j_x[leg, axis] / j_q[leg]
            qd[leg] += rates[leg, axis] * xd[axis]
    jacobian_rates_sample(packed, x, xd, q, qd, AT_D, j_x_rate, j_q_rate)

    m_1, m_2 = bodies[4], bodies[5]
    rod, bar_mass, inertia_theta = bodies[10] / 3.0, bodies[11] / 3.0, bodies[12]
    # D' = D + u(theta): u' = bar (-cos, -sin), u'' thetad^2 = bar (sin, -cos) thetad^2
    u_x, u_y = -bar * cosine, -bar * sine
    w_x, w_y = bar * sine * xd[3] * xd[3], -bar * cosine * xd[3] * xd[3]
    mass[:] = 0.0
    for axis in range(3):
        mass[axis, axis] = m_1 + m_2
        bias[axis] = -(m_1 + m_2) * gravity[axis]
    mass[0, 3] = mass[3, 0] = m_2 * u_x
    mass[1, 3] = mass[3, 1] = m_2 * u_y
    mass[3, 3] = (m_2 - bar_mass) * bar * bar + inertia_theta
    bias[0] += m_2 * w_x
    bias[1] += m_2 * w_y
    # u' is normal to u'', so the centripetal part has no moment about theta
    bias[3] = -m_2 * (u_x * gravity[0] + u_y * gravity[1])

    stretch = np.zeros((3, 4))
    residue = np.empty(3)
    for leg in range(4):
        offsets[leg] = -velocity_product(j_x_rate, j_q_rate, xd, qd, leg) / j_q[leg]
        joint_bias = bodies[leg] * offsets[leg] + bodies[6 + leg] * math.cos(q[leg]) * (
            gravity[2] / GRAVITY)
        for i in range(4):
            bias[i] += rates[leg, i] * joint_bias
            for j in range(4):
                mass[i, j] += bodies[leg] * rates[leg, i] * rates[leg, j]
        if rod != 0.0:
            t_x, t_y, t_z = arm_tangent(packed, q[leg], leg)
            inward = -packed[0] * math.cos(q[leg]) * qd[leg] * qd[leg]
            residue[0] = -inward * packed[4 + 4 * leg] - t_x * offsets[leg]
            residue[1] = -inward * packed[5 + 4 * leg] - t_y * offsets[leg]
            residue[2] = (-packed[0] * math.sin(q[leg]) * qd[leg] * qd[leg]
                          - t_z * offsets[leg])
            for axis in range(4):
                stretch[0, axis] = -t_x * rates[leg, axis]
                stretch[1, axis] = -t_y * rates[leg, axis]
                stretch[2, axis] = -t_z * rates[leg, axis]
            for axis in range(3):
                stretch[axis, axis] += 1.0
            if leg < 2:
                stretch[0, 3] += u_x
                stretch[1, 3] += u_y
                residue[0] += w_x
                residue[1] += w_y
            for i in range(4):
                for axis in range(3):
                    bias[i] -= rod * stretch[axis, i] * residue[axis]
                    for j in range(4):
                        mass[i, j] -= rod * stretch[axis, i] * stretch[axis, j]
    return -1


@numba.njit(cache=True, error_model='numpy')
def _forward_rows(packed, bodies, gravity, x, xd, tau, xdd):
    q, qd, bias, offsets = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    mass, rates, column = np.empty((4, 4)), np.empty((4, 4)), np.empty((4, 1))
    for row in range(x.shape[0]):
        equations_sample(packed, bodies, gravity, x[row], xd[row], q, qd, mass, bias, rates,
                         offsets)
        for axis in range(4):
            column[axis, 0] = -bias[axis]
            for leg in range(4):
                column[axis, 0] += rates[leg, axis] * tau[row, leg]
        solve_in_place(mass, column)
        xdd[row] = column[:, 0]


@numba.njit(cache=True, error_model='numpy')
def _mass_rows(packed, bodies, gravity, x, mass, rates):
    still, bias, offsets = np.zeros(4), np.empty(4), np.empty(4)
    q, qd = np.empty(4), np.empty(4)
    for row in range(x.shape[0]):
        equations_sample(packed, bodies, gravity, x[row], still, q, qd, mass[row], bias,
                         rates[row], offsets)


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
    _forward_rows(geometry.packed, bodies.packed, STANDARD_GRAVITY, x_rows, xd_rows, tau_rows, xdd)
    return xdd.reshape((*leading, LEGS))


def joint_mass_matrix(geometry: Geometry, bodies: LumpedBodies, x: ArrayLike) -> np.ndarray:
    """Return J^T M J (..., 4, 4), kg m2: the inertia that the four actuators feel at poses x."""
    (x_rows,), leading = as_matching_rows({'x': x})
    inverse_kinematics(geometry, x_rows)
    mass, rates = (np.empty((len(x_rows), LEGS, LEGS)) for _ in range(2))
    _mass_rows(geometry.packed, bodies.packed, STANDARD_GRAVITY, x_rows, mass, rates)
    jacobian = np.linalg.inv(rates)
    return (np.swapaxes(jacobian, -1, -2) @ mass @ jacobian).reshape((*leading, LEGS, LEGS))


def kinetic_energy(geometry: Geometry, bodies: LumpedBodies, x: ArrayLike, xd: ArrayLike
                   ) -> np.ndarray:
    """Return the kinetic energy (...,), J."""
    (x_rows, xd_rows), leading = as_matching_rows({'x': x, 'xd': xd})
    inverse_kinematics(geometry, x_rows)
    mass, rates = (np.empty((len(x_rows), LEGS, LEGS)) for _ in range(2))
    _mass_rows(geometry.packed, bodies.packed, STANDARD_GRAVITY, x_rows, mass, rates)
    return 0.5 * np.einsum('ni,nij,nj->n', xd_rows, mass, xd_rows).reshape(leading)


def potential_energy(geometry: Geometry, bodies: LumpedBodies, x: ArrayLike) -> np.ndarray:
    """Return the potential energy (...,), J, zero with the platform and arms at z = 0."""
    q = inverse_kinematics(geometry, x)
    x = np.asarray(x, dtype=float)
    return (GRAVITY * (bodies.platform_mass_1 + bodies.platform_mass_2) * x[..., 2]
            - np.sum(np.broadcast_to(bodies.arm_gravity, (LEGS,)) * np.sin(q), axis=-1))
