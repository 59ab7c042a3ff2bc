"""Pictures of the rows of runs: joined in time, and the statistics of what is left."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.reports.names import Names
from par4_identification.reports.outcome.identification import autocorrelation
from par4_identification.reports.residual_plots import residual_statistics
from par4_identification.reports.time_plots import TorqueTraces
from par4_identification.signals.run import Run

LAGS = 50
"""Rows over which autocorrelations are drawn."""
BETWEEN_LOGS = 0.5
"""Seconds between two logs on one time axis."""


def joined_time(runs: Sequence[Run]) -> np.ndarray:
    """Return one time axis for the rows of runs: logs follow each other, gaps stay."""
    times, offset, name, end = [], 0.0, None, 0.0
    for run in runs:
        if name is not None and run.name != name:
            offset = end + BETWEEN_LOGS - float(run.t[0])
        times.append(run.t + offset)
        name, end = run.name, float(times[-1][-1])
    return np.concatenate(times)


def series_of_runs(runs: Sequence[Run], residuals: Sequence[np.ndarray]) -> TorqueTraces:
    """Return measured and calculated torque of runs on one time axis, from residuals (m, J)."""
    measured = np.concatenate([run.tau for run in runs])
    return TorqueTraces(joined_time(runs), np.concatenate([run.speed for run in runs]), measured,
                        measured - np.concatenate(residuals),
                        np.concatenate([run.valid for run in runs]))


def statistics_of_runs(runs: Sequence[Run], residuals: Sequence[np.ndarray], floor: np.ndarray,
                       names: Names) -> str:
    """Return histogram and autocorrelation of what is left of each joint; '' of steady speeds.

    Args:
        runs: whose valid rows count.
        residuals: of each run, (m, J).
        floor: noise floor, (J,).
        names: labels.
    """
    if runs[0].conditioning.steady:
        return ''  # too few rows, which do not follow each other
    valid = [run.valid for run in runs]
    left = [np.concatenate([part[mask[:, joint], joint]
                            for part, mask in zip(residuals, valid, strict=True)])
            for joint in range(len(names.joints))]
    return residual_statistics(
        left, floor, autocorrelation(residuals, valid, LAGS + 1),
        np.array([len(values) for values in left]), runs[0].row_time, names)
