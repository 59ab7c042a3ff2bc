"""Iterative learning: a motion is repeated, and each cycle corrects the torque of the next.

    tau_ff[k + 1] = tau_ff[k] + Q(feedback[k] + M(q_ref) eddot[k]),  e = q_ref - q

feedback[k] is what the drives asked for in cycle k beside the feedforward; M eddot is what was
missing of the acceleration. With the right M and without Q the machine then follows exactly: the
law inverts the closed loop. What M gets wrong by a share of r leaves r of the error, cycle after
cycle. Q, a Gaussian low-pass filter without delay, keeps out what the encoders' steps make of
eddot. Only what a real drive tells is used: encoder positions and the command. Every cycle begins
at rest, as pick and place does.

A machine that does not do at all frequencies below the cut-off what the model says, because it is
elastic or has play, would be driven further from cycle to cycle. So a cycle that is worse than the
best is not learned from: the next corrects the best one again, with half the cut-off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from par4_dynamics.mechanism import joint_mass_matrix
from par4_dynamics.model import Model
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.choices import CYCLES, STEP
from par4_sim.tracking.metrics import errors_of
from par4_sim.tracking.run import TrackedRun, record_run

CUTOFF_HZ = 100.0
"""Cut-off of the filter Q: at this frequency half of the power passes. Far above the loops'
bandwidth of some 15 Hz, far below the 500 Hz that samples a millisecond apart can carry."""


@dataclass(frozen=True)
class Cycle:
    """How one cycle was followed.

    Attributes:
        rms: error of D, m.
        joint_rms, joint_peak: error of the joint positions that the encoders tell, rad.
    """

    rms: float
    joint_rms: float
    joint_peak: float


@dataclass(frozen=True)
class Learning:
    """A motion learned.

    Attributes:
        run: the cycle with the smallest error of the joints.
        cycles: all of them.
    """

    run: TrackedRun
    cycles: tuple[Cycle, ...]


def learn(robot: Robot, machine: Model, motion: Motion, feedforward: np.ndarray, model: Model,
          cycles: int = CYCLES, fidelity: str = 'exact') -> Learning:
    """Return what repeating a motion makes of it.

    Args:
        robot: geometry, drives, limits.
        machine: as it truly is.
        motion: from rest to rest.
        feedforward: torques of the first cycle at the samples of the motion, (m, 4) N m.
        model: whose inertia the law takes.
        cycles: how often the motion is done, at least once.
        fidelity: of the plant.
    """
    inertia = joint_mass_matrix(robot.geometry, model.lumped_bodies(), motion.x)
    best, given = record_run(robot, machine, motion, feedforward, fidelity), feedforward
    history, cutoff_hz = [_cycle_of(best)], CUTOFF_HZ
    for _ in range(cycles - 1):
        corrected = _corrected(best, given, inertia, cutoff_hz)
        run = record_run(robot, machine, motion, corrected, fidelity)
        cycle = _cycle_of(run)
        if cycle.joint_rms < min(past.joint_rms for past in history):
            best, given = run, corrected
        else:
            cutoff_hz *= 0.5
        history.append(cycle)
    return Learning(best, tuple(history))


def _cycle_of(run: TrackedRun) -> Cycle:
    moving = _joint_error(run)[:len(run.motion.t)]
    return Cycle(float(np.sqrt(np.mean(np.sum(errors_of(run) ** 2, axis=1)))),
                 float(np.sqrt(np.mean(moving ** 2))), float(np.abs(moving).max()))


def _joint_error(run: TrackedRun) -> np.ndarray:
    """Return q_ref - q, rad, at the period of the motion, standing still after its end, (n, 4)."""
    motion = run.motion
    t = np.arange(int(run.t[-1] / motion.period + 1e-9) + 1) * motion.period
    wanted = np.concatenate((motion.q, np.repeat(motion.q[-1:], len(t) - len(motion.t), axis=0)))
    return wanted - _at(t, run.t, run.q)


def _corrected(run: TrackedRun, given: np.ndarray, inertia: np.ndarray, cutoff_hz: float
               ) -> np.ndarray:
    """Return the torques (m, 4), N m, that correct a run which `given` torques (m, 4) were for."""
    motion = run.motion
    width = math.sqrt(math.log(2.0)) / (2.0 * math.pi * cutoff_hz)  # s, standard deviation
    feedback = gaussian_filter1d(run.command - _at(run.t, motion.t, given), width / STEP, axis=0,
                                 mode='nearest')
    missing = gaussian_filter1d(_joint_error(run), width / motion.period, axis=0, order=2,
                                mode='nearest')
    missing = missing[:len(motion.t)] / motion.period ** 2
    learned = (given + _at(motion.t, run.t, feedback)
               + np.einsum('nij,nj->ni', inertia, missing))
    # what holds the machine at rest before and after: nothing is left to the integrals
    learned[[0, -1]] = run.command[[0, -1]]
    return learned


def _at(t: np.ndarray, known: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values (n, 4) at times t, linearly interpolated."""
    return np.stack([np.interp(t, known, column) for column in values.T], axis=1)
