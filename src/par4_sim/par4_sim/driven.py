"""Physics steps of the exact plant under its drives, many in one compiled call.

What `ControlLoop.torque` and `ExactPlant.step` do in turn, with the same kernels and so to the
last digit the same; only the way from the one to the other through Python is saved, half the time
of a simulation.
"""

from __future__ import annotations

from typing import Any, TypeGuard

import numba
import numpy as np

from par4_kinematics.geometry import HOME, LEGS
from par4_sim.control_loop import TORQUE, ControlLoop, control_step, record_sample
from par4_sim.exact import OPEN, QD, ExactPlant, Q, X, advance
from par4_sim.force_plate import ForcePlate, press
from par4_sim.held_load import HeldLoad, held_row
from par4_sim.machine import LoadTorque
from par4_sim.plant import Plant
from par4_sim.reference import ReferenceQueue

COMPILED = (HeldLoad, ForcePlate)
"""Loads that steps can be compiled with, one of each at the most, in this order."""
NO_LOADS: tuple[Any, ...] = (
    np.empty((0, LEGS)), 1.0, np.empty(0), np.empty(0), np.empty(0), np.array(HOME)[None],
    np.empty((0, 2)), np.zeros(1, dtype=np.int64))
"""What `_packed_loads` returns where there are none."""


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
def _driven_steps(times, points, loop, plant, loads, start, plant_step, first, count, dt):
    """Do physics steps; return how many were done and -1, a leg that cannot reach, LOST or OPEN.

    Args:
        times, points: of the ReferenceQueue.
        loop: ControlLoop.kernel_state.
        plant: ExactPlant.kernel_state.
        loads: of `_packed_loads`.
        start: time of step 0 on the queue's clock, s.
        plant_step: number of the first step as the plant counts.
        first, count: number of the first step as the drives count, and of steps.
        dt: s.
    """
    encoders, law, amplifier, lag, drive, currents, saturated, history, lead = loop
    constants, friction, harmonics, state, work = plant
    loaded, torque = loads[0].shape[0] > 0 or loads[3].shape[0] > 0, np.empty(4)
    for done in range(count):
        step = first + done
        control_step(times, points, start + step * dt, state[Q], state[QD], encoders, law,
                     amplifier, lag, drive, currents, saturated, history, step, lead)
        delivered, time = history[TORQUE, step % history.shape[1]], (plant_step + done) * dt
        if not loaded:
            torque = delivered
        elif not _under_loads(loads, time, state, delivered, dt, torque):
            return done, OPEN
        leg = advance(constants, friction, harmonics, state, work, time, torque, dt)
        if leg >= 0:
            return done, leg
    return count, -1


@numba.njit(cache=True, error_model='numpy')
def _driven_samples(times, points, loop, plant, loads, recorder, start, plant_step, first, dt,
                    sample, substeps, ahead, waiting, readings, torque_noise, position_noise, told):
    """Do all physics steps that samples need and record these; see `drive_samples`.

    Returns:
        How many steps were done, and -1, a leg that cannot reach, LOST or OPEN.
    """
    history, state = loop[7], plant[3]
    shifts, encoders, torque_step = recorder
    step = first
    for row in range(told.shape[0]):
        sample_step = (sample + row - 1) * substeps
        while step < sample_step + ahead:
            if step % substeps == 0:
                readings[waiting, 0], readings[waiting, 1] = state[Q], state[QD]
                readings[waiting, 2] = state[X]
                waiting += 1
            count = min(sample_step + ahead - step, substeps - step % substeps)
            done, leg = _driven_steps(times, points, loop, plant, loads, start,
                                      plant_step + step - first, step, count, dt)
            step += done
            if leg >= 0:
                return step - first, leg
        record_sample(history, sample_step, shifts, encoders, torque_step, readings[row, 0],
                      readings[row, 1], torque_noise[row], position_noise[row], told[row])
    return step - first, -1


def can_be_driven(plant: Plant, loop: ControlLoop) -> TypeGuard[ExactPlant]:
    """Return whether all that acts in a step is compiled: no other loads than those of `COMPILED`,
    no drives that look ahead.
    """
    return (type(plant) is ExactPlant and not loop.controller.stride
            and _kinds(plant.loads) in ((), COMPILED[:1], COMPILED[1:], COMPILED))


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


def drive_plant(plant: ExactPlant, loop: ControlLoop, reference: ReferenceQueue, start: float,
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
    done, leg = _driven_steps(
        reference.times, reference.points, loop.kernel_state, plant.kernel_state,
        _packed_loads(plant.loads, count), start, plant.steps, first, count, plant.dt)
    plant.count_steps(done, leg)


def drive_samples(plant: ExactPlant, loop: ControlLoop, reference: ReferenceQueue, start: float,
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
    done, leg = _driven_samples(
        reference.times, reference.points, loop.kernel_state, plant.kernel_state,
        _packed_loads(plant.loads, steps), loop.recorder_state, start, plant.steps, first,
        plant.dt, sample, substeps, ahead, len(waiting), readings, torque_noise, position_noise,
        told)
    plant.count_steps(done, leg)
    return told, readings
