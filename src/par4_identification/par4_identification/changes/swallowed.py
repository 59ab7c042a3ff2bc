"""What an old model may have swallowed: causes that were there before and that it lacks.

A model identified without a cause has base parameters that hold some of it. How much depends on
the motion that it was identified from, which nobody knows. What it would be on stretches of the
present data is what it may have been: each is a direction that counts as chance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from par4_identification.changes.joint_values import JointValues, torque_of_causes
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.signals.plateaus import LEAST_PLATEAUS

VAGUER = 4.0
"""Ratio of a parameter's deviations up to which somebody identifies a model from a stretch in place
of the whole motion: a third of it makes less than two, its slow part alone twenty and more."""
PARTS = 3
"""Stretches of each part of the data, by time and by speed, beside the whole of it."""


def swallowed_values(after: JointValues, data: Sequence[Observations], shared: bool) -> np.ndarray:
    """Return by what base parameters may be off that hold a cause, (k, J p).

    Args:
        after: parameters with the causes fitted beside them.
        data: rows of the present motions.
        shared: whether the old model has one number for all joints of each parameter.
    """
    joints, size = after.values.shape
    found = [after.bias] if len(after.bias) else [np.zeros((0, joints * size))]
    for observations in data:
        base = np.concatenate(observations.base)  # (m, J, p)
        whole, *parts = _stretches(observations)
        known = _deviations(base, whole)
        stretches = [whole, *(rows for rows in parts
                              if np.all(_deviations(base, rows) <= VAGUER * known))]
        for cause in after.causes:
            torque = np.concatenate(torque_of_causes([cause], observations))
            for rows in stretches:
                if observations.steady and rows.sum(axis=0).min() < LEAST_PLATEAUS:
                    continue  # nobody identifies a model from so few
                found.append(_followed(base, torque, rows, shared).reshape(1, -1))
    return np.concatenate(found)


def _deviations(base: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return what the deviations of parameters (p,) go with that are fitted on some rows (m, J)."""
    design = base[rows]
    scale = np.maximum(np.linalg.norm(design, axis=0), 1e-30)
    inverse = np.linalg.pinv((design / scale).T @ (design / scale), hermitian=True)
    return np.sqrt(np.diagonal(inverse)) / scale


def _followed(base: np.ndarray, torque: np.ndarray, rows: np.ndarray, shared: bool) -> np.ndarray:
    """Return the parameters (J, p) that follow a torque (m, J) on some rows (m, J) best."""
    if shared:
        values = np.linalg.lstsq(base[rows], torque[rows], rcond=1e-9)[0]
        return np.tile(values, (torque.shape[1], 1))
    return np.stack([np.linalg.lstsq(base[rows[:, joint], joint], torque[rows[:, joint], joint],
                                     rcond=1e-9)[0] for joint in range(torque.shape[1])])


def _stretches(observations: Observations) -> Iterator[np.ndarray]:
    """Yield which rows (m, J) are in each stretch."""
    valid = np.concatenate([run.valid for run in observations.runs])
    speed = np.abs(np.concatenate([run.speed for run in observations.runs])).max(axis=1)
    yield valid
    place = np.arange(len(valid)) * PARTS // len(valid)
    pace = np.searchsorted(np.quantile(speed, np.arange(1, PARTS) / PARTS), speed)
    for part in range(PARTS):
        yield valid & (place == part)[:, None]
        yield valid & (pace == part)[:, None]
