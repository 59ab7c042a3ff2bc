"""The reports: one self-contained page of HTML each, words first."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from par4_dynamics.model import build_model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.parameters import Parameter
from par4_identification.changes.changes import Changes
from par4_identification.confrontation.confrontation import Confrontation, Unsimulated
from par4_identification.diagnosis.experiment.next_experiment import NextExperiment
from par4_identification.diagnosis.verdict.answer import Cause, Diagnosis, Unusable
from par4_identification.diagnosis.verdict.judgement import UnnamedCause
from par4_identification.fitting.identification import Identification
from par4_identification.fitting.simplification_cost import ALL, NOTHING, PARTS, Simplification
from par4_identification.fitting.validation import Validation
from par4_identification.gains.known_payload import DriveGains
from par4_identification.logs.log import Log
from par4_identification.reports.changes_report import changes_cells
from par4_identification.reports.confrontation_report import confrontation_cells
from par4_identification.reports.outcome.changes import verdict_with_changes
from par4_identification.reports.outcome.diagnosis import phrase_of_cause
from par4_identification.reports.outcome.drive_gain import gains_rows
from par4_identification.reports.outcome.estimator import estimator_in_words
from par4_identification.reports.outcome.identification import ParameterRow, autocorrelation
from par4_identification.reports.outcome.next_experiment import advice
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.reports.outcome.simplification import share_in_words
from par4_identification.reports.outcome.validation import errors_by_joint, total_errors
from par4_identification.reports.plots import (
    Bar,
    Names,
    Series,
    deviation_bars,
    differences_over_time,
    measured_motion,
    proposed_motion,
    residual_over_motion,
    residual_over_time,
    residual_statistics,
    signature,
    torque_of_mechanism,
    torque_over_time,
)
from par4_identification.signals.rows import Run
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.page import rendered
from par4_sim.report.words import (
    in_words,
    joint_labels,
    listed,
    number,
    percent,
    torque_name,
    typeset,
    unit_on,
    with_std,
)

LAGS = 50
"""Rows over which autocorrelations are drawn."""
FOLDED = 9.0
"""Periods in the range of a joint above which a periodic signature is drawn over one period."""
BETWEEN_LOGS = 0.5
"""Seconds between two logs on one time axis."""


def report_of_identification(identification: Identification, outcome: Outcome,
                             rows: Sequence[ParameterRow], floor: np.ndarray,
                             machine: Robot | Axis, logs: Sequence[Log],
                             provenance: dict[str, Any]) -> str:
    """Return the report of an identification.

    Args:
        identification: the fit.
        outcome: in words.
        rows: TABLE 1.
        floor: noise floor, (J,), N m.
        machine: that was identified.
        logs: the data.
        provenance: as in the model file.
    """
    names, estimate, runs = _names(machine), identification.estimate, identification.runs
    paper, truth = (any(getattr(row, name) is not None for row in rows)
                    for name in ('paper', 'true'))
    printed = list(dict.fromkeys(f'{number(row.printed)} {typeset(row.unit)}'
                                 for row in rows if row.printed))
    return _render(
        'identification.html', machine, logs, outcome, f'Identification of {machine.name}',
        'Can it be trusted?', provenance,
        rows=[_table_1_cells(row) for row in rows], paper=paper, truth=truth,
        printed=listed(printed) if printed else '', bars=_bars_of_table_1(rows, paper, truth),
        over_time=torque_over_time(_series(runs, estimate.residuals), names),
        per_joint=[('residual rms', [number(value) for value in estimate.rms], names.torque_unit),
                   ('noise floor', [number(value) for value in floor], names.torque_unit),
                   ('residual / floor', [number(value, 2) for value in
                                         estimate.rms / np.maximum(floor, 1e-12)], '')],
        totals=f'Estimated by {estimator_in_words(identification)}. '
               f'{estimate.rows} rows; condition number of the regressor '
               f'{number(estimate.condition_number)}; relative error '
               f'{percent(estimate.relative_error)} = |residual| / |{names.torque}| in 2-norms.',
        statistics=_statistics(runs, estimate.residuals, floor, names))


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
    names = _names(machine)
    ends = np.cumsum([0, *(len(run.t) for run in runs)])
    residual = validation.measured - validation.calculated
    residuals = [residual[first:end] for first, end in pairwise(ends)]
    table = []
    for title, errors, rows in (
            ('', validation.without_standstill, validation.moving),
            (', standstill included', validation.everything, np.ones_like(validation.moving))):
        total, found = total_errors(validation, rows), errors_by_joint(errors)
        for name, key, unit, text in (('residual rms', 'rms', names.torque_unit, number),
                                      ('relative error', 'relative_error', '', percent),
                                      ('R²', 'r2', '', lambda value: number(value, 5))):
            table.append((name + title, _cells(found[key], total[key], text), unit))
    table.insert(1, ('noise floor', _cells(floor, over_joints(floor), number), names.torque_unit))
    return _render(
        'validation.html', machine, [log], outcome, f'Cross-validation on {machine.name}',
        'How good is it?', model_file.provenance,
        facts_title='Where the model comes from',
        over_time=torque_over_time(_series(runs, residuals), names), per_joint=table,
        statistics=_statistics(runs, residuals, floor, names) if validation.moving.any() else '')


def report_of_diagnosis(diagnosis: Diagnosis | Unusable, outcome: Outcome, machine: Robot | Axis,
                        logs: Sequence[Log], provenance: dict[str, Any],
                        experiment: NextExperiment | None = None,
                        confrontation: Confrontation | Unsimulated | None = None,
                        changes: Changes | None = None) -> str:
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
    """
    names = _names(machine)
    verdict = diagnosis.verdict
    if changes is not None:
        verdict = verdict_with_changes(verdict, changes)
    title = f'Diagnosis of {machine.name}: {in_words(verdict)}'
    content: dict[str, Any] = {
        'causes': [], 'motion': '', 'over_time': '', 'statistics': '', 'per_joint': [],
        'swallowed': [], 'bars': '', 'rejected': (), 'unnamed': [],
        'over_motion': '', 'experiment': _experiment_cells(experiment, names),
        'simulation': confrontation_cells(confrontation, names), 'changes': None}
    if isinstance(diagnosis, Unusable):
        runs = diagnosis.fit_runs  # none where a log cannot even be filtered
        content['motion'] = runs and measured_motion(
            _joined_time(runs), *(np.concatenate([getattr(run, part) for run in runs])
                                  for part in ('speed', 'tau')), names)
    else:
        content.update(_what_was_found(diagnosis, machine, names))
        content['changes'] = changes_cells(changes, diagnosis, machine, names)
    return _render('diagnosis.html', machine, logs, outcome, title, 'Insights', provenance,
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
        'causes': [_cause_cells(diagnosis, index, machine, names)
                   for index in range(len(diagnosis.causes))],
        'over_time': residual_over_time(
            _joined_time(runs), np.concatenate(baseline),
            np.concatenate(extended) if diagnosis.causes else None, valid,
            holdout.noise_floor_rms, names),
        'per_joint': [(name, _cells(values, over_joints(values), number), names.torque_unit)
                      for name, values in rms.items()],
        'statistics': _statistics(runs, extended, holdout.noise_floor_rms, names),
        'swallowed': [_swallowed_cells(name, diagnosis, machine)
                      for name in diagnosis.base_before],
        'bars': _bars_of_swallowed(diagnosis), 'rejected': diagnosis.rejected,
        'unnamed': [_unnamed_cells(item, machine) for item in diagnosis.unnamed],
        'over_motion': _residual_over_motion(diagnosis, machine, names)}


def report_of_simplification(study: Simplification, outcome: Outcome, robot: Robot, motion: Motion,
                             provenance: dict[str, Any]) -> str:
    """Return the report of what the simplifications of (20) cost.

    Args:
        study: the experiment.
        outcome: in words.
        robot: that was moved.
        motion: that was imposed.
        provenance: of the run.
    """
    names = _names(robot)
    differences = {variant: torque - study.simplified for variant, torque in study.torques.items()}
    noise = differences.pop(NOTHING)
    labels = {variant: 'all parts' if variant == ALL else f'{variant} alone'
              for variant in differences}
    return _render(
        'simplification.html', robot, (), outcome,
        f'Simplifications of (20) on {robot.name}, motion {motion.name}', 'What it rests on',
        provenance,
        over_time=torque_of_mechanism(study.t, study.torques[ALL], study.simplified, names),
        parts_over_time=differences_over_time(
            study.t, [(labels[name], values) for name, values in differences.items()], noise,
            names),
        parts=[_part_cells(study, variant) for variant in (*study.parts, ALL, NOTHING)],
        per_joint=_simplification_rows(study, labels | {NOTHING: 'noise'}, names.torque_unit),
        **_simplification_table(study))


def report_of_gains(gains: DriveGains, outcome: Outcome, robot: Robot, logs: Sequence[Log],
                    provenance: dict[str, Any]) -> str:
    """Return the report of the drive gains that static pushes tell.

    Args:
        gains: as estimated.
        outcome: in words.
        robot: whose gains are nominal.
        logs: with the pushes.
        provenance: of the run.
    """
    return _render('drive_gain.html', robot, logs, outcome, f'Drive gains of {robot.name}',
                   'What it rests on', provenance, rows=gains_rows(gains, robot))


# pieces that several reports share


def _render(template: str, machine: Robot | Axis, logs: Sequence[Log], outcome: Outcome,
            title: str, insights_title: str, provenance: dict[str, Any],
            facts_title: str = 'Where this comes from', **content: Any) -> str:
    return rendered(
        'par4_identification.reports', template, outcome, title, insights_title, provenance,
        facts_title, names=_names(machine), bags=[_bag_cells(log) for log in logs], **content)


def _cells(values: np.ndarray, total: float, text: Callable[[float], str]) -> list[str]:
    """Return a cell a joint and, of several joints, one for all of them."""
    return [text(float(value)) for value in values] + ([text(total)] if len(values) > 1 else [])


def _names(machine: Robot | Axis) -> Names:
    return Names(joint_labels(machine), torque_name(machine),
                 typeset(unit_on(machine, 'N m')), typeset(unit_on(machine, 'rad/s')))


def _bag_cells(log: Log) -> dict[str, Any]:
    accounts = log.accounts
    return {'name': Path(log.name).name, 'duration': number(accounts.duration),
            'samples': accounts.samples, 'rate': number(1.0 / accounts.period, 4),
            'segments': accounts.segments, 'source': in_words(accounts.torque_source),
            'findings': accounts.findings()}


def _joined_time(runs: Sequence[Run]) -> np.ndarray:
    """Return one time axis for the rows of runs: logs follow each other, gaps stay."""
    times, offset, name, end = [], 0.0, None, 0.0
    for run in runs:
        if name is not None and run.name != name:
            offset = end + BETWEEN_LOGS - float(run.t[0])
        times.append(run.t + offset)
        name, end = run.name, float(times[-1][-1])
    return np.concatenate(times)


def _series(runs: Sequence[Run], residuals: Sequence[np.ndarray]) -> Series:
    measured = np.concatenate([run.tau for run in runs])
    return Series(_joined_time(runs), np.concatenate([run.speed for run in runs]), measured,
                  measured - np.concatenate(residuals), np.concatenate([run.valid for run in runs]))


def _statistics(runs: Sequence[Run], residuals: Sequence[np.ndarray], floor: np.ndarray,
                names: Names) -> str:
    valid = [run.valid for run in runs]
    left = [np.concatenate([part[mask[:, joint], joint]
                            for part, mask in zip(residuals, valid, strict=True)])
            for joint in range(len(names.joints))]
    return residual_statistics(
        left, floor, autocorrelation(residuals, valid, LAGS + 1),
        np.array([len(values) for values in left]), float(runs[0].t[1] - runs[0].t[0]), names)


# identification


def _table_1_cells(row: ParameterRow) -> dict[str, str]:
    value, std = with_std(row.value, row.std)
    return {
        'name': in_words(row.name), 'symbol': row.symbol, 'unit': typeset(row.unit),
        'value': value, 'std': std, 'relative_std': percent(row.relative_std),
        'paper': '' if row.paper is None else f'{row.paper:g}', 'printed': bool(row.printed),
        'paper_relative_std': '' if row.paper is None else percent(row.paper_relative_std, 3),
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
        if paper:
            values.append(0.0)
            stds.append(row.paper_relative_std)
        if truth:
            values.append((row.true - zero) / zero)
            stds.append(0.0)
        bars.append(Bar(in_words(row.name), tuple(values), tuple(stds)))
    legend = ['identified', *(['paper'] if paper else []), *(['true'] if truth else [])]
    return deviation_bars(bars, legend, 'deviation from the paper, %' if paper else
                          'interval of the value, %')


# diagnosis


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


def _cause_cells(diagnosis: Diagnosis, index: int, machine: Robot | Axis, names: Names
                 ) -> dict[str, Any]:
    cause = diagnosis.causes[index]
    heading = phrase_of_cause(cause, machine)
    image, abscissa = _signature_of_cause(diagnosis, index, machine, names)
    return {
        'heading': heading, 'name': in_words(cause.effect.name), 'signature': image,
        'abscissa': abscissa.rsplit(',', 1)[0],
        'parameters': [_parameter_cells(cause, parameter.name, machine)
                       for parameter in cause.effect.parameters],
        'gain': percent(cause.gain.share),
        'interval': f'{percent(cause.gain.low)} to {percent(cause.gain.high)}',
        'p_value': f'{cause.p_value:.0e}' if cause.p_value > 1e-12 else '< 1e-12',
        'visible': percent(cause.visible_fraction), 'margin': number(cause.margin, 3),
        'rival': 'no cause' if cause.rival is None else in_words(cause.rival),
        'twins': listed([in_words(name) for name in cause.twins]) if cause.twins else ''}


def _parameter_cells(cause: Cause, name: str, machine: Robot | Axis) -> dict[str, Any]:
    """Return a line of values with standard deviations: those of the machine or one a joint."""
    parameter = cause.parameters[name]
    shape = [item for item in cause.effect.parameters if item.per_order and item.is_shape]
    if shape and isinstance(cause.parameters[shape[0].name].value, tuple):
        return _order_cells(parameter, name, machine)
    scope = next(item.scope for item in cause.effect.parameters if item.name == name)
    values, stds = np.atleast_1d(parameter.value), np.atleast_1d(parameter.std)
    cells = [' ± '.join(with_std(float(value), float(std)))
             for value, std in zip(values, stds, strict=True)]
    joints = len(joint_labels(machine))
    if scope == 'machine':
        cells = [', '.join(cells)]
    alike = len(set(cells)) == 1 and len(cause.joints) == joints
    common = joints > 1 and (len(cells) == 1 or alike)
    if not common:
        found = dict(zip(cause.joints, cells, strict=True))
        cells = [found.get(joint, '') for joint in range(joints)]
    return {'name': in_words(name), 'cells': cells[:1] if common else cells, 'common': common,
            'unit': typeset(unit_on(machine, parameter.unit))}


def _order_cells(parameter: Parameter, name: str, machine: Robot | Axis) -> dict[str, Any]:
    """Return a line of values of several orders, each with those of its joints."""
    orders = [' / '.join(' ± '.join(with_std(float(value), float(std))) for value, std in zip(
        np.atleast_1d(own), np.atleast_1d(error), strict=True))
        for own, error in zip(parameter.value, parameter.std, strict=True)]
    return {'name': in_words(name), 'cells': [', '.join(orders)], 'common': True,
            'unit': typeset(unit_on(machine, parameter.unit))}


def _signature_of_cause(diagnosis: Diagnosis, index: int, machine: Robot | Axis, names: Names
                        ) -> tuple[str, str]:
    """Return the signature plot of a cause and the label of its abscissa."""
    cause, holdout = diagnosis.causes[index], diagnosis.holdout
    model = build_model(machine, diagnosis.extended_model, diagnosis.effects)
    added = model.effects[-len(diagnosis.causes):]
    places, own, label = [], [], ''
    for run in holdout.runs:
        state = replace(run.state, nominal=model.nominal(run.state))
        view = cause.effect.signature(state)
        label = view.label
        places.append(run.rows(np.ascontiguousarray(view.abscissa)))
        own.append(run.rows(added[index].torque(state)))
    quantity, _, unit = label.rpartition(', ')
    unit = typeset(unit_on(machine, unit))
    label = f'{quantity}, {unit}'
    period = _period(cause, places)
    if period:
        places = [np.mod(place, period) for place in places]
        label = f'{quantity} within one of {2.0 * np.pi / period:.0f} periods a turn, {unit}'
    drawn = {name: [] for name in ('place', 'before', 'alone', 'own')}
    for joint in cause.joints:
        masks = [run.valid[:, joint] for run in holdout.runs]
        for name, parts in (('place', places), ('before', holdout.baseline), ('own', own),
                            ('alone', [new + torque for new, torque in
                                       zip(holdout.extended, own, strict=True)])):
            drawn[name].append(np.concatenate([part[mask, joint] for part, mask in
                                               zip(parts, masks, strict=True)]))
    image = signature(drawn['place'], label, drawn['before'], drawn['alone'], drawn['own'],
                      [names.joints[joint] for joint in cause.joints], names)
    return image, label


def _period(cause: Cause, places: Sequence[np.ndarray]) -> float | None:
    """Return the period over which a signature of many periods is folded, rad, else None."""
    rates = [np.atleast_1d(cause.parameters[item.name].value) for item in cause.effect.parameters
             if item.unit == '1/turn']
    if not rates:
        return None
    # of several orders all return after that of their greatest common divisor
    common = rates[0][0] if len(rates[0]) == 1 else math.gcd(*(round(rate) for rate in rates[0]))
    period = 2.0 * np.pi / float(common)
    return period if np.ptp(np.concatenate(places)) > FOLDED * period else None


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
        'advice': [advice(cause, experiment) for cause in
                   dict.fromkeys(item.names[0] for item in experiment.separations)]}


def _swallowed_cells(name: str, diagnosis: Diagnosis, machine: Robot | Axis) -> dict[str, str]:
    before, after = diagnosis.base_before[name], diagnosis.base_after[name]
    value, std = with_std(after.value, after.std)
    change = (before.value - after.value) / after.value if after.value else math.inf
    return {'name': in_words(name), 'before': with_std(before.value, after.std)[0], 'after': value,
            'std': std, 'unit': typeset(unit_on(machine, after.unit)),
            'change': f'{100.0 * change:+.2f} %' if math.isfinite(change) else 'n/a'}


def _bars_of_swallowed(diagnosis: Diagnosis) -> str:
    bars = []
    for name, after in diagnosis.base_after.items():
        before, scale = diagnosis.base_before[name], abs(after.value) or 1.0
        bars.append(Bar(in_words(name), (0.0, (before.value - after.value) / scale),
                        (after.std / scale, before.std / scale)))
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
    time = np.split(_joined_time(holdout.runs), ends[:-1])
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


# simplification


def _part_cells(study: Simplification, variant: str) -> dict[str, str]:
    found, is_part = study.difference(variant), variant in study.parts
    return {
        'name': variant if is_part else {ALL: 'all parts', NOTHING: 'none: noise'}[variant],
        'value': number(study.parts[variant]) if is_part else '',
        'unit': typeset('kg m2' if PARTS.get(variant) == 'theta_inertia' else 'kg')
                if is_part else '',
        'of_rms': percent(found.overall_of_rms, 3), 'of_peak': percent(found.overall_of_peak, 3),
        'share': share_in_words(study.share(variant)) if is_part else ''}


def _simplification_rows(study: Simplification, labels: dict[str, str], unit: str
                         ) -> list[tuple[str, list[str], str]]:
    torque, whole = study.torques[ALL], study.difference(ALL)
    rms, peak = np.sqrt(np.mean(torque ** 2, axis=0)), np.abs(torque).max(axis=0)
    rows = [('rms torque', _cells(rms, over_joints(rms), number), unit),
            ('peak torque', _cells(peak, peak.max(), number), unit),
            ('rms error', _cells(whole.rms, over_joints(whole.rms), number), unit),
            ('largest error', _cells(whole.largest, whole.largest.max(), number), unit)]
    for title, joints, overall in (('rms error / rms torque', 'of_rms', 'overall_of_rms'),
                                   ('largest error / peak torque', 'of_peak', 'overall_of_peak')):
        for variant, label in labels.items():
            found = study.difference(variant)
            rows.append((f'{title}, {label}', _cells(
                getattr(found, joints), getattr(found, overall),
                lambda value: percent(value, 3)), ''))
    return rows


def _simplification_table(study: Simplification) -> dict[str, Any]:
    masses = sorted({cell.rod_mass for cell in study.table})
    rows: dict[tuple[str, float], list[str]] = {}
    for cell in study.table:  # rod masses increase within a row
        rows.setdefault((cell.direction, cell.theta_range), []).append(
            f'{percent(cell.of_rms)}, {percent(cell.of_peak)}' if math.isfinite(cell.of_rms)
            else 'n/a')
    return {'masses': [f'{1000.0 * mass:.4g} g' for mass in masses],
            'table': [{'direction': direction, 'cells': cells,
                       'theta': f'± {number(math.degrees(theta))}°' if theta else 'fixed'}
                      for (direction, theta), cells in rows.items()]}
