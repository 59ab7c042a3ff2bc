"""The noise floor: what would be left if the model were perfect."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.model import Model
from par4_identification.diagnosis.search.law import dithered_state
from par4_identification.signals.rows import Run
from par4_kinematics.robot import Axis, Robot

WINDOW = 30
"""Rows of a stretch of standstill in which torque noise is measured."""
LEAST_WINDOWS = 3
LONGEST = 60_000
"""Samples of a run that tell what encoder counts do; more move the result by a few percent."""


def torque_noise(runs: Sequence[Run]) -> np.ndarray:
    """Return the standard deviation (J,), N m, of the torque noise in the rows.

    The level above the pass band, which motion with jumps of acceleration raises, or, where there
    are enough dwells and they show more, that of dwells, where little but noise moves the torque. A
    resting drive creeps and now and then breaks loose: slow parts are taken out of each window and
    the median window counts.
    """
    floor = np.sqrt(np.mean([run.noise_floor ** 2 for run in runs], axis=0))
    time = np.arange(WINDOW)
    for joint in range(len(floor)):
        variances = []
        for run in runs:
            resting, tau = run.standstill[:, joint], run.tau[:, joint]
            for first in range(0, len(tau) - WINDOW + 1, WINDOW):
                window = slice(first, first + WINDOW)
                if resting[window].all():
                    left = tau[window] - np.polyval(np.polyfit(time, tau[window], 2), time)
                    variances.append(left @ left / (WINDOW - 3))
        if len(variances) >= LEAST_WINDOWS:
            floor[joint] = max(floor[joint], np.sqrt(np.median(variances)))
    return floor


def encoder_noise(runs: Sequence[Run], machine: Robot | Axis, model: Model) -> np.ndarray:
    """Return the standard deviation (J,), N m, that the encoder's counts cause in the torque.

    The model's torque is calculated again from positions dithered by one count.
    """
    joints = runs[0].tau.shape[1]
    counts = machine.drives.encoder_counts if isinstance(machine, Robot) else 0
    if counts == 0:
        return np.zeros(joints)
    random = np.random.default_rng(0)
    squares, rows = np.zeros(joints), np.zeros(joints)
    for run in runs:
        state = run.state.part(slice(0, LONGEST))
        moved = dithered_state(run, state, counts, random)
        # friction's sign is the same: rows near its change are not used
        change = run.rows(model.torque(moved) - model.torque(state))
        valid = run.valid[:len(change)]
        squares += np.sum(np.where(valid, change, 0.0) ** 2, axis=0)
        rows += valid.sum(axis=0)
    return np.sqrt(squares / np.maximum(rows, 1))


def noise_floor(runs: Sequence[Run], machine: Robot | Axis, model: Model) -> np.ndarray:
    """Return the standard deviation (J,), N m, of the rows' residual under a perfect model."""
    return np.hypot(torque_noise(runs), encoder_noise(runs, machine, model))
