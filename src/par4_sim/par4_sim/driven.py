"""Physics steps of the exact plant under its drives, many in one compiled call.

What `ControlLoop.torque` and `ExactPlant.step` do in turn, with the same kernels and so to the
last digit the same; only the way from the one to the other through Python is saved, half the time
of a simulation.
"""

from __future__ import annotations

from typing import TypeGuard

import numba
import numpy as np

from par4_kinematics.geometry import LEGS
from par4_sim.control_loop import TORQUE, ControlLoop, control_step, record_sample
from par4_sim.exact import QD, ExactPlant, Q, X, advance
from par4_sim.plant import Plant
from par4_sim.reference import ReferenceQueue


@numba.njit(cache=True, error_model='numpy')
def _driven_steps(times, points, loop, plant, start, plant_step, first, count, dt):
    """Do physics steps; return how many were done and -1, a leg that cannot reach, or LOST.

    Args:
        times, points: of the ReferenceQueue.
        loop: ControlLoop.kernel_state.
        plant: ExactPlant.kernel_state.
        start: time of step 0 on the queue's clock, s.
        plant_step: number of the first step as the plant counts.
        first, count: number of the first step as the drives count, and of steps.
        dt: s.
    """
    encoders, law, amplifier, lag, drive, currents, saturated, history, lead = loop
    constants, friction, harmonics, state, work = plant
    for done in range(count):
        step = first + done
        control_step(times, points, start + step * dt, state[Q], state[QD], encoders, law,
                     amplifier, lag, drive, currents, saturated, history, step, lead)
        leg = advance(constants, friction, harmonics, state, work, (plant_step + done) * dt,
                      history[TORQUE, step % history.shape[1]], dt)
        if leg >= 0:
            return done, leg
    return count, -1


@numba.njit(cache=True, error_model='numpy')
def _driven_samples(times, points, loop, plant, recorder, start, plant_step, first, dt, sample,
                    substeps, ahead, waiting, readings, torque_noise, position_noise, told):
    """Do all physics steps that samples need and record these; see `drive_samples`.

    Returns:
        How many steps were done, and -1, a leg that cannot reach, or LOST.
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
            done, leg = _driven_steps(times, points, loop, plant, start, plant_step + step - first,
                                      step, count, dt)
            step += done
            if leg >= 0:
                return step - first, leg
        record_sample(history, sample_step, shifts, encoders, torque_step, readings[row, 0],
                      readings[row, 1], torque_noise[row], position_noise[row], told[row])
    return step - first, -1


def can_be_driven(plant: Plant, loop: ControlLoop) -> TypeGuard[ExactPlant]:
    """Return whether all that acts in a step is compiled: no loads, no drives that look ahead."""
    return type(plant) is ExactPlant and not plant.loads and not loop.controller.stride


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
    done, leg = _driven_steps(reference.times, reference.points, loop.kernel_state,
                              plant.kernel_state, start, plant.steps, first, count, plant.dt)
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
        loop.recorder_state, start, plant.steps, first, plant.dt, sample, substeps, ahead,
        len(waiting), readings, torque_noise, position_noise, told)
    plant.count_steps(done, leg)
    return told, readings
