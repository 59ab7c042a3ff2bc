"""Rows and evidence of machines that move exactly as planned and need the torque they are told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import State, state_of_joints
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.evidence.evidence import Evidence, gather
from par4_identification.diagnosis.evidence.observations import observe, with_nominal
from par4_identification.diagnosis.evidence.whitener import flat_whitener
from par4_identification.logs.log import Log
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Axis, Robot

NOISE = 0.05
"""N m a sample."""


def state_of_motion(robot: Robot, motion: Motion) -> State:
    """Return the state of a planned motion, whose friction is a mean over a sample as rows take it.

    A motor that turns a joint as planned needs a torque that jumps between two samples.
    """
    return state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd,
                           period=float(motion.t[1] - motion.t[0]))


def log_of(machine: Robot | Axis, t: np.ndarray, q: np.ndarray, tau: np.ndarray, seed: int,
           noise: float = NOISE) -> Log:
    """Return the log of positions and torque (n, J) with white noise of the torque, N m."""
    names = machine.joint_names if isinstance(machine, Robot) else (machine.joint,)
    tau = tau + np.random.default_rng(seed).normal(0.0, noise, tau.shape)
    return Log(name=f'planned {seed}', joint_names=names, start_stamp=0, period=float(t[1] - t[0]),
               t=t - t[0], q=q, tau=tau, segments=(slice(0, len(t)),), reference=None,
               accounts=None)


def evidence_of(logs: Log | Sequence[Log], machine: Robot | Axis, model: Model,
                noise: float = NOISE) -> Evidence:
    """Return rows whitened by the noise of the logs; the torque of `model` is the nominal one."""
    logs = [logs] if isinstance(logs, Log) else logs
    runs = [run for log in logs for run in runs_of_log(log, machine, CONDITIONING)]
    rows = observe(runs, machine, 'paper', None)
    # a row holds the noise of the torque's band only
    sigma = noise * np.sqrt(2.0 * CONDITIONING.torque_cutoff_hz * logs[0].period)
    return gather(with_nominal(rows, model), flat_whitener(rows, np.full(rows.joints, sigma)))
