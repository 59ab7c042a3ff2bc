"""The motion that a log would show if the machine were its model: instruments without noise.

The closed loop (exact plant, drives of the robot file) follows the reference of the log (Janot,
Vandanjon and Gautier 2014).
"""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace

import numpy as np

from par4_dynamics.model import Model
from par4_identification.logs.log import Log
from par4_kinematics.approach import approach_to
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot
from par4_sim.closed_loop.simulation import build_simulation

PERIOD = 1e-3
"""s, of the simulated samples."""
SETTLING = 0.2
"""Seconds of rest between an approach and the reference."""


def simulated_log(log: Log, machine: Robot | Axis, model: Model) -> Log:
    """Return the log with the positions of a simulation along its reference; torques stay.

    The machine approaches the first point of the reference from home and follows from there.

    Raises:
        InputError: no robot to simulate, or no complete reference in the log.
        UnreachableError: the simulated machine leaves its workspace.
    """
    if not isinstance(machine, Robot):
        raise InputError(f'{log.name}: instruments by simulation asked of the axis {machine.name}; '
                         f'only a Par4 can be simulated; use another estimator')
    reference = log.reference
    if reference is None:
        raise InputError(f'{log.name}: instruments by simulation need the motion that was asked '
                         f'for; record the topic reference too, or use another estimator')
    points = (reference.q, reference.qd, reference.qdd)
    if not all(np.isfinite(part).all() for part in points):
        raise InputError(f'{log.name}: instruments by simulation need positions, velocities and '
                         f'accelerations in every point of reference; some are missing')
    if reference.t[-1] < log.t[0] or reference.t[0] > log.t[-1]:
        raise InputError(f'{log.name}: the reference runs from {reference.t[0]:.1f} to '
                         f'{reference.t[-1]:.1f} s and the log from {log.t[0]:.1f} to '
                         f'{log.t[-1]:.1f} s; record both on one clock')
    from scipy.interpolate import CubicSpline  # slow to load and only needed here

    with closing(build_simulation(with_ideal_encoders(machine), model, 'exact', PERIOD)
                 ) as simulation:
        approach = approach_to(reference.q[0], machine, simulation.q, PERIOD, 'the reference')
        times = simulation.time + approach.t
        lead = max(reference.t[0] - log.t[0], 0.0) + SETTLING
        # a whole number of samples, so that samples of an even log fall on simulated ones
        shift = PERIOD * np.ceil((times[-1] + lead - reference.t[0]) / PERIOD)
        simulation.queue_reference(times, approach.q, approach.qd, approach.qdd)
        simulation.queue_reference(shift + reference.t, *points)

        count = int(np.ceil((shift + log.t[-1] - simulation.time) / PERIOD)) + 2
        t = simulation.time - shift + PERIOD * np.arange(count)
        q = simulation.next_samples(count).q
    return replace(log, q=CubicSpline(t, q)(log.t))


def with_ideal_encoders(robot: Robot) -> Robot:
    """Return the robot with drives that read positions without rounding them to counts."""
    return robot.model_copy(update={
        'drives': robot.drives.model_copy(update={'encoder_counts': 0})})
