"""The report of a diagnosis: what was found, and what it is held against."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from par4_dynamics.model_from_file import torque_model
from par4_identification.changes.between_logs import LogDifferences
from par4_identification.changes.changes import Changes
from par4_identification.confrontation.confrontation import Confrontation, Unsimulated
from par4_identification.diagnosis.experiment.next_experiment import NextExperiment
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_identification.diagnosis.verdict.judgement import UnnamedCause
from par4_identification.logs.log import Log
from par4_identification.reports.cause_cells import cause_cells
from par4_identification.reports.changes_report import changes_cells, differences_cells
from par4_identification.reports.confrontation_report import confrontation_cells
from par4_identification.reports.deviation_plots import Bar, deviation_bars
from par4_identification.reports.names import Names
from par4_identification.reports.outcome.next_experiment import advice
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.reports.page import joint_cells, page_of, picture_names
from par4_identification.reports.residual_plots import residual_over_motion
from par4_identification.reports.run_pictures import joined_time, statistics_of_runs
from par4_identification.reports.sample_traces import torque_traces, worst_run
from par4_identification.reports.steady_plots import steady_speeds_of, torque_over_speed
from par4_identification.reports.time_plots import (
    measured_motion,
    proposed_motion,
    residual_over_time,
)
from par4_identification.signals.run import Run
from par4_kinematics.machine_units import unit_on, words_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.traces import Traces
from par4_sim.report.words import (
    in_words,
    joint_labels,
    listed,
    number,
    percent,
    typeset,
    with_std,
)


def report_of_diagnosis(diagnosis: Diagnosis | Unusable, outcome: Outcome, machine: Robot | Axis,
                        logs: Sequence[Log], provenance: dict[str, Any],
                        experiment: NextExperiment | None = None,
                        confrontation: Confrontation | Unsimulated | None = None,
                        changes: Changes | None = None,
                        between: LogDifferences | None = None, verdict: str | None = None) -> str:
    """Return the report of a diagnosis.

    Args:
        diagnosis: the answer.
        outcome: in words.
        machine: that was measured.
        logs: the data, those held out last.
        provenance: as in the extended model.
        experiment: that would tell twins apart.
        confrontation: with the simulation.
        changes: since a model or between groups of bags.
        between: how the recordings differed, if they did.
        verdict: with both of these; that of the diagnosis without them.
    """
    names = picture_names(machine)
    title = f'Diagnosis of {machine.name}: {in_words(verdict or diagnosis.verdict)}'
    content: dict[str, Any] = {
        'causes': [], 'motion': '', 'over_time': '', 'over_speed': '', 'traces': None,
        'statistics': '',
        'per_joint': [], 'swallowed': [], 'bars': '', 'rejected': (), 'unnamed': [],
        'over_motion': '', 'experiment': _experiment_cells(experiment, names),
        'simulation': confrontation_cells(confrontation, names), 'changes': None,
        'between': differences_cells(between, machine)}
    if isinstance(diagnosis, Unusable):
        runs = diagnosis.fit_runs  # none where a log cannot even be filtered
        content['motion'] = runs and not runs[0].conditioning.steady and measured_motion(
            joined_time(runs), np.concatenate([run.speed for run in runs]),
            np.concatenate([run.tau for run in runs]), names)
    else:
        content.update(_what_was_found(diagnosis, machine, names))
        if diagnosis.evidence.observations.steady:
            told = steady_speeds_of(diagnosis, machine)
            content.update(over_time='', statistics='', over_motion='',
                           over_speed=torque_over_speed(told, names))
        content['traces'] = _sample_by_sample(diagnosis, machine, logs, names)
        content['changes'] = changes_cells(changes, diagnosis, machine, names)
    return page_of('diagnosis.html', machine, logs, outcome, title, 'Insights', provenance,
                   **content)


def _what_was_found(diagnosis: Diagnosis, machine: Robot | Axis, names: Names) -> dict[str, Any]:
    holdout = diagnosis.holdout
    runs, baseline, extended = _held_out_rows(diagnosis)
    valid = np.concatenate([run.valid for run in runs])
    rms = {'old model': holdout.baseline_rms, 'extended model': holdout.extended_rms,
           'noise floor': holdout.noise_floor_rms}
    if not diagnosis.causes:
        rms['model'] = rms.pop('old model')
        rms = {name: rms[name] for name in ('model', 'noise floor')}
    return {
        'causes': [cause_cells(diagnosis, index, machine, names)
                   for index in range(len(diagnosis.causes))],
        'over_time': residual_over_time(
            joined_time(runs), np.concatenate(baseline),
            np.concatenate(extended) if diagnosis.causes else None, valid,
            holdout.noise_floor_rms, names),
        'per_joint': [(name, joint_cells(values, over_joints(values), number), names.torque_unit)
                      for name, values in rms.items()],
        'statistics': statistics_of_runs(runs, extended, holdout.noise_floor_rms, names),
        'swallowed': [_swallowed_cells(name, diagnosis, machine)
                      for name in diagnosis.base_before],
        'bars': _bars_of_swallowed(diagnosis), 'rejected': [
            replace(item, reason=words_on(machine, item.reason)) for item in diagnosis.rejected],
        'unnamed': [_unnamed_cells(item, machine) for item in diagnosis.unnamed],
        'over_motion': _residual_over_motion(diagnosis, machine, names)}


def _sample_by_sample(diagnosis: Diagnosis, machine: Robot | Axis, logs: Sequence[Log],
                      names: Names) -> Traces | None:
    """Return measured torque and that of the extended model where the old one leaves most."""
    holdout = diagnosis.holdout
    worst = worst_run(holdout.runs, holdout.baseline)
    model = torque_model(machine, diagnosis.extended_model, diagnosis.effects)
    return torque_traces(holdout.runs[worst], logs, model, holdout.baseline[worst], names)


def _held_out_rows(diagnosis: Diagnosis
                   ) -> tuple[list[Run], list[np.ndarray], list[np.ndarray]]:
    """Return held-out runs and residuals without the rows before and after those that count."""
    holdout = diagnosis.holdout
    runs, baseline, extended = [], [], []
    for run, old, new in zip(holdout.runs, holdout.baseline, holdout.extended, strict=True):
        counted = np.flatnonzero(run.valid.any(axis=1))
        if len(counted):
            rows = slice(int(counted[0]), int(counted[-1]) + 1)
            runs.append(replace(run, t=run.t[rows], valid=run.valid[rows]))
            baseline.append(old[rows])
            extended.append(new[rows])
    return runs, baseline, extended


def _experiment_cells(experiment: NextExperiment | None, names: Names) -> dict[str, Any] | None:
    if experiment is None:
        return None
    motion = experiment.motion
    return {
        'rows': [{'names': listed([in_words(name) for name in item.names]),
                  'present': number(item.present, 2), 'expected': number(item.expected, 2),
                  'most': number(item.most, 2)} for item in experiment.separations],
        'picture': motion and proposed_motion(motion.t, motion.x - motion.x[0], motion.qd, names),
        'motion': motion and f'{motion.name}, {number(motion.duration)} s',
        'file': experiment.file,
        'advice': [advice(cause, experiment) for cause in
                   dict.fromkeys(item.names[0] for item in experiment.separations)]}


def _swallowed_cells(name: str, diagnosis: Diagnosis, machine: Robot | Axis) -> dict[str, str]:
    before, after = diagnosis.base_before[name], diagnosis.base_after[name]
    value, std = with_std(after.number, after.deviation)
    change = (before.number - after.number) / after.number if after.number else math.inf
    return {'name': in_words(name), 'before': with_std(before.number, after.deviation)[0],
            'after': value,
            'std': std, 'unit': typeset(unit_on(machine, after.unit)),
            'change': f'{100.0 * change:+.2f} %' if math.isfinite(change) else 'n/a'}


def _bars_of_swallowed(diagnosis: Diagnosis) -> str:
    bars = []
    for name, after in diagnosis.base_after.items():
        before, scale = diagnosis.base_before[name], abs(after.number) or 1.0
        bars.append(Bar(in_words(name), (0.0, (before.number - after.number) / scale),
                        (after.deviation / scale, before.deviation / scale)))
    return deviation_bars(bars, ('with the causes', 'without'),
                          'deviation from the value with the causes, %')


def _residual_over_motion(diagnosis: Diagnosis, machine: Robot | Axis, names: Names) -> str:
    holdout = diagnosis.holdout

    def of_joints(parts: Sequence[np.ndarray]) -> list[np.ndarray]:
        return [np.concatenate([part[run.valid[:, joint], joint]
                                for part, run in zip(parts, holdout.runs, strict=True)])
                for joint in range(len(names.joints))]

    position = unit_on(machine, 'rad')
    ends = np.cumsum([len(run.t) for run in holdout.runs])
    time = np.split(joined_time(holdout.runs), ends[:-1])
    views = ((f'position, {position}', [run.rows(run.state.q) for run in holdout.runs]),
             (f'speed, {position}/s', [run.speed for run in holdout.runs]),
             (f'acceleration, {typeset(position + "/s2")}',
              [run.rows(run.state.qdd) for run in holdout.runs]),
             ('time, s', [np.repeat(part[:, None], len(names.joints), axis=1) for part in time]))
    return residual_over_motion([(label, of_joints(parts)) for label, parts in views],
                                of_joints(holdout.extended), holdout.noise_floor_rms, names)


def _unnamed_cells(item: UnnamedCause, machine: Robot | Axis) -> dict[str, str]:
    joints = len(joint_labels(machine))
    return {'acts_like': item.phrase,
            'joints': 'all' if len(item.joints) == joints else listed(list(map(str, item.joints))),
            'torque': number(item.torque_rms, 2), 'unit': typeset(unit_on(machine, 'N m')),
            'share': percent(item.share), 'margin': number(item.margin, 3)}
