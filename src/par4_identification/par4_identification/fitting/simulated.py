"""The motion that a log would show if the machine were its model: instruments without noise.

The closed loop (exact plant, drives of the robot file) follows the reference of the log (Janot,
Vandanjon and Gautier 2014).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import replace

import numpy as np

from par4_dynamics.model import Model
from par4_identification.logs.log import Log, Reference
from par4_kinematics.approach import approach_to
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Axis, Robot
from par4_sim.closed_loop.simulation import Simulation, build_simulation

PERIOD = 1e-3
"""s, of the simulated samples."""
AT_A_TIME = 200
"""Samples between two reports of progress."""
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
    if not all(np.isfinite(part).all() for part in (reference.q, reference.qd, reference.qdd)):
        raise InputError(f'{log.name}: instruments by simulation need positions, velocities and '
                         f'accelerations in every point of reference; some are missing')
    if reference.t[-1] < log.t[0] or reference.t[0] > log.t[-1]:
        raise InputError(f'{log.name}: the reference runs from {reference.t[0]:.1f} to '
                         f'{reference.t[-1]:.1f} s and the log from {log.t[0]:.1f} to '
                         f'{log.t[-1]:.1f} s; record both on one clock')
    with closing(build_simulation(with_ideal_encoders(machine), model, 'exact', PERIOD)
                 ) as simulation:
        approach = approach_to(reference.q[0], machine, simulation.q, PERIOD, 'the reference')
        lead = max(reference.t[0] - log.t[0], 0.0) + SETTLING
        shift = shift_of(reference, simulation.time + approach.duration + lead)
        q, _ = simulated_along(simulation, approach, reference, shift, log.t)
    return replace(log, q=q)


def shift_of(path: Reference, start: float) -> float:
    """Return the time of a simulation, s, at which the clock of a path is at zero.

    The path begins at `start` or, by less than a sample, later: the shift is a whole number of
    samples, so that samples of an even log fall on simulated ones.
    """
    return float(PERIOD * np.ceil((start - path.t[0]) / PERIOD))


def simulated_along(simulation: Simulation, approach: Motion, path: Reference, shift: float,
                    t: np.ndarray, progress: Callable[[float], None] | None = None
                    ) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and recorded torques (n, 4) of a machine along a path.

    Args:
        simulation: of the machine, at rest where the approach begins.
        approach: to the first point of the path.
        path: that its drives follow.
        shift: see `shift_of`.
        t: times on the clock of the path, (n,) s.
        progress: is told the share done.
    """
    from scipy.interpolate import CubicSpline  # slow to load and only needed here

    simulation.queue_reference(simulation.time + approach.t, approach.q, approach.qd, approach.qdd)
    simulation.queue_reference(shift + path.t, path.q, path.qd, path.qdd)
    count = int(np.ceil((shift + t[-1] - simulation.time) / PERIOD)) + 2
    told = simulation.time - shift + PERIOD * np.arange(count)
    q, tau = np.empty((2, count, LEGS))
    for row in range(0, count, AT_A_TIME):
        samples = simulation.next_samples(min(AT_A_TIME, count - row))
        q[row:row + AT_A_TIME], tau[row:row + AT_A_TIME] = samples.q, samples.effort
        if progress:
            progress(row / count)
    return CubicSpline(told, q)(t), CubicSpline(told, tau)(t)


def with_ideal_encoders(robot: Robot) -> Robot:
    """Return the robot with drives that read positions without rounding them to counts."""
    return robot.model_copy(update={
        'drives': robot.drives.model_copy(update={'encoder_counts': 0})})
