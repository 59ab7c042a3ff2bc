"""Cross-validation: torque calculated by a model over the torque measured (the paper's Fig. 7)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_dynamics.model import Model
from par4_identification.logs.log import Log
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.robot import Axis, Robot

LARGEST_ERROR = 0.3
"""Relative error above which a model does not describe a machine."""


@dataclass(frozen=True)
class Errors:
    """Errors over some rows.

    Attributes:
        rms: of the residual, (J,), N m.
        relative_error: |residual| / |torque|, (J,).
        r2: share of the torque's variance that the model explains, (J,).
        overall_relative_error: over all joints together.
        rows: number of rows of each joint, (J,).
    """

    rms: np.ndarray
    relative_error: np.ndarray
    r2: np.ndarray
    overall_relative_error: float
    rows: np.ndarray


@dataclass(frozen=True)
class Validation:
    """Measured and calculated torque of a log.

    Attributes:
        t: s since the start of the log, (m,); runs follow each other.
        measured, calculated: (m, J), N m.
        moving: rows at which friction is known, (m, J).
        everything, without_standstill: errors over all rows and over `moving` ones.
    """

    t: np.ndarray
    measured: np.ndarray
    calculated: np.ndarray
    moving: np.ndarray
    everything: Errors
    without_standstill: Errors


def errors(measured: np.ndarray, calculated: np.ndarray, rows: np.ndarray) -> Errors:
    """Return the errors (m, J) over `rows` (m, J)."""
    count = np.maximum(rows.sum(axis=0), 1)
    residual = np.where(rows, measured - calculated, 0.0)
    torque = np.where(rows, measured, 0.0)
    square, power = (residual ** 2).sum(axis=0), (torque ** 2).sum(axis=0)
    variance = power - torque.sum(axis=0) ** 2 / count
    return Errors(
        rms=np.sqrt(square / count), relative_error=np.sqrt(square / np.maximum(power, 1e-30)),
        r2=1.0 - square / np.maximum(variance, 1e-30),
        overall_relative_error=float(np.sqrt(square.sum() / max(power.sum(), 1e-30))),
        rows=rows.sum(axis=0))


def validate(log: Log, machine: Robot | Axis, model: Model,
             conditioning: Conditioning | None = None) -> Validation:
    """Return how well a model calculates the torque of a log that it was not identified from.

    Args:
        log: of another motion.
        machine: that was recorded.
        model: nothing of it is fitted.
        conditioning: filters and rates; by default the usual ones of identification.

    Raises:
        InputError: data that cannot be filtered.
        UnreachableError: joint positions with which the mechanism does not close.
    """
    runs = runs_of_log(log, machine, conditioning)
    measured = np.concatenate([run.tau for run in runs])
    calculated = np.concatenate([run.rows(model.torque(run.state)) for run in runs])
    moving = np.concatenate([run.valid for run in runs])
    return Validation(
        np.concatenate([run.t for run in runs]), measured, calculated, moving,
        errors(measured, calculated, np.ones_like(moving)), errors(measured, calculated, moving))
