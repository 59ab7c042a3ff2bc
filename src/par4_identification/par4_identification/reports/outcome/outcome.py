"""What outcomes of several tools say of the data and of errors."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.diagnosis.search.rules import Rules
from par4_identification.logs.log import Log
from par4_sim.report.outcome import Remark

FLOOR_EXCESS = Rules().floor_excess
"""Residual over noise floor above which a model misses something."""

LOUD = 0.2
"""Share of the torque that a model without a fault may leave without a word."""


def data_remark(logs: Sequence[Log]) -> Remark:
    """Return whether the data needed repair."""
    repairs = sum(len(log.bag_accounts.findings()) for log in logs)
    if not repairs:
        return Remark(True, 'The data needed no repair.')
    return Remark(False, f'The data needed {repairs} repair{"s" if repairs > 1 else ""}, listed '
                         f'under "What was read" and in the data of the JSON file.')


def duration(logs: Sequence[Log]) -> float:
    """Return the measured time of all logs, s."""
    return sum(log.bag_accounts.duration for log in logs)


def over_joints(rms: np.ndarray) -> float:
    """Return one number for the rms (J,) of joints that count alike."""
    return float(np.sqrt(np.mean(np.square(rms))))
