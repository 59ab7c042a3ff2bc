"""The steps of the exact plant: Runge-Kutta of order four, between joints that stick and slip.

A joint either slides, with friction opposite to a known direction, or sticks, with the friction
torque that keeps it still. Within a step the motion is smooth between events: a joint that would
reverse is stopped at its zero crossing and sticks until the torque that holds it exceeds the
breakaway level.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_dynamics.mechanism import (
    BIAS,
    COSINES,
    EQUATION_ROWS,
    MECHANISM,
    OFFSETS,
    RATES,
    SINES,
    SPEEDS,
    equations_sample,
    packed_mechanism,
)
from par4_kinematics.acceleration import joint_speed
from par4_kinematics.leg import (
    arm_direction,
    forearm_vector,
    plate_joint,
)
from par4_kinematics.linear_solve import factor_in_place, solve_factored, solve_in_place
from par4_sim.machines.friction import (
    LOAD_COEFFICIENT,
    PRESLIDING_DISTANCE,
    behind_load_friction,
    bending_torque,
    bent,
    dry_friction,
    flowing_friction,
    friction_at,
)
from par4_sim.machines.machine import Machine
from par4_sim.machines.platform_forces import add_pivot_force, platform_force_sample

X, XD, Q, QD, MODE, BENDING = range(6)
"""Rows of the state (6, 4); bending: that of the contacts with presliding."""
STUCK, FREE = 0.0, 2.0
"""Modes of a joint besides +1 and -1, sliding forward and back; FREE has no dry friction."""
MAX_EVENTS = 16
LOST = 4
"""Returned in place of a leg where the motion is no longer finite."""
OPEN = 5
"""In place of a leg where the mechanism does not close half a step on, where a load is taken."""

PLATFORM, HAS_FORCES, HAS_PIVOTS = MECHANISM, MECHANISM + 15, MECHANISM + 16
"""Where, behind those of the mechanism, platform forces and two flags are in the constants."""
ANGLES, FORCE, HOLDING, RESPONSES, K_X, K_V, STAGE, END, WORK_ROWS = (
    EQUATION_ROWS, 14, 15, 16, 20, 24, 28, 30, 34)
"""First rows of the workspace (34, 4), behind those of the equations of motion: q, forces on the
platform, friction that holds stuck joints, responses to it, the four stages' velocities and
accelerations, the stage's pose and velocity, and X, XD, Q, QD at the end of a stretch."""


@numba.njit(cache=True, error_model='numpy')
def _acceleration(constants, friction, harmonics, state, work, motion, tau, out):
    """Write Xddot of a motion (2, 4) to row `out` of work, and what holds stuck joints to HOLDING.

    Returns -1 or an unreachable leg.
    """
    leg = equations_sample(constants, motion, work)
    if leg >= 0:
        return leg
    bends = False
    for joint in range(4):
        bends = bends or friction[joint, PRESLIDING_DISTANCE] > 0.0
    if bends or harmonics.shape[0] > 0 or constants[HAS_PIVOTS] != 0.0:
        for joint in range(4):
            work[ANGLES, joint] = math.atan2(work[SINES, joint], work[COSINES, joint])
    for axis in range(4):
        work[out, axis] = -work[BIAS, axis]
    if constants[HAS_FORCES] != 0.0:
        platform, force = constants[PLATFORM:], work[FORCE]
        platform_force_sample(platform, motion[0], motion[1], force)
        if constants[HAS_PIVOTS] != 0.0:
            add_pivot_force(platform, constants, motion[0], motion[1], work[ANGLES], work[SPEEDS],
                            force)
        for axis in range(4):
            work[out, axis] += force[axis]
    for row in range(harmonics.shape[0]):
        joint = int(harmonics[row, 0])
        torque = harmonics[row, 1] * math.sin(
            harmonics[row, 2] * work[ANGLES, joint] + harmonics[row, 3])
        for axis in range(4):
            work[out, axis] -= work[RATES + joint, axis] * torque
    stuck = 0
    for joint in range(4):
        mode, speed = state[MODE, joint], work[SPEEDS, joint]
        net = tau[joint] - flowing_friction(friction, joint, speed)
        if friction[joint, PRESLIDING_DISTANCE] > 0.0:
            moved = work[ANGLES, joint] - state[Q, joint]
            net -= bending_torque(
                friction, joint, bent(friction, joint, state[BENDING, joint], moved))
        if mode == STUCK:
            stuck += 1
        elif mode != FREE:
            net -= mode * dry_friction(friction, joint, mode, abs(speed))
            net = behind_load_friction(friction, joint, mode, net)
        for axis in range(4):
            work[out, axis] += work[RATES + joint, axis] * net
    factor_in_place(work)
    solve_factored(work, work[out])
    if stuck > 0:
        _hold(state, work, stuck, out)
    return -1


@numba.njit(cache=True, error_model='numpy')
def _hold(state, work, stuck, out):
    """Keep the stuck joints still, G Xddot + g = 0 there: correct Xddot, write HOLDING."""
    matrix, right = np.empty((stuck, stuck)), np.empty((stuck, 1))
    joints = np.empty(stuck, np.int64)
    row = 0
    for joint in range(4):
        if state[MODE, joint] == STUCK:
            joints[row] = joint
            work[RESPONSES + row] = work[RATES + joint]
            solve_factored(work, work[RESPONSES + row])
            row += 1
    for row in range(stuck):
        rates = work[RATES + joints[row]]
        right[row, 0] = work[OFFSETS, joints[row]]
        for axis in range(4):
            right[row, 0] += rates[axis] * work[out, axis]
        for column in range(stuck):
            matrix[row, column] = 0.0
            for axis in range(4):
                matrix[row, column] += rates[axis] * work[RESPONSES + column, axis]
    solve_in_place(matrix, right)
    for row in range(stuck):
        work[HOLDING, joints[row]] = right[row, 0]
        for axis in range(4):
            work[out, axis] -= work[RESPONSES + row, axis] * right[row, 0]


@numba.njit(cache=True, error_model='numpy')
def _runge_kutta(constants, friction, harmonics, state, work, tau, span):
    """Write the motion after `span` seconds with these modes to END; return -1 or a leg."""
    motion = work[STAGE:END]
    for stage in range(4):
        part = 0.0 if stage == 0 else (span if stage == 3 else 0.5 * span)
        before = max(stage - 1, 0)
        for axis in range(4):
            x, xd = state[X, axis], state[XD, axis]
            if stage > 0:
                x += part * work[K_X + before, axis]
                xd += part * work[K_V + before, axis]
            motion[X, axis], motion[XD, axis], work[K_X + stage, axis] = x, xd, xd
        leg = _acceleration(constants, friction, harmonics, state, work, motion, tau, K_V + stage)
        if leg >= 0:
            return leg
    for axis in range(4):
        work[END + X, axis] = state[X, axis] + span / 6.0 * (
            work[K_X, axis] + 2.0 * (work[K_X + 1, axis] + work[K_X + 2, axis])
            + work[K_X + 3, axis])
        work[END + XD, axis] = state[XD, axis] + span / 6.0 * (
            work[K_V, axis] + 2.0 * (work[K_V + 1, axis] + work[K_V + 2, axis])
            + work[K_V + 3, axis])
    return _joint_state(constants, work)


@numba.njit(cache=True, error_model='numpy')
def _joint_state(constants, work):
    """Write Q and QD of the pose and velocity at END; return -1 or an unreachable leg."""
    x, y, z, theta = work[END, 0], work[END, 1], work[END, 2], work[END, 3]
    xd = (work[END + XD, 0], work[END + XD, 1], work[END + XD, 2], work[END + XD, 3])
    cosine, sine = math.cos(theta), math.sin(theta)
    for leg in range(4):
        along, across, up = plate_joint(constants, x, y, z, cosine, sine, leg)
        reached, cos_q, sin_q = arm_direction(constants, along, across, up, leg)
        if not reached:
            return leg
        ab_x, ab_y, ab_z = forearm_vector(constants, along, across, up, cos_q, sin_q, leg)
        work[END + Q, leg] = math.atan2(sin_q, cos_q)
        work[END + QD, leg] = joint_speed(constants, (ab_x, ab_y, ab_z, cos_q, sin_q), xd, cosine,
                                          sine, leg)
    return -1


@numba.njit(cache=True, error_model='numpy')
def _take_over(constants, friction, state, work, landed):
    """Make END the state; stuck joints lose what motion the integration left them.

    Joint `landed` (-1: none) has come to rest just there; the others stay where they were.
    """
    moved, left = False, np.zeros((4, 2))
    for joint in range(4):
        stuck, before = state[MODE, joint] == STUCK, state[Q, joint]
        if friction[joint, PRESLIDING_DISTANCE] > 0.0:
            state[BENDING, joint] = bent(friction, joint, state[BENDING, joint],
                                         work[END + Q, joint] - before)
        for row in range(4):
            state[row, joint] = work[END + row, joint]
        if stuck and joint != landed and state[Q, joint] != before:
            left[joint, 0] = before - state[Q, joint]
            state[Q, joint] = before
            moved = True
        if stuck and state[QD, joint] != 0.0:
            state[QD, joint] = 0.0
            moved = True
    if moved and equations_sample(constants, state, work) < 0:
        left[:, 1] = state[QD]
        solve_in_place(work[RATES:BIAS], left)
        state[X] += left[:, 0]
        state[XD] = left[:, 1]


@numba.njit(cache=True, error_model='numpy')
def _release(constants, friction, harmonics, state, work, tau):
    """Let go of stuck joints that friction cannot hold; return -1 or an unreachable leg."""
    for _ in range(4):
        if not (state[MODE, 0] == STUCK or state[MODE, 1] == STUCK or state[MODE, 2] == STUCK
                or state[MODE, 3] == STUCK):
            return -1
        leg = _acceleration(constants, friction, harmonics, state, work, state, tau, K_V)
        if leg >= 0:
            return leg
        worst, excess = -1, 0.0
        for joint in range(4):
            if state[MODE, joint] == STUCK:
                torque = work[HOLDING, joint]
                level = (dry_friction(friction, joint, torque, 0.0)
                         + friction[joint, LOAD_COEFFICIENT] * abs(tau[joint] - torque))
                over = abs(torque) - level
                if over > excess:
                    worst, excess = joint, over
        if worst < 0:
            return -1
        state[MODE, worst] = 1.0 if work[HOLDING, worst] > 0.0 else -1.0
    return -1


@numba.njit(cache=True, error_model='numpy')
def advance(constants, friction, harmonics, state, work, time, tau, span):
    """Advance the state (6, 4), in place, from `time` by `span` seconds under torques tau (4,).

    Args:
        constants: of `machine_constants`.
        friction, harmonics: Friction.packed, Machine.harmonic_rows.
        state: rows X, XD, Q, QD, MODE, BENDING.
        work: (WORK_ROWS, 4), overwritten.

    Returns:
        -1, a leg that cannot reach, or LOST.
    """
    friction = friction_at(friction, time + 0.5 * span)
    for event in range(MAX_EVENTS):
        leg = _release(constants, friction, harmonics, state, work, tau)
        if leg >= 0:
            return leg
        leg = _runge_kutta(constants, friction, harmonics, state, work, tau, span)
        if leg >= 0:
            return leg
        first, part = -1, 1.0
        for joint in range(4):
            mode, speed = state[MODE, joint], work[END + QD, joint]
            if abs(mode) == 1.0 and mode * speed < 0.0:
                before = max(mode * state[QD, joint], 0.0)
                fraction = before / (before - mode * speed)
                if fraction < part or first < 0:
                    first, part = joint, fraction
        if first < 0 or event == MAX_EVENTS - 1:
            break
        if part > 0.0:
            leg = _runge_kutta(constants, friction, harmonics, state, work, tau, part * span)
            if leg >= 0:
                return leg
        else:
            work[END:] = state[:MODE]
        state[MODE, first] = STUCK
        _take_over(constants, friction, state, work, first)
        span *= 1.0 - part
    _take_over(constants, friction, state, work, -1)
    return -1 if math.isfinite(state[X, 0]) else LOST


def machine_constants(machine: Machine) -> np.ndarray:
    """Return the constants (53,) of a machine as `advance` takes them."""
    platform = machine.platform
    return np.concatenate((packed_mechanism(machine.geometry, machine.bodies, machine.gravity),
                           platform.packed, (not platform.is_none, platform.has_pivots)))
