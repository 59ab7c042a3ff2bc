"""par4_drive_gain: the gains of the drives from static pushes on a force sensor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_sim.commands.entry import loading, run
from par4_sim.commands.numbers import NOT_NEGATIVE


@click.command('par4_drive_gain', epilog='\b\nExample:\n'
    '  par4_drive_gain push=push.csv --robot reference --output gains')
@click.argument('pushes', nargs=-1, required=True, metavar='BAG=FORCE.csv...')
@click.option('--robot', required=True, help='robot.yaml or built-in name; its gains are nominal')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for drive_gain.json and report.html')
@click.option('--coulomb-friction', default=None, type=NOT_NEGATIVE, metavar='NM',
              help='largest friction at rest, N m: bounds the gain of joints that do not slide '
                   'both ways')
@click.option('--namespace', default=None, help='that the topics sit under')
def find_gains(**options: Any) -> None:
    """Find the drive gains from bags of static pushes and the readings t,fx,fy,fz of a sensor.

    t is the stamp in seconds on the clock of the bag, the force that on the platform in `base`, N.
    """
    with loading():
        from par4_identification.jobs import drive_gain
    drive_gain.find_gains(**options)


def main() -> None:
    """Run the executable."""
    run(find_gains)


if __name__ == '__main__':
    main()
