"""What par4_diagnose found: in words, for the terminal, and in the files of its output."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from par4_identification.changes.between_logs import LogDifferences
from par4_identification.changes.changes import Changes
from par4_identification.confrontation.confrontation import (
    Confrontation,
    Unsimulated,
    model_after,
)
from par4_identification.diagnosis.experiment.next_experiment import NextExperiment
from par4_identification.diagnosis.progress import Progress
from par4_identification.diagnosis.verdict.answer import Cause, Diagnosis, Unusable
from par4_identification.jobs.diagnosis_request import TOOL, DiagnosisRequest
from par4_identification.jobs.recorded import Recorded
from par4_identification.reports.outcome.between_logs import (
    differences_json,
    verdict_with_differences,
    with_differences,
)
from par4_identification.reports.outcome.changes import (
    diagnosis_json_with_changes,
    error_rows,
    verdict_with_changes,
    with_changes,
)
from par4_identification.reports.outcome.confrontation import (
    remarks_of_confrontation,
    simulation_json,
)
from par4_identification.reports.outcome.diagnosis import diagnosis_json, outcome_of_diagnosis
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.reports.outcome.results import model_in_units
from par4_identification.reports.outcome.setup import setup_json, with_setup
from par4_identification.setup_check.total import total_lines
from par4_kinematics.machine_units import unit_on
from par4_kinematics.motion_file import is_untouched, write_motion
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import results_into
from par4_sim.report.words import number


@dataclass(frozen=True)
class Answer:
    """What `par4_diagnose` found.

    Attributes:
        diagnosis: or what makes the data unusable.
        beside: what else is to be told: of gravity, and why changes are not.
        experiment: the motion that would tell twins apart, if there are some.
        changes: against the baseline, if there is one.
        confrontation: of the diagnosis with the simulation, if one was asked for.
        between: how the recordings differ, if they do; the diagnosis is then told without that.
    """

    diagnosis: Diagnosis | Unusable
    beside: tuple[Remark, ...]
    experiment: NextExperiment | None = None
    changes: Changes | None = None
    confrontation: Confrontation | Unsimulated | None = None
    between: LogDifferences | None = None

    @property
    def causes(self) -> tuple[Cause, ...]:
        """The causes of the diagnosis; none where the data are unusable."""
        return self.diagnosis.causes if isinstance(self.diagnosis, Diagnosis) else ()

    @property
    def verdict(self) -> str:
        """The verdict, with what has changed."""
        if not isinstance(self.diagnosis, Diagnosis):
            return self.diagnosis.verdict
        verdict = self.diagnosis.verdict
        if self.between is not None:
            verdict = verdict_with_differences(verdict, self.between)
        return verdict if self.changes is None else verdict_with_changes(verdict, self.changes)


def reservations(outcome: Outcome, told: Sequence[Remark]) -> list[str]:
    """Return what weakens the answer and what to do about it, without what was told already."""
    return [f'- {remark.text} {remark.advice}'.rstrip() for remark in outcome.remarks
            if not remark.good and remark not in told
            and remark.text.rstrip('.').lower() not in outcome.sentence.lower()]


def errors_in_lines(changes: Changes, diagnosis: Diagnosis, machine: Robot | Axis) -> str:
    """Return the held-out errors of three models, a line each."""
    holdout, unit = diagnosis.holdout, unit_on(machine, 'N m')
    rows = error_rows(changes, holdout.baseline_rms, holdout.extended_rms)
    width = max(len(name) for name, _ in rows)
    return '\n'.join(f'held-out error, {name:<{width}}  {number(over_joints(rms), 2)} {unit}'
                     for name, rms in rows)


def outcome_of_answer(measured: Recorded, answer: Answer) -> Outcome:
    """Return the answer in words."""
    diagnosis, machine = answer.diagnosis, measured.machine
    outcome = outcome_of_diagnosis(diagnosis, machine, answer.experiment)
    if isinstance(diagnosis, Diagnosis) and answer.changes is not None:
        outcome = with_changes(outcome, answer.changes, diagnosis, machine)
    if answer.between is not None:
        outcome = with_differences(outcome, answer.between, machine)
    totals = (Remark(True, line) for line in total_lines(measured.check, answer.causes))
    outcome = with_setup(replace(outcome, remarks=(
        *answer.beside, *outcome.remarks, *totals,
        *remarks_of_confrontation(answer.confrontation))), measured.check, 'diagnosis')
    if measured.earlier is None:
        return outcome
    return replace(outcome, first=(*outcome.first, *measured.earlier.setup_lines))


def write_answer(asked: DiagnosisRequest, measured: Recorded, answer: Answer, outcome: Outcome,
                 progress: Progress) -> None:
    """Write all files in one step, and remove the motion that an earlier run proposed there."""
    machine, diagnosis, experiment = measured.machine, answer.diagnosis, answer.experiment
    used = (diagnosis.fit_runs[0].conditioning if isinstance(diagnosis, Diagnosis) else
            measured.conditioning)
    origin = asked.provenance(machine, used)
    page = None
    if asked.report:
        progress('drawing the report')
        # the plot library is slow to load, and some homes make it talk on stderr
        from par4_identification.reports.diagnosis_report import report_of_diagnosis
        page = report_of_diagnosis(diagnosis, outcome, machine, measured.check.logs, origin,
                                   experiment, answer.confrontation, answer.changes,
                                   answer.between, answer.verdict)
    extended = model_after(diagnosis) if isinstance(diagnosis, Diagnosis) else None
    results = {
        'diagnosis.json': {**diagnosis_json_with_changes(
                               diagnosis_json(diagnosis, machine, experiment), answer.changes,
                               machine),
                           'verdict': answer.verdict,
                           **differences_json(answer.between, machine),
                           'setup': setup_json(measured.check),
                           'simulation': simulation_json(answer.confrontation)},
        'extended_model.yaml': extended and model_in_units(
            extended.model_copy(update={'provenance': origin}), machine),
        'report.html': page}
    with results_into(asked.output) as write:
        outdated = motion_of_earlier_run(asked.output)
        if experiment is not None and experiment.motion is not None:  # before what names it
            place = asked.output / experiment.file
            write_motion(place, experiment.motion, 'platform', TOOL)
            outdated = None if outdated == place else outdated
        write(results)
        if outdated is not None:
            for file in (outdated, outdated.with_suffix('.csv')):
                file.unlink(missing_ok=True)


def motion_of_earlier_run(folder: Path) -> Path | None:
    """Return the motion that the diagnosis in a folder proposes.

    None where it proposes none or its files are not what it wrote: they are then somebody else's,
    such as a motion that was designed there since.
    """
    try:
        content = json.loads((folder / 'diagnosis.json').read_text(encoding='utf-8'))
        motion = folder / Path(content['next_experiment']['motion']).name
    except (OSError, ValueError, KeyError, TypeError):  # there is none, or it is no diagnosis
        return None
    return motion if is_untouched(motion, TOOL) else None
