"""Physics steps of the exact plant under its drives, many in one compiled call.

What `ControlLoop.torque` and `ExactPlant.step` do in turn, with the same kernels and so to the
last digit the same; only the way from the one to the other through Python is saved, half the time
of a simulation.
"""

from __future__ import annotations

from typing import TypeGuard

import numba

from par4_sim.control_loop import TORQUE, ControlLoop, control_step
from par4_sim.exact import QD, ExactPlant, Q, advance
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
