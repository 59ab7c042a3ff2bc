"""par4_validate: how well a model calculates the torque of a measured bag."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from par4_dynamics.model_from_file import build_model, read_file_and_model
from par4_identification.diagnosis.verdict.floor import noise_floor
from par4_identification.fitting.validation import validate
from par4_identification.logs.bag_hash import bag_sha256
from par4_identification.logs.read_log import read_log
from par4_identification.logs.stretches import in_pieces
from par4_identification.reports.outcome.results import bags_of
from par4_identification.reports.outcome.setup import setup_json, with_setup
from par4_identification.reports.outcome.validation import outcome_of_validation, validation_json
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.unusable import sound_or_refused
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import Chosen, conditioning_for
from par4_kinematics.paths import refuse_unwritable
from par4_kinematics.robot import read_machine
from par4_sim.report.results import write_results
from par4_sim.report.terminal import say


def validate_bag(bag: str, model: str, robot: str, output: Path, namespace: str | None,
                 cutoff: float | None, rows: float | None, low_speed: float | None,
                 report: bool) -> None:
    """Cross-validate a model on a bag that it was not identified from.

    Args:
        report: whether the page is drawn; the rest as the options of the command.
    """
    machine = read_machine(robot)
    model_file, built = read_file_and_model(model, machine)
    refuse_unwritable(output)
    with Console(stderr=True).status(f'reading {bag}') as status:
        log = read_log(bag, machine, namespace)
        status.update('looking for mistakes of the setup')
        check = check_setup([log], machine, built)
        log, machine = in_pieces(check.logs[0]), check.machine
        built = build_model(machine, model_file)
        status.update('calculating the torque')
        conditioning = conditioning_for([log], machine, Conditioning(),
                                        Chosen(cutoff, rows, low_speed))
        validation = sound_or_refused(check, lambda: validate(log, machine, built, conditioning))
        runs = runs_of_log(log, machine, conditioning)
        floor = noise_floor(runs, built)
        seen = bag_sha256(bag) in bags_of(model_file)
        outcome = with_setup(outcome_of_validation(validation, floor, machine, log, seen), check,
                             'validation')
        page = None
        if report:
            status.update('drawing the report')
            # the plot library is slow to load, and some homes make it talk on stderr
            from par4_identification.reports.validation_report import report_of_validation
            page = report_of_validation(validation, outcome, runs, floor, machine, log, model_file)
        write_results(output, {
            'validation.json': {**validation_json(validation, log), 'setup': setup_json(check)},
            'report.html': page})
    say(*outcome.first, outcome.sentence)
    say(f'results{" and report" if report else ""}: {output}', whole=True)
