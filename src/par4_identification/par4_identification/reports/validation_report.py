"""The report of a cross-validation: errors a joint, torque over time, what is left."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_identification.fitting.validation import Validation
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.reports.outcome.validation import errors_by_joint, total_errors
from par4_identification.reports.page import joint_cells, page_of, picture_names
from par4_identification.reports.run_pictures import series_of_runs, statistics_of_runs
from par4_identification.reports.sample_traces import torque_traces, worst_run
from par4_identification.reports.steady_plots import steady_speeds_with, torque_over_speed
from par4_identification.reports.time_plots import torque_over_time
from par4_identification.signals.run import Run
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.words import number, percent


def report_of_validation(validation: Validation, outcome: Outcome, runs: Sequence[Run],
                         floor: np.ndarray, machine: Robot | Axis, log: Log,
                         model_file: ModelFile) -> str:
    """Return the report of a cross-validation.

    Args:
        validation: errors, over the rows of `runs`.
        outcome: in words.
        runs: of the log.
        floor: noise floor, (J,), N m.
        machine: that was measured.
        log: the data.
        model_file: the model that was validated.
    """
    names = picture_names(machine)
    ends = np.cumsum([0, *(len(run.t) for run in runs)])
    residual = validation.measured - validation.calculated
    residuals = [residual[first:end] for first, end in pairwise(ends)]
    worst, model = worst_run(runs, residuals), build_model(machine, model_file)
    steady = runs[0].conditioning.steady
    table = []
    for title, errors, rows in (
            ('', validation.without_standstill, validation.moving),
            (', standstill included', validation.everything, np.ones_like(validation.moving))):
        total, found = total_errors(validation, rows), errors_by_joint(errors)
        for name, key, unit, text in (('residual rms', 'rms', names.torque_unit, number),
                                      ('relative error', 'relative_error', '', percent),
                                      ('R²', 'r2', '', lambda value: number(value, 5))):
            table.append((name + title, joint_cells(found[key], total[key], text), unit))
    table.insert(1, ('noise floor', joint_cells(floor, over_joints(floor), number),
                     names.torque_unit))
    return page_of(
        'validation.html', machine, [log], outcome, f'Cross-validation on {machine.name}',
        'How good is it?', model_file.provenance,
        facts_title='Where the model comes from',
        over_time='' if steady else torque_over_time(series_of_runs(runs, residuals), names),
        over_speed=torque_over_speed(steady_speeds_with(model, runs, float(floor[0])), names)
        if steady else '', per_joint=table,
        traces=torque_traces(runs[worst], [log], model, residuals[worst], names),
        statistics=(statistics_of_runs(runs, residuals, floor, names)
                    if validation.moving.any() else ''))
