"""par4_diagnose: what a model gets wrong about the machine that made the bags, and why."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from rich.console import Console

from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model, read_file_and_model
from par4_identification.changes.apart import diagnosed_apart
from par4_identification.changes.between_logs import LogDifferences
from par4_identification.changes.changes import (
    Changes,
    changes_between,
    changes_since_model,
    model_of_bags,
)
from par4_identification.confrontation.confrontation import (
    Confrontation,
    Unsimulated,
    confront_diagnosis,
    model_after,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING, Apart, diagnose
from par4_identification.diagnosis.experiment.next_experiment import (
    NextExperiment,
    next_experiment,
)
from par4_identification.diagnosis.progress import Progress
from par4_identification.diagnosis.search.rules import rules_of_no_cause
from par4_identification.diagnosis.verdict.answer import Cause, Diagnosis, Unusable
from par4_identification.fitting.axis_gravity import with_gravity_told
from par4_identification.jobs.read_bags import read_bags
from par4_identification.logs.bag_hash import bag_sha256
from par4_identification.logs.log import Log
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
from par4_identification.reports.outcome.diagnosis import (
    diagnosis_json,
    outcome_of_diagnosis,
    parameters_beside_causes,
)
from par4_identification.reports.outcome.gravity import gravity_remarks
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.reports.outcome.results import bags_of, model_in_units, provenance
from par4_identification.reports.outcome.setup import setup_json, setup_lines, with_setup
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.finding import SetupCheck
from par4_identification.setup_check.total import total_lines
from par4_identification.setup_check.unusable import diagnosed_if_sound, sound_or_refused
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import Chosen, conditioning_for
from par4_kinematics.errors import InputError
from par4_kinematics.limits import limits_not_given
from par4_kinematics.machine_units import unit_on
from par4_kinematics.motion_file import free_motion_path, is_untouched, write_motion
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import Axis, Robot, read_machine
from par4_sim.report.outcome import Outcome, Remark
from par4_sim.report.results import results_into
from par4_sim.report.terminal import say
from par4_sim.report.words import number, shortened

TOOL = 'par4_diagnose'


@dataclass(frozen=True)
class Asked:
    """What `par4_diagnose` was asked for, as the command line has it.

    Attributes:
        bags: to diagnose.
        holdout: to confirm on.
        before: of the machine as it was.
        robot, model: file or built-in name; no model where none was believed.
        output: folder.
        namespace: that the topics sit under.
        cutoff, rows, low_speed: of the filters; None leaves them to the data.
        simulate: whether the model is run along the measured motion, before and after.
        report: whether the page is drawn.
    """

    bags: tuple[str, ...]
    holdout: tuple[str, ...]
    before: tuple[str, ...]
    robot: str
    model: str | None
    output: Path
    namespace: str | None
    cutoff: float | None
    rows: float | None
    low_speed: float | None
    simulate: bool
    report: bool

    @property
    def every_bag(self) -> tuple[str, ...]:
        """All bags, in the order in which they are read."""
        return (*self.bags, *self.holdout, *self.before)

    @property
    def chosen(self) -> Chosen:
        """What was set of the filters."""
        return Chosen(self.cutoff, self.rows, self.low_speed)

    def provenance(self, machine: Robot | Axis, conditioning: Conditioning) -> dict[str, Any]:
        """Return where the results come from."""
        return provenance(TOOL, machine, self.every_bag, {
            'holdout': self.holdout, 'before': self.before, 'model': self.model,
            'namespace': self.namespace, **asdict(conditioning)})


@dataclass(frozen=True)
class Recorded:
    """What a diagnosis rests on.

    Attributes:
        check: of the setup of the bags to diagnose and to confirm on, whose logs are mended.
        fitted: how many of its logs are fitted; the others confirm.
        conditioning: of all logs.
        baseline: the model that was believed, or what the earlier bags tell; None without both.
        earlier: bags of the machine as it was, if any.
        as_set: whether a user sets filters or rates.
    """

    check: SetupCheck
    fitted: int
    conditioning: Conditioning
    baseline: ModelFile | None
    earlier: Earlier | None
    as_set: bool

    @property
    def machine(self) -> Robot | Axis:
        """The machine with what the check mended."""
        return self.check.machine


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


def diagnose_bags(asked: Asked) -> None:
    """Name what a model gets wrong about the machine that made the bags."""
    machine = read_machine(asked.robot)
    # refuses a model of another machine before any long work
    believed = None if asked.model is None else read_file_and_model(asked.model, machine)
    refuse_unwritable(asked.output)
    with Console(stderr=True).status('reading the bags') as status:
        measured = _measured(asked, machine, believed, status.update)
        answer = _answer(asked, measured, status.update)
        outcome = _outcome(measured, answer)
        _write(asked, measured, answer, outcome, status.update)
    say(*outcome.first, *(f'{remark.text} {remark.advice}'.rstrip() for remark in answer.beside))
    if isinstance(answer.diagnosis, Diagnosis) and answer.changes is not None:
        say(errors_in_lines(answer.changes, answer.diagnosis, measured.machine), whole=True)
    say(f'{answer.verdict}: {outcome.sentence}',
        *parameters_beside_causes(answer.diagnosis, measured.machine),
        *_reservations(outcome, answer.beside))
    say(f'results{" and report" if asked.report else ""}: {asked.output}', whole=True)
    if (isinstance(measured.machine, Robot) and answer.experiment is not None
            and answer.experiment.motion is not None):
        # which the proposed motion keeps
        say(*limits_not_given(measured.machine), whole=True)


def _reservations(outcome: Outcome, told: Sequence[Remark]) -> list[str]:
    """Return what weakens the answer and what to do about it, without what was told already."""
    return [f'- {remark.text} {remark.advice}'.rstrip() for remark in outcome.remarks
            if not remark.good and remark not in told
            and remark.text.rstrip('.').lower() not in outcome.sentence.lower()]


def _measured(asked: Asked, machine: Robot | Axis, believed: tuple[ModelFile, Model] | None,
              progress: Progress) -> Recorded:
    """Read all bags and look for mistakes of the setup."""
    baseline, known = believed or (None, None)
    logs = read_bags(asked.every_bag, machine, asked.namespace, progress)
    progress('looking for mistakes of the setup')
    own, as_set = len(asked.bags) + len(asked.holdout), asked.chosen != Chosen()
    conditioning = conditioning_for(logs, machine, CONDITIONING, asked.chosen)
    as_given = machine
    for group in (logs[:own], logs[own:]) if asked.before else (logs,):
        machine = machine if _hangs(machine) else with_gravity_told(as_given, group, conditioning)
    if not asked.before:
        check = check_setup(logs[:own], machine, known)
        conditioning = conditioning_for(check.logs, check.machine, CONDITIONING, asked.chosen)
        return Recorded(check, len(asked.bags), conditioning, baseline, None, as_set)
    before = check_setup(logs[own:], machine)
    earlier = Earlier.of(before, machine, baseline, conditioning)
    check = check_setup(logs[:own], machine, build_model(machine, earlier.model_file))
    mended = conditioning_for((*check.logs, *before.logs), machine, CONDITIONING, asked.chosen)
    if mended != conditioning:  # which were those of logs with their mistakes
        earlier = Earlier.of(before, machine, baseline, mended)
    return Recorded(check, len(asked.bags), mended, earlier.model_file, earlier, as_set)


def _answer(asked: Asked, measured: Recorded, progress: Progress) -> Answer:
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


def _changes(asked: Asked, measured: Recorded, baseline: ModelFile, diagnosis: Diagnosis
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


def _outcome(measured: Recorded, answer: Answer) -> Outcome:
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


def _write(asked: Asked, measured: Recorded, answer: Answer, outcome: Outcome, progress: Progress
           ) -> None:
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


def _hangs(machine: Robot | Axis) -> bool:
    """Return whether a machine is an axis that is known to lift a load."""
    return isinstance(machine, Axis) and machine.gravity == 'vertical'


@dataclass(frozen=True)
class Earlier:
    """Bags of the machine as it was.

    Attributes:
        logs: mended.
        model_file: identified from them.
        setup_lines: what was wrong with their setup.
    """

    logs: tuple[Log, ...]
    model_file: ModelFile
    setup_lines: tuple[str, ...]

    @classmethod
    def of(cls, check: SetupCheck, machine: Robot | Axis, baseline: ModelFile | None,
           conditioning: Conditioning) -> Earlier:
        """Return earlier bags, whose setup was checked, with their model.

        Raises:
            InputError: no model can be identified from them.
        """
        model_file = sound_or_refused(check, lambda: model_of_bags(
            check.logs, machine, baseline, conditioning))
        return cls(check.logs, model_file, tuple(
            f'In the bags before: {line}' for line in setup_lines(check, 'comparison')))


def errors_in_lines(changes: Changes, diagnosis: Diagnosis, machine: Robot | Axis) -> str:
    """Return the held-out errors of three models, a line each."""
    holdout, unit = diagnosis.holdout, unit_on(machine, 'N m')
    rows = error_rows(changes, holdout.baseline_rms, holdout.extended_rms)
    width = max(len(name) for name, _ in rows)
    return '\n'.join(f'held-out error, {name:<{width}}  {number(over_joints(rms), 2)} {unit}'
                     for name, rms in rows)
