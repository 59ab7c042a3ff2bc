"""Measured and calculated torque at every sample of a log, for the traces of a page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.model import Model
from par4_identification.logs.log import Log
from par4_identification.reports.names import Names
from par4_identification.signals.run import Run
from par4_sim.report.drawing import CALCULATED, MEASURED
from par4_sim.report.traces import Trace, Traces, shown_part, traces_of


def torque_traces(run: Run, logs: Sequence[Log], model: Model, residual: np.ndarray, names: Names
                  ) -> Traces | None:
    """Return the torque of a run as it was recorded, unfiltered, and as a model calculates it.

    Of a long run the part is taken in which the residual is largest. There is none of steady
    speeds, each of which is one row, and of a run whose log is not at hand.

    Args:
        run: of one of the logs.
        logs: that were read.
        model: calculates the torque.
        residual: of the run's rows, (m, J).
        names: labels.
    """
    log = next((log for log in logs if log.name == run.name), None)
    if log is None or run.conditioning.steady:
        return None
    state = run.state
    size = np.interp(state.t, run.t, np.linalg.norm(np.where(run.valid, residual, 0.0), axis=1))
    part = shown_part(state.t, size, 2 * len(names.joints))
    shown = state.part(part)
    # columns of a slow log of an axis are computed between its samples, too
    measured = np.column_stack([np.interp(shown.t, log.t, torque) for torque in log.tau.T])
    return traces_of(
        shown.t, [Trace('measured', MEASURED, measured),
                  Trace('calculated', CALCULATED, model.torque(shown))],
        names.joints, f'{names.torque}, {names.torque_unit}')


def worst_run(runs: Sequence[Run], residuals: Sequence[np.ndarray]) -> int:
    """Return which run has the largest mean square of its valid residuals (m, J)."""
    return int(np.argmax([np.sum(np.where(run.valid, part, 0.0) ** 2) / max(run.valid.sum(), 1)
                          for run, part in zip(runs, residuals, strict=True)]))
