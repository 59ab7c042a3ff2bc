"""par4_fastest: the shortest time of a path within torque and a peak error."""

from __future__ import annotations

from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from par4_dynamics.model import read_model
from par4_kinematics.motion_file import write_motion
from par4_kinematics.robot import read_robot
from par4_sim.commands.entry import run
from par4_sim.commands.motion_options import motion_asked, motion_options
from par4_sim.plant import STEP
from par4_sim.report.results import origin, refuse_unwritable, write_results
from par4_sim.simulation import FIDELITIES
from par4_sim.tracking.case import CONTROLLERS, NO_FEEDFORWARD, Plan, models_named
from par4_sim.tracking.fastest import OWN, PEAK, TIME_OPTIMAL, TIMINGS, fastest_cases
from par4_sim.tracking.learning import CYCLES


@click.command('par4_fastest', epilog='\b\nExample:\n'
    '  par4_fastest adept --feedforward table1_full --output fastest')
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
              help='folder for fastest.json, report.html and the fastest motion, fastest.yaml')
@click.option('--timing', default=tuple(TIMINGS), multiple=True, show_default=True,
              type=click.Choice(tuple(TIMINGS)),
              help='of the path: as MOTION has it, or time-optimal; may be given several times')
@click.option('--peak', default=1e3 * PEAK, show_default=True,
              type=click.FloatRange(min=0.0, min_open=True), help='limit of the error of D, mm')
@click.option('--fidelity', default='exact', show_default=True, type=click.Choice(FIDELITIES))
@motion_options
@click.option('--learning-cycles', default=CYCLES, show_default=True, type=click.IntRange(min=1),
              help='how often a learning controller does the motion')
def fastest(motion: str, robot: str, machine: str, controller: tuple[str, ...],
            feedforward: tuple[str, ...], output: Path, timing: tuple[str, ...], peak: float,
            fidelity: str, learning_cycles: int, **played_options: float | None) -> None:
    """Find how fast a simulated machine can do MOTION (adept, circle, a motion.yaml)."""
    asked = read_robot(robot)
    truth = read_model(machine, asked)
    models = models_named(feedforward, asked)
    played = motion_asked(motion, asked, **played_options)
    refuse_unwritable(output)
    limit = truth.torque_limit or asked.drives.torque_limit
    with Console(stderr=True).status('looking for the bound') as status:
        from par4_sim.tracking.fastest_outcome import (
            HEADINGS,
            NAMES,
            best_of,
            fastest_json,
            outcome_of_fastest,
            rows_of_fastest,
        )
        from par4_sim.tracking.fastest_report import report_of_fastest
        from par4_sim.tracking.time_optimal import (  # toppra is slow to load
            fastest_along,
            motion_of,
        )
        bound = fastest_along(asked, truth, played, limit)
        motions = {OWN: played, TIME_OPTIMAL: motion_of(
            bound, asked, f'{played.name}, time-optimal', STEP)}
        plans = {name: Plan(asked, truth, motions[name], fidelity=fidelity,
                            learning_cycles=learning_cycles) for name in timing}
        found = fastest_cases(plans, controller, models, bound.bound, 1e-3 * peak, status.update)
        status.update('drawing the report')
        outcome = outcome_of_fastest(found, bound, played, asked, limit, 1e-3 * peak)
        provenance = origin('par4_fastest', asked, {
            'motion': motion, 'machine': machine, 'controller': list(controller),
            'feedforward': list(feedforward), 'timing': list(timing), 'peak_mm': peak,
            'fidelity': fidelity, 'learning_cycles': learning_cycles, **played_options})
        write_results(output, {
            'fastest.json': fastest_json(found, bound, played, asked, limit, 1e-3 * peak,
                                         provenance),
            'report.html': report_of_fastest(found, bound, outcome, played, asked, provenance)})
        best = best_of(found)
        if best is not None:
            write_motion(output / 'fastest.yaml', best.case.run.motion)
    console = Console(highlight=False)
    table = Table(box=None, header_style='', pad_edge=False)
    for name in NAMES:
        table.add_column(name, no_wrap=True)
    for heading in HEADINGS:
        table.add_column(heading, justify='right', min_width=7)
    for names, cells in rows_of_fastest(found, bound):
        table.add_row(*names, *cells)
    console.print(table)
    for text in (outcome.sentence, f'results and report: {output}'):
        console.print(text, soft_wrap=True, markup=False)


def main() -> None:
    """Run the executable."""
    run(fastest)


if __name__ == '__main__':
    main()
