"""How the recordings of a diagnosis differ, in words, and `between_logs` of `diagnosis.json`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from par4_identification.changes.between_logs import LogDifferences
from par4_identification.diagnosis.verdict.answer import Verdict
from par4_identification.reports.outcome.changes import (
    phrase_of_reading,
    twin_remarks,
    verdict_beside,
)
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import plain
from par4_sim.report.words import listed, percent


def verdict_with_differences(verdict: Verdict, between: LogDifferences) -> Verdict:
    """Return the verdict: recordings of a machine that changed between them are not clean."""
    return verdict_beside(verdict, True, not between.is_complete)


def with_differences(outcome: Outcome, between: LogDifferences, machine: Robot | Axis) -> Outcome:
    """Return the outcome of recordings made alike, with how they differed in front."""
    told = '; '.join(
        f'{item.log} has, against {item.other}, ' + listed([
            phrase_of_reading(read.reading, read.size, machine) for read in item.explanation.read])
        for item in between.of_logs)
    remarks = [remark for item in between.of_logs
               for remark in twin_remarks(item.explanation.read, machine)]
    if not between.is_complete:
        remarks.append(Remark(False, 'The recordings differ beyond that, as no known reading '
                                     'explains.', 'Diagnose them one by one.'))
    return replace(
        outcome, standing='fair' if outcome.standing == 'good' else outcome.standing,
        sentence=f'The machine changed between the recordings: {told}. That made '
                 f'{percent(between.share)} of the squared error beyond the noise floor; what '
                 f'follows is told with it taken out. {outcome.sentence}',
        remarks=(*remarks, *outcome.remarks))


def differences_json(between: LogDifferences | None, machine: Robot | Axis) -> dict[str, Any]:
    """Return `between_logs` with an entry for each reading, nothing where recordings are alike."""
    return {} if between is None else {'between_logs': plain([
        {'log': item.log, 'other': item.other,
         'reading': phrase_of_reading(read.reading, read.size, machine),
         'size': read.size, 'std': read.std, 'p_value': read.p_value}
        for item in between.of_logs for read in item.explanation.read])}
