"""How well identification can be expected to know the base parameters from a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_dynamics.base_terms import base_columns, base_terms
from par4_dynamics.model import Model
from par4_identification.logs.accounts import accounts_of_motion
from par4_identification.logs.log import Log
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import low_pass
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot

NOISE_LAGS = 10
"""Rows over which the filter correlates white noise."""


@dataclass(frozen=True)
class Precision:
    """What to expect of an identification from one motion.

    Attributes:
        std: standard deviation by parameter, in its unit.
        relative_std: the same over the values of the model.
        condition_number: of the stacked W, as `identification.json` has it.
        collinearity: the same with columns of equal length: 1 where none resembles another.
        rows: fraction of the rows that are valid.
    """

    std: dict[str, float]
    relative_std: dict[str, float]
    condition_number: float
    collinearity: float
    rows: float


def expected_precision(motion: Motion, robot: Robot, model: Model, noise: np.ndarray) -> Precision:
    """Return what white torque noise leaves uncertain after a motion, tracked exactly.

    The rows are made as identification makes them: filtered, masked at low speed. The covariance
    is that of its least squares, (sum W^T S^-1 W)^-1 between the scores' own covariance, the rows'
    noise being correlated as the filter correlates it. Encoder noise is left out.

    Args:
        motion: sampled at the rate of the log.
        robot, model: the machine; the values of the model only scale `relative_std`.
        noise: of the torque of each joint, N m rms a sample, (4,).

    Raises:
        InputError: a motion too short or too coarse for the filters.
    """
    conditioning = Conditioning()
    log = Log(name=motion.name, joint_names=robot.joint_names, start_stamp=0, period=motion.period,
              t=motion.t, q=motion.q, tau=np.zeros_like(motion.q),
              segments=(slice(0, len(motion.t)),), reference=None,
              accounts=accounts_of_motion(motion.name, len(motion.t), motion.period))
    run, = runs_of_log(log, robot, conditioning)
    columns = run.rows(base_columns(run.state))
    rows = columns * (run.valid / noise)[..., None]
    correlation = _row_correlation(conditioning, motion.period)
    size = rows.shape[-1]
    information, scores = np.zeros((size, size)), np.zeros((size, size))
    for joint in range(rows.shape[1]):
        of_joint = rows[:, joint]
        gram = of_joint.T @ of_joint
        information += gram
        scores += correlation[0] * gram
        for lag in range(1, len(correlation)):
            shifted = correlation[lag] * of_joint[lag:].T @ of_joint[:-lag]
            scores += shifted + shifted.T
    inverse = np.linalg.inv(information)
    std = np.sqrt(np.diag(inverse @ scores @ inverse))
    names = [term.name for term in base_terms(run.state)]
    values = np.array([model.values[name].mean() for name in names])
    stacked = columns[run.valid]
    return Precision(
        std=dict(zip(names, std.tolist(), strict=True)),
        relative_std={name: float(one / abs(value)) if value else np.inf
                      for name, one, value in zip(names, std, values, strict=True)},
        condition_number=float(np.linalg.cond(stacked)),
        collinearity=float(np.linalg.cond(stacked / np.linalg.norm(stacked, axis=0))),
        rows=float(run.valid.mean()))


def _row_correlation(conditioning: Conditioning, period: float) -> np.ndarray:
    """Return the autocovariance (k,) of rows of white noise of variance 1."""
    every = max(1, round(1.0 / (conditioning.row_rate_hz * period)))
    impulse = np.zeros(2 * NOISE_LAGS * every + 1)
    impulse[NOISE_LAGS * every] = 1.0
    response = low_pass(impulse, conditioning.torque_cutoff_hz, period)
    return np.array([response[lag:] @ response[:len(response) - lag]
                     for lag in range(0, NOISE_LAGS * every, every)])
