"""par4_diagnose: what a model gets wrong about the machine that made the bags, and why."""

from __future__ import annotations

from dataclasses import replace

from rich.console import Console

from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model, read_file_and_model
from par4_identification.changes.apart import diagnosed_apart
from par4_identification.changes.between_logs import LogDifferences
from par4_identification.changes.changes import (
    Changes,
    changes_between,
    changes_since_model,
)
from par4_identification.confrontation.confrontation import confront_diagnosis
from par4_identification.diagnosis.diagnosis import Apart, diagnose
from par4_identification.diagnosis.experiment.next_experiment import next_experiment
from par4_identification.diagnosis.progress import Progress
from par4_identification.diagnosis.search.rules import rules_of_no_cause
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_identification.jobs.diagnosis_request import TOOL, DiagnosisRequest
from par4_identification.jobs.diagnosis_results import (
    Answer,
    errors_in_lines,
    outcome_of_answer,
    reservations,
    write_answer,
)
from par4_identification.jobs.recorded import Recorded, recorded
from par4_identification.logs.bag_hash import bag_sha256
from par4_identification.reports.outcome.diagnosis import parameters_beside_causes
from par4_identification.reports.outcome.gravity import gravity_remarks
from par4_identification.reports.outcome.results import bags_of
from par4_identification.setup_check.unusable import diagnosed_if_sound
from par4_kinematics.errors import InputError
from par4_kinematics.limits import limits_not_given
from par4_kinematics.motion_file import free_motion_path
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import Axis, Robot, read_machine
from par4_sim.report.outcome import Remark
from par4_sim.report.terminal import say
from par4_sim.report.words import shortened


def diagnose_bags(asked: DiagnosisRequest) -> None:
    """Name what a model gets wrong about the machine that made the bags."""
    machine = read_machine(asked.robot)
    # refuses a model of another machine before any long work
    believed = None if asked.model is None else read_file_and_model(asked.model, machine)
    refuse_unwritable(asked.output)
    with Console(stderr=True).status('reading the bags') as status:
        measured = recorded(asked, machine, believed, status.update)
        answer = _answer(asked, measured, status.update)
        outcome = outcome_of_answer(measured, answer)
        write_answer(asked, measured, answer, outcome, status.update)
    say(*outcome.first, *(f'{remark.text} {remark.advice}'.rstrip() for remark in answer.beside))
    if isinstance(answer.diagnosis, Diagnosis) and answer.changes is not None:
        say(errors_in_lines(answer.changes, answer.diagnosis, measured.machine), whole=True)
    say(f'{answer.verdict}: {outcome.sentence}',
        *parameters_beside_causes(answer.diagnosis, measured.machine),
        *reservations(outcome, answer.beside))
    say(f'results{" and report" if asked.report else ""}: {asked.output}', whole=True)
    if (isinstance(measured.machine, Robot) and answer.experiment is not None
            and answer.experiment.motion is not None):
        # which the proposed motion keeps
        say(*limits_not_given(measured.machine), whole=True)


def _answer(asked: DiagnosisRequest, measured: Recorded, progress: Progress) -> Answer:
    """Diagnose, and look for what the diagnosis leads to."""
    check, machine, conditioning = measured.check, measured.machine, measured.conditioning
    diagnosis, between = _diagnosis(measured, progress)
    beside = () if check.useless else gravity_remarks(
        machine, check.logs[:measured.fitted], conditioning)
    if not isinstance(diagnosis, Diagnosis):
        return Answer(diagnosis, beside)
    beside += _impossible_bodies(machine, diagnosis)
    progress('looking for the motion that would tell twins apart')
    experiment = next_experiment(diagnosis, machine)
    if experiment is not None:
        experiment = replace(experiment, file=free_motion_path(
            asked.output / experiment.file, TOOL).name)
    changes = None
    if measured.baseline is not None:
        progress('looking for what has changed')
        try:
            changes = _changes(asked, measured, measured.baseline, diagnosis)
        except InputError as error:
            beside += (Remark(False, f'What has changed could not be told: {error}.'),)
    confrontation = confront_diagnosis(
        diagnosis, machine, check.logs, progress=progress) if asked.simulate else None
    return Answer(diagnosis, beside, experiment, changes, confrontation, between)


def _impossible_bodies(machine: Robot | Axis, diagnosis: Diagnosis) -> tuple[Remark, ...]:
    """Return that no machine has the bodies of the extended model, if none has."""
    try:
        build_model(machine, diagnosis.extended_model, diagnosis.effects)
    except InputError as error:
        return (Remark(False, f'The extended model has bodies that no machine has, and other tools '
                              f'refuse it: {error}.'),)
    return ()


def _diagnosis(measured: Recorded, progress: Progress
               ) -> tuple[Diagnosis | Unusable, LogDifferences | None]:
    """Diagnose the recordings, without what they differ in if they do."""
    machine, baseline = measured.machine, measured.baseline

    def of_logs(apart: Apart, *, bodies_alone: bool = False) -> Diagnosis | Unusable:
        rules = rules_of_no_cause(isinstance(machine, Axis)) if bodies_alone else None
        return diagnosed_if_sound(measured.check, lambda sound: diagnose(
            sound.logs[:measured.fitted], sound.machine, baseline, sound.logs[measured.fitted:],
            {} if bodies_alone else None, rules, measured.conditioning, progress, apart,
            measured.as_set))

    return diagnosed_apart(of_logs, len(measured.check.logs), machine, baseline, progress)


def _changes(asked: DiagnosisRequest, measured: Recorded, baseline: ModelFile, diagnosis: Diagnosis
             ) -> Changes:
    """Return what has changed since the earlier bags or, without them, since the model.

    Raises:
        InputError: it cannot be told.
    """
    if measured.earlier is None:
        of_these = not bags_of(baseline).isdisjoint(map(bag_sha256, asked.bags))
        return changes_since_model(diagnosis, measured.machine, baseline, str(asked.model),
                                   of_these)
    return changes_between(diagnosis, measured.machine, measured.earlier.logs, baseline,
                           shortened(asked.before), diagnosis.fit_runs[0].conditioning)
