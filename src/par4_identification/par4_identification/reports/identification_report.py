"""The report of an identification: TABLE 1, torque over time, what is left."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from par4_dynamics.model_from_file import build_model
from par4_identification.fitting.identification import Identification
from par4_identification.logs.log import Log
from par4_identification.reports.deviation_plots import Bar, deviation_bars
from par4_identification.reports.outcome.estimator import estimator_in_words
from par4_identification.reports.outcome.identification import ParameterRow
from par4_identification.reports.page import page_of, picture_names
from par4_identification.reports.run_pictures import series_of_runs, statistics_of_runs
from par4_identification.reports.sample_traces import torque_traces, worst_run
from par4_identification.reports.steady_plots import steady_speeds_with, torque_over_speed
from par4_identification.reports.time_plots import torque_over_time
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.words import in_words, listed, number, percent, typeset, with_std


def report_of_identification(identification: Identification, outcome: Outcome,
                             rows: Sequence[ParameterRow], floor: np.ndarray,
                             machine: Robot | Axis, logs: Sequence[Log],
                             provenance: dict[str, Any],
                             masses: Mapping[str, float] | None = None) -> str:
    """Return the report of an identification.

    Args:
        identification: the fit.
        outcome: in words.
        rows: TABLE 1.
        floor: noise floor, (J,), N m.
        machine: that was identified.
        logs: the data.
        provenance: as in the model file.
        masses: log name -> known payload, kg.
    """
    names, estimate, runs = picture_names(machine), identification.estimate, identification.runs
    worst, steady = worst_run(runs, estimate.residuals), runs[0].conditioning.steady
    model = build_model(machine, identification.model_file({})).with_payload(
        (masses or {}).get(runs[worst].name, 0.0))
    paper, truth = (any(getattr(row, name) is not None for row in rows)
                    for name in ('paper', 'true'))
    printed = list(dict.fromkeys(f'{number(row.printed)} {typeset(row.unit)}'
                                 for row in rows if row.printed))
    return page_of(
        'identification.html', machine, logs, outcome, f'Identification of {machine.name}',
        'Can it be trusted?', provenance,
        rows=[_table_1_cells(row) for row in rows], paper=paper, truth=truth,
        printed=listed(printed) if printed else '', bars=_bars_of_table_1(rows, paper, truth),
        over_time='' if steady else torque_over_time(
            series_of_runs(runs, estimate.residuals), names),
        over_speed=torque_over_speed(steady_speeds_with(model, runs, float(floor[0])), names)
        if steady else '',
        traces=torque_traces(runs[worst], logs, model, estimate.residuals[worst], names),
        per_joint=[('residual rms', [number(value) for value in estimate.rms], names.torque_unit),
                   ('noise floor', [number(value) for value in floor], names.torque_unit),
                   ('residual / floor', [number(value, 2) for value in
                                         estimate.rms / np.maximum(floor, 1e-12)], '')],
        totals=f'Estimated by {estimator_in_words(identification)}. '
               f'{estimate.rows} rows; condition number of the regressor '
               f'{number(estimate.condition_number)}; relative error '
               f'{percent(estimate.relative_error)} = |residual| / |{names.torque}| in 2-norms.',
        statistics=statistics_of_runs(runs, estimate.residuals, floor, names))


def _table_1_cells(row: ParameterRow) -> dict[str, Any]:
    value, std = with_std(row.value, row.std)
    return {
        'name': in_words(row.name), 'symbol': row.symbol, 'unit': typeset(row.unit),
        'value': value, 'std': std, 'relative_std': percent(row.relative_std),
        'paper': '' if row.paper is None else f'{row.paper:g}', 'printed': bool(row.printed),
        'paper_relative_std': '' if row.paper_relative_std is None else percent(
            row.paper_relative_std, 3),
        'true': '' if row.true is None else f'{row.true:.5g}',
        'error': '' if row.true is None else percent(
            (row.value - row.true) / row.true if row.true else math.inf)}


def _bars_of_table_1(rows: Sequence[ParameterRow], paper: bool, truth: bool) -> str:
    bars = []
    for row in rows:
        zero = row.paper if paper else row.value
        if not zero:
            continue  # an offset of the paper's machine, or a value at its limit: no deviation
        values, stds = [(row.value - zero) / zero], [row.std / abs(zero)]
        if paper and row.paper_relative_std is not None:
            values.append(0.0)
            stds.append(row.paper_relative_std)
        if truth and row.true is not None:
            values.append((row.true - zero) / zero)
            stds.append(0.0)
        bars.append(Bar(in_words(row.name), tuple(values), tuple(stds)))
    legend = ['identified', *(['paper'] if paper else []), *(['true'] if truth else [])]
    return deviation_bars(bars, legend, 'deviation from the paper, %' if paper else
                          'interval of the value, %')
