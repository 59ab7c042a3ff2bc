"""What the report of a diagnosis shows of changes."""

from __future__ import annotations

from typing import Any

from par4_identification.changes.between_logs import LogDifferences
from par4_identification.changes.changes import Changes
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_identification.reports.deviation_plots import Bar, deviation_bars
from par4_identification.reports.names import Names
from par4_identification.reports.outcome.between_logs import differences_json
from par4_identification.reports.outcome.changes import changes_json, error_rows
from par4_identification.reports.outcome.outcome import over_joints
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.words import in_words, number, typeset, with_std


def changes_cells(changes: Changes | None, diagnosis: Diagnosis, machine: Robot | Axis,
                  names: Names) -> dict[str, Any] | None:
    """Return the tables and the picture of changes; None where nothing was compared."""
    if changes is None:
        return None
    holdout = diagnosis.holdout
    rows = [*error_rows(changes, holdout.baseline_rms, holdout.extended_rms),
            ('noise floor', holdout.noise_floor_rms)]
    return {
        'since': changes.since,
        'rows': [_cells(entry) for entry in changes_json(changes, machine)],
        'errors': [(name, [number(float(value)) for value in rms] + (
            [number(over_joints(rms))] if len(rms) > 1 else []), names.torque_unit)
            for name, rms in rows],
        'bars': _bars(changes),
        'units': {term.name: typeset(unit_on(machine, term.unit)) for term in changes.terms}}


def differences_cells(between: LogDifferences | None, machine: Robot | Axis
                      ) -> list[dict[str, str]]:
    """Return the rows of the table of how recordings differ."""
    return [{**{name: entry[name] for name in ('log', 'other', 'reading')},
             'p_value': _chance(entry['p_value'])}
            for entry in differences_json(between, machine).get('between_logs', ())]


def _cells(entry: dict[str, Any]) -> dict[str, str]:
    change = entry['after'] - entry['before']
    return {
        'reading': entry['reading'] or 'no known reading',
        'parameter': in_words(entry['parameter'].replace('[', ', joint ').rstrip(']')),
        'before': number(entry['before'], 4), 'after': number(entry['after'], 4),
        'change': ' ± '.join(with_std(change, entry['std'])),
        'unit': '' if entry['unit'] == '1' else typeset(entry['unit']),
        'p_value': _chance(entry['p_value'])}


def _chance(p_value: float) -> str:
    return number(p_value, 2) if p_value > 1e-99 else '< 1e-99'


def _bars(changes: Changes) -> str:
    """Return the change of each parameter, joint by joint, in percent of what it was."""
    before, after, std = changes.before, changes.after, changes.std
    bars = []
    for index, term in enumerate(changes.terms):
        for joint, old in enumerate(before.values[:, index]):
            if abs(old) < 1e-9:
                continue
            where = f', joint {joint}' if len(before.values) > 1 else ''
            bars.append(Bar(f'{in_words(term.name)}{where}',
                            (float(after.values[joint, index] / old - 1.0),),
                            (float(std[joint, index] / abs(old)),)))
    return deviation_bars(bars, ('now, against before',), 'change of the parameter, %')
