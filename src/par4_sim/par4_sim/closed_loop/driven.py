"""Physics steps of the exact plant under its drives, many in one compiled call.

What `ControlLoop.torque` and the `step` of the plant, behind springs or not, do in turn, with the
same kernels and so to the last digit the same; only the way from the one to the other through
Python is saved, half the time of a simulation and more of one with springs or loads.
"""

from __future__ import annotations

from typing import Any, TypeGuard

import numba
import numpy as np

from par4_kinematics.geometry import HOME, LEGS
from par4_sim.closed_loop.force_plate import ForcePlate, press
from par4_sim.drives.control_loop import TORQUE, ControlLoop, control_step, record_sample
from par4_sim.drives.held_load import HeldLoad, held_row
from par4_sim.drives.reference import ReferenceQueue
from par4_sim.machines.machine import LoadTorque
from par4_sim.plants.elastic import QD as MOTOR_QD
from par4_sim.plants.elastic import STIFFNESS, ElasticPlant, motor_step
from par4_sim.plants.elastic import Q as MOTOR_Q
from par4_sim.plants.exact import ExactPlant
from par4_sim.plants.exact_steps import OPEN, QD, Q, X, advance
from par4_sim.plants.plant import Plant

COMPILED = (HeldLoad, ForcePlate)
"""Loads that steps can be compiled with, one of each at the most, in this order."""
NO_LOADS: tuple[Any, ...] = (
    np.empty((0, LEGS)), 1.0, np.empty(0), np.empty(0), np.empty(0), np.array(HOME)[None],
    np.empty((0, 2)), np.zeros(1, dtype=np.int64))
"""What `_packed_loads` returns where there are no loads."""
RIGID = np.empty((4, 0)), np.empty((0, 0)), np.empty((0, 0)), 0.0, 1
"""In the place of `ElasticPlant.kernel_state` where there are no springs."""


@numba.njit(cache=True, error_model='numpy')
def _under_loads(loads, time, state, tau, dt, torque):
    """Write what loads leave of the drives' torque tau (4,); return whether the mechanism closes.

    Args:
        loads: of `_packed_loads`.
        time: at the beginning of the step, s.
        state: of the plant.
        tau: N m.
        dt: s.
        torque: (4,), written.
    """
    course, period, packed, plate, home, poses, told, count = loads
    middle = time + 0.5 * dt
    torque[:] = tau
    if course.shape[0] > 0:
        torque -= course[held_row(course.shape[0], period, middle)]
    if plate.shape[0] > 0:
        q, against = np.empty(4), np.empty(4)
        for joint in range(4):
            q[joint] = state[Q, joint] + 0.5 * dt * state[QD, joint]
        if not press(packed, plate, home, poses, told, count, middle, q, against):
            return False
        torque -= against
    return True


@numba.njit(cache=True, error_model='numpy')
def _encoder_side(motors, motor, state, q, qd):
    """Write positions and velocities (4,) where the encoders sit: of the motors before springs."""
    for joint in range(4):
        soft = motors.shape[1] > 0 and motors[STIFFNESS, joint] != np.inf
        q[joint] = motor[MOTOR_Q, joint] if soft else state[Q, joint]
        qd[joint] = motor[MOTOR_QD, joint] if soft else state[QD, joint]


@numba.njit(cache=True, error_model='numpy')
def _driven_steps(times, points, loop, plant, springs, loads, start, first, count, dt, plant_step,
                  span):
    """Do physics steps; return how many the plant did and -1, a leg out of reach, LOST or OPEN.

    Args:
        times, points: of the ReferenceQueue.
        loop: ControlLoop.kernel_state.
        plant: ExactPlant.kernel_state.
        springs: ElasticPlant.kernel_state, or RIGID.
        loads: of `_packed_loads`.
        start: time of step 0 on the queue's clock, s.
        first, count: number of the first step as the drives count, and of steps.
        dt: of the drives' steps, s.
        plant_step: number of the first step as the plant counts.
        span: of the plant's steps, s.
    """
    encoders, law, amplifier, lag, drive, currents, saturated, history, lead = loop
    constants, friction, harmonics, state, work = plant
    motors, motor_friction, motor, acts, substeps = springs
    loaded, soft = loads[0].shape[0] > 0 or loads[3].shape[0] > 0, motors.shape[1] > 0
    q, qd, passed, left = np.empty(4), np.empty(4), np.empty(4), np.empty(4)
    for done in range(count):
        step = first + done
        _encoder_side(motors, motor, state, q, qd)
        control_step(times, points, start + step * dt, q, qd, encoders, law, amplifier, lag, drive,
                     currents, saturated, history, step, lead)
        delivered = history[TORQUE, step % history.shape[1]]
        for part in range(substeps):
            inner = done * substeps + part
            torque, time = delivered, (plant_step + inner) * span
            if soft:
                motor_step(motors, motor_friction, time, delivered, state[Q], state[QD], motor,
                           span, acts, passed)
                torque = passed
            if loaded:
                if not _under_loads(loads, time, state, torque, span, left):
                    return inner, OPEN
                torque = left
            leg = advance(constants, friction, harmonics, state, work, time, torque, span)
            if leg >= 0:
                return inner, leg
    return count * substeps, -1


@numba.njit(cache=True, error_model='numpy')
def _driven_samples(times, points, loop, plant, springs, loads, recorder, start, first, dt,
                    plant_step, span, sample, substeps, ahead, waiting, readings, torque_noise,
                    position_noise, told):
    """Do all physics steps that samples need and record these; see `drive_samples`.

    Returns:
        How many steps the plant did, and -1, a leg that cannot reach, LOST or OPEN.
    """
    history, state = loop[7], plant[3]
    motors, motor = springs[0], springs[2]
    shifts, encoders, torque_step = recorder
    step, inner = first, 0
    for row in range(told.shape[0]):
        sample_step = (sample + row - 1) * substeps
        while step < sample_step + ahead:
            if step % substeps == 0:
                _encoder_side(motors, motor, state, readings[waiting, 0], readings[waiting, 1])
                readings[waiting, 2] = state[X]
                waiting += 1
            count = min(sample_step + ahead - step, substeps - step % substeps)
            done, leg = _driven_steps(times, points, loop, plant, springs, loads, start, step,
                                      count, dt, plant_step + inner, span)
            inner += done
            if leg >= 0:
                return inner, leg
            step += count
        record_sample(history, sample_step, shifts, encoders, torque_step, readings[row, 0],
                      readings[row, 1], torque_noise[row], position_noise[row], told[row])
    return inner, -1


Driven = ExactPlant | ElasticPlant
"""The exact plant, or one with motors and springs before it."""


def _exact(plant: Plant) -> Plant:
    """Return what springs drive, or the plant itself."""
    return plant.driven if type(plant) is ElasticPlant else plant


def can_be_driven(plant: Plant, loop: ControlLoop) -> TypeGuard[Driven]:
    """Return whether all that acts in a step is compiled: no other loads than those of `COMPILED`,
    no drives that look ahead.
    """
    exact = _exact(plant)
    return (type(exact) is ExactPlant and not loop.controller.stride
            and _kinds(exact.loads) in ((), COMPILED[:1], COMPILED[1:], COMPILED))


def _kinds(loads: tuple[LoadTorque, ...]) -> tuple[type, ...]:
    return tuple(type(load) for load in loads)


def _packed_loads(loads: tuple[LoadTorque, ...], steps: int) -> tuple[object, ...]:
    """Return loads as `_under_loads` takes them, with room for what they note in so many steps."""
    course, plate = NO_LOADS[:2], NO_LOADS[2:]
    for load in loads:
        if isinstance(load, HeldLoad):
            course = load.torque, load.period
        elif isinstance(load, ForcePlate):
            plate = load.kernel_state(steps)
    return *course, *plate


def _packed(plant: Driven, steps: int) -> tuple[ExactPlant, tuple[Any, ...]]:
    """Return the exact plant, and plant, springs and loads as `_driven_steps` takes them."""
    exact = _exact(plant)
    assert isinstance(exact, ExactPlant)
    springs = plant.kernel_state if isinstance(plant, ElasticPlant) else RIGID
    loads = _packed_loads(exact.loads, steps * springs[-1])
    return exact, (exact.kernel_state, springs, loads)


def drive_plant(plant: Driven, loop: ControlLoop, reference: ReferenceQueue, start: float,
                first: int, count: int) -> None:
    """Advance a plant that `can_be_driven` by `count` physics steps under its drives.

    Args:
        plant: moved on.
        loop: its drives, moved on.
        reference: what they follow; must not change meanwhile.
        start: time of step 0 on the reference's clock, s.
        first: number of the first step.
        count: of steps.

    Raises:
        UnreachableError: the platform was driven out of reach.
    """
    exact, packed = _packed(plant, count)
    done, leg = _driven_steps(reference.times, reference.points, loop.kernel_state, *packed, start,
                              first, count, plant.dt, exact.steps, exact.dt)
    exact.count_steps(done, leg)


def drive_samples(plant: Driven, loop: ControlLoop, reference: ReferenceQueue, start: float,
                  first: int, sample: int, substeps: int, ahead: int, waiting: np.ndarray,
                  torque_noise: np.ndarray, position_noise: np.ndarray
                  ) -> tuple[np.ndarray, np.ndarray]:
    """Advance a plant that `can_be_driven` by many samples under its drives; return these.

    Args:
        plant: moved on.
        loop: its drives, moved on.
        reference: what they follow; must not change meanwhile.
        start: time of step 0 on the reference's clock, s.
        first: number of the first step to do.
        sample: number of the first sample, from 1 on.
        substeps: physics steps from sample to sample.
        ahead: steps that must be done from the step of a sample on before it is recorded.
        waiting: true q, qd, x of samples that steps were done of already, (w, 3, 4).
        torque_noise, position_noise: of the samples, (n, 4) N m, rad.

    Returns:
        As `ControlLoop.record`, (n, 4, 4), and true q, qd, x of these samples and of those
        that wait now, (n + w', 3, 4).

    Raises:
        UnreachableError: the platform was driven out of reach.
    """
    count = len(torque_noise)
    steps = max(0, (sample + count - 2) * substeps + ahead - first)
    begun = -(-(first + steps) // substeps) + -first // substeps  # due in first .. first + steps
    readings = np.empty((len(waiting) + begun, 3, LEGS))
    readings[:len(waiting)] = waiting
    told = np.empty((count, 4, LEGS))
    exact, packed = _packed(plant, steps)
    done, leg = _driven_samples(
        reference.times, reference.points, loop.kernel_state, *packed, loop.recorder_state, start,
        first, plant.dt, exact.steps, exact.dt, sample, substeps, ahead, len(waiting), readings,
        torque_noise, position_noise, told)
    exact.count_steps(done, leg)
    return told, readings
