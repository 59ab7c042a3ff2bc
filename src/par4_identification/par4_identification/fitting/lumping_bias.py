"""By how much (20) misses base parameters because it lumps rods and bars at their ends.

What the distributed bodies of the robot file add to (20) is no noise: it moves with the columns of
(20) and is taken for them. Its projection onto these columns, along the same motion, with the same
filters and weights, is the bias. It depends on the motion. What the projection leaves, a torque of
some hundredths of a newton metre, stands in the residual and tells whether the machine is such.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import base_columns, distributed_torque
from par4_identification.estimators.covariance import sandwich
from par4_identification.fitting.identification import Fitting, Identification, identify_runs
from par4_identification.signals.run import Run
from par4_kinematics.robot import Robot


@dataclass(frozen=True)
class Lumping:
    """What lumping does to the values of an identification as 'paper'.

    Attributes:
        bias: of the values if rods and bars are as in the robot file, (p,).
        share: of that which the residual shows: 1 if they are, 0 if the machine obeys (20).
        share_std: its standard deviation.
    """

    bias: np.ndarray
    share: float
    share_std: float


def lumping_of(identification: Identification, robot: Robot) -> Lumping:
    """Return bias and share of an identification as 'paper'; the residual tells the share.

    The share is the regression of the residual on what the projection leaves; its deviation holds
    for coloured residuals.
    """
    fit = _projection(identification.runs, robot, identification.fitting)
    weight = 1.0 / np.maximum(identification.estimate.rms, 1e-12) ** 2
    pairs = [(left, residual, run.valid * weight) for left, residual, run in
             zip(fit.estimate.residuals, identification.estimate.residuals, fit.runs, strict=True)]
    square = sum(np.sum(left ** 2 * weights) for left, _, weights in pairs)
    share = sum(np.sum(left * residual * weights) for left, residual, weights in pairs) / square
    scores = [np.sum(left * (residual - share * left) * weights, axis=1)[:, None]
              for left, residual, weights in pairs]
    covariance = sandwich(np.array([[1.0 / square]]), scores, fit.estimate.rows)
    return Lumping(fit.estimate.values, float(share), float(np.sqrt(covariance[0, 0])))


def lumping_bias(runs: Sequence[Run], robot: Robot, fitting: Fitting | None = None) -> np.ndarray:
    """Return the bias of values identified as 'paper', in their units and order, (p,).

    Weighted least squares, whatever the estimator was; the measured torque does not count.

    Raises:
        InputError: motion that does not excite the parameters.
    """
    return _projection(runs, robot, fitting or Fitting()).estimate.values


def _projection(runs: Sequence[Run], robot: Robot, fitting: Fitting) -> Identification:
    left_out = [run.rows(distributed_torque(robot.bodies, run.state)) for run in runs]
    bases = [run.rows(base_columns(run.state)) for run in runs]
    return identify_runs(runs, left_out, bases, 'paper', replace(fitting, estimator='weighted'))
