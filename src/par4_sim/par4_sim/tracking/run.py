"""One motion of a simulated machine, recorded with what only a simulation knows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.choices import STEP
from par4_sim.closed_loop.simulation import build_simulation

REST = 0.2
"""Seconds of rest before the motion: the drives settle."""
RECORDED_REST = 0.02
"""Seconds of this rest that are recorded."""
SETTLING = 0.5
"""Seconds recorded after the end of the motion: the platform comes to rest."""


@dataclass(frozen=True)
class TrackedRun:
    """What a machine did when a motion was asked of it; n samples, one a physics step.

    Attributes:
        motion: as asked.
        t: s, 0 at the beginning of the motion, from a short rest before it on, (n,).
        pose: true pose of D and theta, (n, 4) m, rad.
        q, qd: what the encoders told, (n, 4) rad, rad/s.
        command: torque that the drives asked for, (n, 4) N m.
        torque: torque that the amplifiers delivered, (n, 4) N m.
        feedforward: torque given to the drives at the samples of the motion, (m, 4) N m; None
            where they got none.
        counts: what went wrong in these samples, by name, as `Simulation.counts`.
        limited: how many of the 4 n joint samples had a limited torque or speed.
    """

    motion: Motion
    t: np.ndarray
    pose: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    command: np.ndarray
    torque: np.ndarray
    feedforward: np.ndarray | None
    counts: dict[str, int]
    limited: int


def feedforward_of(robot: Robot, model: Model, motion: Motion) -> np.ndarray:
    """Return the torques (m, 4), N m, that a model asks for at the samples of a motion."""
    return model.torque(
        state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd))


def record_run(robot: Robot, machine: Model, motion: Motion, feedforward: np.ndarray | None,
               fidelity: str = 'exact', law: str = 'loops', known: Model | None = None
               ) -> TrackedRun:
    """Return the run of a machine that rests where the motion begins and then follows it.

    Args:
        robot: geometry, drives, limits.
        machine: as it truly is.
        motion: what its drives follow.
        feedforward: torques at the samples of the motion, (m, 4) N m, or None.
        fidelity: of the plant.
        law: of the drives, one of LAWS.
        known: model that the law knows, where it needs one.

    Raises:
        InputError: as `build_simulation`.
        UnreachableError: the machine was driven out of its workspace.
    """
    simulation = build_simulation(robot, machine, fidelity, STEP, pose=motion.x[0], law=law,
                                  known=known)
    try:
        start = simulation.time + REST
        simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
        if feedforward is not None:
            simulation.queue_effort(start + motion.t, feedforward)
        first = -round(RECORDED_REST / STEP)
        before = round(REST / STEP) + first
        count = round((motion.duration + SETTLING) / STEP) + 1 - first
        simulation.next_samples(before)
        earlier, limited = simulation.counts, simulation.limited
        told = simulation.next_samples(count)
        counts = {name: number - earlier[name] for name, number in simulation.counts.items()}
        limited = simulation.limited - limited
    finally:
        simulation.close()
    if feedforward is None:
        counts.pop('missing_effort')
    return TrackedRun(
        motion, STEP * np.arange(first, first + count), told.true_pose, told.q, told.qd,
        told.effort, told.true_torque, feedforward, counts, limited)
