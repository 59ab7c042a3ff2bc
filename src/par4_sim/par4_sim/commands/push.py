"""par4_push: the paper's static push on a force sensor, simulated."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_sim.choices import FIDELITIES
from par4_sim.commands.entry import loading, run
from par4_sim.commands.numbers import NOT_NEGATIVE, SEED, Number


@click.command('par4_push', epilog='\b\nExample:\n'
    '  par4_push --torque-noise 0.05 --force-noise 0.5 --output push')
@click.option('--robot', default='reference', show_default=True, help='robot.yaml or built-in name')
@click.option('--model', default='table1_full', show_default=True,
              help='model.yaml or built-in name: the machine as it truly is, effects included')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='bag to write; the readings go to OUTPUT.csv')
@click.option('--force', default=250.0, show_default=True, type=Number(min=1.0),
              help='largest push, N')
@click.option('--fidelity', default='exact', show_default=True, type=click.Choice(FIDELITIES))
@click.option('--seed', default=0, show_default=True, type=SEED, help='seed of the noise')
@click.option('--torque-noise', default=0.0, show_default=True, type=NOT_NEGATIVE,
              help='noise on the recorded voltage, as torque, N m rms')
@click.option('--force-noise', default=0.0, show_default=True, type=NOT_NEGATIVE,
              help='noise of the force sensor, N rms')
def push(**options: Any) -> None:
    """Simulate slow pushes of the platform on a force plate into a bag, its readings into a CSV."""
    with loading():
        from par4_sim.jobs.push import pushed
    with click.progressbar(length=1000, label='simulating static pushes') as bar:
        line = pushed(**options, progress=lambda share: bar.update(round(1000 * share) - bar.pos))
        bar.update(1000 - bar.pos)
    click.echo(line)


def main() -> None:
    """Run the executable."""
    run(push)
