"""par4_diagnose: what a model gets wrong about the machine that made the bags, and why."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path

import click
from rich.console import Console

from par4_dynamics.model import build_model
from par4_dynamics.model_file import read_model_file
from par4_identification.axis_gravity import with_gravity_told
from par4_identification.commands.conditioning import conditioning_options
from par4_identification.commands.identify import distinct_bags
from par4_identification.confrontation import confront_diagnosis, model_after
from par4_identification.diagnosis.answer import Diagnosis
from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.next_experiment import next_experiment
from par4_identification.log import read_log
from par4_identification.outcome.confrontation import (
    remarks_of_confrontation,
    simulation_json,
)
from par4_identification.outcome.diagnosis import diagnosis_json, outcome_of_diagnosis
from par4_identification.outcome.next_experiment import MOTION_FILE
from par4_identification.outcome.results import model_in_units, provenance
from par4_identification.outcome.setup import setup_json, with_setup
from par4_identification.scales import Chosen, conditioning_for
from par4_identification.setup_check.check import check_setup
from par4_identification.setup_check.unusable import diagnosed_if_sound
from par4_kinematics.motion_file import write_motion
from par4_kinematics.robot import read_machine
from par4_sim.commands.entry import run
from par4_sim.report.results import refuse_unwritable, write_results


class GreedyHoldout(click.Command):
    """A command in which `--holdout A B` means `--holdout A --holdout B`: up to the next option."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Return what is left of `args` once the options are taken out."""
        spread, following, valued = [], False, False
        for word in args:
            if word.startswith('-'):
                following, valued = word.partition('=')[0] == '--holdout', '=' in word
            elif following and valued:
                spread.append('--holdout')
            else:
                valued = True
            spread.append(word)
        return super().parse_args(ctx, spread)


@click.command('par4_diagnose', cls=GreedyHoldout)
@click.argument('bags', nargs=-1, required=True, metavar='BAG...')
@click.option('--holdout', multiple=True, metavar='BAG...',
              help='bags to confirm on; without them the last bag, or the last third of one')
@click.option('--robot', required=True, help='robot.yaml or built-in name')
@click.option('--model', default=None,
              help='model.yaml or built-in name whose rigid body and effects are taken as known')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for diagnosis.json, extended_model.yaml, report.html and, where names '
                   'could not be told apart, motion.yaml')
@click.option('--namespace', default=None, help='that the topics sit under')
@conditioning_options
@click.option('--simulate/--no-simulate', default=True, show_default=True,
              help='run the motion held out through the pybullet plant, the model before and after')
def diagnose_bags(bags: tuple[str, ...], holdout: tuple[str, ...], robot: str, model: str | None,
                  output: Path, namespace: str | None, cutoff: float | None,
                  rows: float | None, low_speed: float | None, simulate: bool) -> None:
    """Name what a model gets wrong about the machine that made the bags."""
    machine = read_machine(robot)
    baseline = None if model is None else read_model_file(model)
    # refuses a model of another machine before any long work
    known = None if baseline is None else build_model(machine, baseline)
    refuse_unwritable(output)
    with Console(stderr=True).status('reading the bags') as status:
        logs = []
        for bag in distinct_bags((*bags, *holdout)):
            status.update(f'reading {bag}')
            logs.append(read_log(bag, machine, namespace))
        status.update('looking for mistakes of the setup')
        check = check_setup(logs, machine, known)
        conditioning = conditioning_for(check.logs, check.machine, CONDITIONING,
                                        Chosen(cutoff, rows, low_speed))
        check = replace(check, machine=with_gravity_told(check.machine, check.logs, conditioning))
        logs, machine = check.logs, check.machine
        diagnosis = diagnosed_if_sound(check, lambda sound: diagnose(
            sound.logs[:len(bags)], sound.machine, baseline, sound.logs[len(bags):],
            conditioning=conditioning, progress=status.update))
        experiment = confrontation = extended = None
        if isinstance(diagnosis, Diagnosis):
            status.update('looking for the motion that would tell twins apart')
            experiment = next_experiment(diagnosis, machine)
            extended = model_after(diagnosis)
            if simulate:
                confrontation = confront_diagnosis(diagnosis, machine, logs,
                                                   progress=status.update)
        outcome = outcome_of_diagnosis(diagnosis, machine, experiment)
        outcome = replace(outcome, remarks=(*outcome.remarks,
                                            *remarks_of_confrontation(confrontation)))
        outcome = with_setup(outcome, check, 'diagnosis')
        origin = provenance('par4_diagnose', machine, (*bags, *holdout),
                            {'holdout': holdout, 'model': model, 'namespace': namespace,
                             **asdict(conditioning)})
        status.update('drawing the report')
        # the plot library is slow to load, and some homes make it talk on stderr
        from par4_identification.report import report_of_diagnosis
        results = {
            'diagnosis.json': {**diagnosis_json(diagnosis, machine, experiment),
                               'setup': setup_json(check),
                               'simulation': simulation_json(confrontation)},
            'extended_model.yaml': extended and model_in_units(
                extended.model_copy(update={'provenance': origin}), machine),
            'report.html': report_of_diagnosis(diagnosis, outcome, machine, logs, origin,
                                               experiment, confrontation)}
        motion = experiment and experiment.motion
        if motion is not None:  # before what names it
            write_motion(output / MOTION_FILE, motion, 'platform')
        write_results(output, results)
    if motion is None:
        for left in (output / MOTION_FILE, (output / MOTION_FILE).with_suffix('.csv')):
            left.unlink(missing_ok=True)
    console = Console(highlight=False)
    for line in outcome.first:
        console.print(line, soft_wrap=not console.is_terminal, markup=False)
    console.print(f'{diagnosis.verdict}: {outcome.sentence}',
                  soft_wrap=not console.is_terminal, markup=False)
    console.print(f'results and report: {output}', soft_wrap=True, markup=False)


def main() -> None:
    """Run the executable."""
    run(diagnose_bags)


if __name__ == '__main__':
    main()
