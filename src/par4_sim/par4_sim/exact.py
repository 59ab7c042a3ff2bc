"""The exact plant: the mechanism in its four coordinates, Runge-Kutta of order four, real sticking.

Loops are closed by construction. A joint either slides, with friction opposite to a known
direction, or sticks, with the friction torque that keeps it still. Within a step the motion is
smooth between events: a joint that would reverse is stopped at its zero crossing and sticks until
the torque that holds it exceeds the breakaway level.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_dynamics.mechanism import STANDARD_GRAVITY, equations_sample
from par4_kinematics.errors import UnreachableError
from par4_kinematics.linear_solve import solve_in_place
from par4_kinematics.position import inverse_kinematics, inverse_sample
from par4_kinematics.velocity import AT_D, jacobians_sample
from par4_sim.friction import dry_friction
from par4_sim.machine import Machine
from par4_sim.plant import STEP

STUCK, FREE = 0, 2
"""Modes of a joint besides +1 and -1, sliding forward and back; FREE has no dry friction."""
MAX_EVENTS = 16


@numba.njit(cache=True, error_model='numpy')
def _acceleration(packed, bodies, gravity, friction, x, xd, tau, modes, q, qd, xdd, holding):
    """Write xdd (4,) and, for stuck joints, the friction torque that holds them (4,)."""
    mass, rates = np.empty((4, 4)), np.empty((4, 4))
    bias, offsets = np.empty(4), np.empty(4)
    leg = equations_sample(packed, bodies, gravity, x, xd, q, qd, mass, bias, rates, offsets)
    if leg >= 0:
        return leg
    # column 0: the free acceleration; the others: response to a torque on each joint
    columns = np.empty((4, 5))
    for axis in range(4):
        columns[axis, 0] = -bias[axis]
        for joint in range(4):
            columns[axis, 1 + joint] = rates[joint, axis]
    for joint in range(4):
        net = tau[joint] - friction[joint, 1] * qd[joint]
        if abs(modes[joint]) == 1:
            net -= modes[joint] * dry_friction(friction[joint], abs(qd[joint]))
        for axis in range(4):
            columns[axis, 0] += rates[joint, axis] * net
        holding[joint] = 0.0
    solve_in_place(mass, columns)
    stuck = 0
    for joint in range(4):
        stuck += modes[joint] == STUCK
    if stuck > 0:
        # (G xdd + g) = 0 in the stuck joints fixes their friction torques
        matrix, right = np.empty((stuck, stuck)), np.empty((stuck, 1))
        row = 0
        for joint in range(4):
            if modes[joint] != STUCK:
                continue
            right[row, 0] = offsets[joint]
            for axis in range(4):
                right[row, 0] += rates[joint, axis] * columns[axis, 0]
            column = 0
            for other in range(4):
                if modes[other] != STUCK:
                    continue
                matrix[row, column] = 0.0
                for axis in range(4):
                    matrix[row, column] += rates[joint, axis] * columns[axis, 1 + other]
                column += 1
            row += 1
        solve_in_place(matrix, right)
        row = 0
        for joint in range(4):
            if modes[joint] == STUCK:
                holding[joint] = right[row, 0]
                for axis in range(4):
                    columns[axis, 0] -= columns[axis, 1 + joint] * right[row, 0]
                row += 1
    for axis in range(4):
        xdd[axis] = columns[axis, 0]
    return -1


@numba.njit(cache=True, error_model='numpy')
def _runge_kutta(packed, bodies, gravity, friction, x, xd, tau, modes, span, x_end, xd_end):
    """Write the state after `span` seconds with these modes; return -1 or an unreachable leg."""
    q, qd, holding = np.empty(4), np.empty(4), np.empty(4)
    k_x, k_v = np.zeros((5, 4)), np.zeros((5, 4))
    x_stage, xd_stage = np.empty(4), np.empty(4)
    for stage in range(4):
        part = 0.0 if stage == 0 else (span if stage == 3 else 0.5 * span)
        for axis in range(4):
            # row 4 stays zero: the first stage starts from the state itself
            x_stage[axis] = x[axis] + part * k_x[stage - 1, axis]
            xd_stage[axis] = xd[axis] + part * k_v[stage - 1, axis]
            k_x[stage, axis] = xd_stage[axis]
        leg = _acceleration(packed, bodies, gravity, friction, x_stage, xd_stage, tau, modes, q,
                            qd, k_v[stage], holding)
        if leg >= 0:
            return leg
    for axis in range(4):
        x_end[axis] = x[axis] + span / 6.0 * (
            k_x[0, axis] + 2.0 * k_x[1, axis] + 2.0 * k_x[2, axis] + k_x[3, axis])
        xd_end[axis] = xd[axis] + span / 6.0 * (
            k_v[0, axis] + 2.0 * k_v[1, axis] + 2.0 * k_v[2, axis] + k_v[3, axis])
    return -1


@numba.njit(cache=True, error_model='numpy')
def _joint_state(packed, x, xd, q, qd, modes):
    """Write q, qd; remove the remains of velocity in stuck joints. Return -1 or a leg."""
    leg_out = inverse_sample(packed, x, q)
    if leg_out >= 0:
        return leg_out
    j_x, j_q = np.empty((4, 4)), np.empty(4)
    jacobians_sample(packed, x, q, AT_D, j_x, j_q)
    moved = False
    for joint in range(4):
        total = 0.0
        for axis in range(4):
            total += j_x[joint, axis] * xd[axis]
        qd[joint] = total / j_q[joint]
        if modes[joint] == STUCK and qd[joint] != 0.0:
            qd[joint] = 0.0
            moved = True
    if moved:
        column = np.empty((4, 1))
        for joint in range(4):
            column[joint, 0] = j_q[joint] * qd[joint]
        solve_in_place(j_x, column)
        for axis in range(4):
            xd[axis] = column[axis, 0]
    return -1


@numba.njit(cache=True, error_model='numpy')
def _release(packed, bodies, gravity, friction, x, xd, tau, modes):
    """Let go of stuck joints that friction cannot hold; return -1 or an unreachable leg."""
    q, qd, xdd, holding = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    for _ in range(4):
        if not (modes[0] == STUCK or modes[1] == STUCK or modes[2] == STUCK or modes[3] == STUCK):
            return -1
        leg = _acceleration(packed, bodies, gravity, friction, x, xd, tau, modes, q, qd, xdd,
                            holding)
        if leg >= 0:
            return leg
        worst, excess = -1, 0.0
        for joint in range(4):
            if modes[joint] == STUCK:
                over = abs(holding[joint]) - dry_friction(friction[joint], 0.0)
                if over > excess:
                    worst, excess = joint, over
        if worst < 0:
            return -1
        modes[worst] = 1 if holding[worst] > 0.0 else -1
    return -1


@numba.njit(cache=True, error_model='numpy')
def advance(packed, bodies, gravity, friction, x, xd, tau, modes, q, qd, span):
    """Advance x, xd, modes, q, qd (each (4,), in place) by `span`; return -1 or a leg."""
    x_end, xd_end, q_end, qd_end = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    sliding = np.full(4, FREE)
    for event in range(MAX_EVENTS):
        leg = _release(packed, bodies, gravity, friction, x, xd, tau, modes)
        if leg >= 0:
            return leg
        leg = _runge_kutta(packed, bodies, gravity, friction, x, xd, tau, modes, span, x_end,
                           xd_end)
        if leg >= 0:
            return leg
        leg = _joint_state(packed, x_end, xd_end, q_end, qd_end, sliding)
        if leg >= 0:
            return leg
        first, part = -1, 1.0
        for joint in range(4):
            if abs(modes[joint]) == 1 and modes[joint] * qd_end[joint] < 0.0:
                before = modes[joint] * qd[joint]
                after = modes[joint] * qd_end[joint]
                fraction = max(before, 0.0) / (max(before, 0.0) - after)
                if fraction < part or first < 0:
                    first, part = joint, fraction
        if first < 0 or event == MAX_EVENTS - 1:
            x[:] = x_end
            xd[:] = xd_end
            return _joint_state(packed, x, xd, q, qd, modes)
        if part > 0.0:
            leg = _runge_kutta(packed, bodies, gravity, friction, x, xd, tau, modes,
                               part * span, x_end, xd_end)
            if leg >= 0:
                return leg
            x[:] = x_end
            xd[:] = xd_end
        modes[first] = STUCK
        leg = _joint_state(packed, x, xd, q, qd, modes)
        if leg >= 0:
            return leg
        span *= 1.0 - part
    return -1


class ExactPlant:
    """The machine in reduced coordinates; implements `Plant`.

    Args:
        machine: what it is.
        dt: physics step, s.
    """

    def __init__(self, machine: Machine, dt: float = STEP) -> None:
        self.dt = dt
        self.velocity_offset = 0.0
        self.torque_offset = 0.5 * dt
        self._machine = machine
        self._geometry = machine.geometry.packed
        self._bodies = machine.bodies.packed
        self._friction = machine.friction.packed
        self._q, self._qd, self._x, self._xd = (np.zeros(4) for _ in range(4))
        self._modes = np.zeros(4, dtype=np.int64)
        self._steps = 0

    @property
    def time(self) -> float:
        """Seconds since the last reset."""
        return self._steps * self.dt

    @property
    def q(self) -> np.ndarray:
        """Joint positions (4,), rad."""
        return self._q.copy()

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities (4,), rad/s."""
        return self._qd.copy()

    @property
    def x(self) -> np.ndarray:
        """Pose of D and theta (4,), m, rad."""
        return self._x.copy()

    @property
    def xd(self) -> np.ndarray:
        """Velocity of D and thetadot (4,)."""
        return self._xd.copy()

    def reset(self, x: ArrayLike) -> None:
        """Put the machine at rest at pose x (4,); raises UnreachableError."""
        self._q[:] = inverse_kinematics(self._machine.geometry, x)
        self._x[:] = x
        self._xd[:] = 0.0
        self._qd[:] = 0.0
        has_dry = (self._friction[:, 0] > 0) | (self._friction[:, 2] > 0)
        self._modes[:] = np.where(has_dry, STUCK, FREE)
        self._steps = 0

    def step(self, tau: ArrayLike) -> None:
        """Advance by dt with actuator torques tau (4,), N m, held.

        Loads are taken at the middle of the step, where they are exact to second order.

        Raises:
            UnreachableError: the platform was driven out of reach.
        """
        torque = np.array(tau, dtype=float)
        for load in self._machine.loads:
            torque -= load(self.time + 0.5 * self.dt, self._q + 0.5 * self.dt * self._qd, self._qd)
        leg = advance(self._geometry, self._bodies, STANDARD_GRAVITY, self._friction, self._x,
                      self._xd, torque, self._modes, self._q, self._qd, self.dt)
        if leg >= 0 or not math.isfinite(self._x[0]):
            raise UnreachableError(
                f'after {self.time:.4f} s leg {max(leg, 0)} was driven out of reach at pose '
                f'{np.round(self._x, 4).tolist()}; check the torques and the motion')
        self._steps += 1

    def loop_opening(self) -> float:
        """Return 0.0 m: loops are closed by construction."""
        return 0.0

    def close(self) -> None:
        """Do nothing: the plant holds no engine."""
