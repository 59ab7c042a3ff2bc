"""par4_simulate: a motion of a simulated Par4 into a bag, without ROS."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_sim.choices import FIDELITIES, STORAGES
from par4_sim.commands.entry import loading, run
from par4_sim.commands.numbers import NOT_NEGATIVE, SEED, Date, Number


@click.command('par4_simulate', epilog='\b\nExample:\n'
    '  par4_simulate excitation --duration 20 --torque-noise 0.05 \\\n'
    '      --output my_bag')
@click.argument('motion')
@click.option('--robot', default='reference', show_default=True, help='robot.yaml or built-in name')
@click.option('--model', default='table1_full', show_default=True,
              help='model.yaml or built-in name: the machine as it truly is, effects included')
@click.option('--output', required=True, type=click.Path(path_type=Path), help='bag to write')
@click.option('--fidelity', default='exact', show_default=True, type=click.Choice(FIDELITIES))
@click.option('--feedforward', default=None, help='model whose torques the drives get')
@click.option('--duration', default=None, type=Number(min=0.1),
              help='seconds, of a named motion')
@click.option('--motion-seed', default=None, type=SEED,
              help='seed of the excitation  [default: 0]')
@click.option('--seed', default=0, show_default=True, type=SEED, help='seed of the noise')
@click.option('--torque-noise', default=0.0, show_default=True, type=NOT_NEGATIVE,
              help='noise on the recorded voltage, as torque, N m rms')
@click.option('--noise-time', default=0.0, show_default=True, type=NOT_NEGATIVE,
              help='correlation time of that noise, s; 0 = white')
@click.option('--position-noise', default=0.0, show_default=True, type=NOT_NEGATIVE,
              help='noise on the recorded positions, rad rms')
@click.option('--stamp-jitter', default=0.0, show_default=True, type=NOT_NEGATIVE,
              help='error of the stamps, s rms; the values belong to the even times')
@click.option('--rate', default=1000.0, show_default=True, type=Number(min=1.0),
              help='samples a second')
@click.option('--date', default=None, type=Date(),
              help='at which the simulation begins, UTC; without one its clock begins at zero')
@click.option('--storage', default='mcap', show_default=True,
              type=click.Choice(STORAGES))
def simulate(**options: Any) -> None:
    """Simulate MOTION (adept, excitation, circle or a motion.yaml) into a bag, without ROS."""
    with loading():
        from par4_sim.jobs.simulate import simulated
    with click.progressbar(length=1000, label=f'simulating {options["motion"]}') as bar:
        line = simulated(**options,
                         progress=lambda share: bar.update(round(1000 * share) - bar.pos))
        bar.update(1000 - bar.pos)
    click.echo(line)


def main() -> None:
    """Run the executable."""
    run(simulate)
