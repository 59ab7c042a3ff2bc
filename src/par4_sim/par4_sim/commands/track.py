"""par4_track: how well controllers and models make a machine follow a motion."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from par4_dynamics.model import read_model
from par4_kinematics.robot import read_robot
from par4_sim.commands.entry import run
from par4_sim.commands.motion_options import motion_asked, motion_options
from par4_sim.report.results import origin, refuse_unwritable, write_results
from par4_sim.report.words import in_words
from par4_sim.simulation import FIDELITIES
from par4_sim.tracking.case import (
    CONTROLLERS,
    NO_FEEDFORWARD,
    Case,
    Plan,
    compared,
    model_name,
    models_named,
)
from par4_sim.tracking.comparison import (
    BRIEF,
    cells_of,
    headings_of,
    outcome_of_tracking,
    tracking_json,
)
from par4_sim.tracking.learning import CYCLES
from par4_sim.tracking.metrics import BAND


@click.command('par4_track', epilog='\b\nExample:\n'
    '  par4_track adept --controller loops --feedforward table1 \\\n'
    '      --output tracked')
@click.argument('motion')
@click.option('--robot', default='reference', show_default=True, help='robot.yaml or built-in name')
@click.option('--machine', default='table1_full', show_default=True,
              help='model.yaml or built-in name: the machine as it truly is, effects included')
@click.option('--controller', default=('loops',), multiple=True, show_default=True,
              type=click.Choice(CONTROLLERS), help='law of the drives; may be given several times')
@click.option('--feedforward', default=(NO_FEEDFORWARD,), multiple=True, show_default=True,
              help='model.yaml or built-in name whose torques the drives get, or none; may be '
                   'given several times')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for tracking.json and report.html')
@click.option('--fidelity', default='exact', show_default=True, type=click.Choice(FIDELITIES))
@motion_options
@click.option('--learning-cycles', default=CYCLES, show_default=True, type=click.IntRange(min=1),
              help='how often a learning controller does the motion')
@click.option('--band', default=1e3 * BAND, show_default=True,
              type=click.FloatRange(min=0.0, min_open=True),
              help='half width of the limit band of overshoot and settling time, mm')
def track(motion: str, robot: str, machine: str, controller: tuple[str, ...],
          feedforward: tuple[str, ...], output: Path, fidelity: str, learning_cycles: int,
          band: float, **played_options: float | None) -> None:
    """Compare how a simulated machine follows MOTION (adept, excitation, circle, motion.yaml)."""
    asked = read_robot(robot)
    truth = read_model(machine, asked)
    models = models_named(feedforward, asked)
    played = motion_asked(motion, asked, **played_options)
    cycles = int(played_options['cycles'] or 1)
    refuse_unwritable(output)
    plan = Plan(asked, truth, played, cycles, 1e-3 * band, fidelity, learning_cycles)
    with Console(stderr=True).status('simulating') as status:
        cases = compared(plan, controller, models, status.update)
        status.update('drawing the report')
        # the plot library is slow to load, and some homes make it talk on stderr
        from par4_sim.tracking.report import report_of_tracking
        outcome = outcome_of_tracking(cases, played, model_name(machine), asked)
        provenance = origin('par4_track', asked, {
            'motion': motion, 'machine': machine, 'controller': list(controller),
            'feedforward': list(feedforward), 'learning_cycles': learning_cycles,
            'fidelity': fidelity, 'band_mm': band, **played_options})
        write_results(output, {
            'tracking.json': tracking_json(cases, played, asked, cycles, 1e-3 * band, provenance),
            'report.html': report_of_tracking(cases, outcome, asked, 1e-3 * band, provenance)})
    console = Console(highlight=False)
    console.print(_table(cases))
    for text in (outcome.sentence, f'results and report: {output}'):
        console.print(text, soft_wrap=True, markup=False)


def _table(cases: list[Case]) -> Table:
    table = Table(box=None, header_style='', pad_edge=False)
    table.add_column('controller', no_wrap=True)
    table.add_column('feedforward', no_wrap=True)
    for heading in headings_of(BRIEF):
        table.add_column(heading, justify='right')
    for case in cases:
        table.add_row(in_words(case.controller), case.feedforward, *cells_of(case, BRIEF))
    return table


def main() -> None:
    """Run the executable."""
    run(track)


if __name__ == '__main__':
    main()
