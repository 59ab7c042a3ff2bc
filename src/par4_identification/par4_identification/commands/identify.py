"""par4_identify: measured bags into a model, TABLE 1 and a report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_identification.commands.conditioning import conditioning_options
from par4_identification.commands.report_option import report_option
from par4_identification.estimators.names import ESTIMATORS
from par4_sim.commands.entry import loading, run


@click.command('par4_identify', epilog='\b\nExample:\n'
    '  par4_identify my_bag --robot reference --rigid-body full \\\n'
    '      --output identified\n\n'
    '\b\nOf two bags, one bare and one loaded with 0.5 kg or an unknown mass:\n'
    '  par4_identify bare loaded --payload loaded=0.5 \\\n'
    '      --robot reference --rigid-body full --output gains\n'
    '  par4_identify bare loaded --unknown-payload loaded \\\n'
    '      --robot reference --rigid-body full --output weighed')
@click.argument('bags', nargs=-1, required=True, metavar='BAG...')
@click.option('--robot', required=True, help='robot.yaml or built-in name')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for model.yaml, identification.json and report.html')
@click.option('--rigid-body', default='paper', show_default=True,
              type=click.Choice(('paper', 'full')),
              help='equation (20), or with rods and bars distributed')
@click.option('--estimator', default='weighted', show_default=True, type=click.Choice(ESTIMATORS),
              help='docs/identification.md says which one when')
@click.option('--per-joint', is_flag=True,
              help='a value of its own for each joint, but for the platform masses')
@click.option('--offsets', is_flag=True, help='with a constant torque of each joint')
@click.option('--payload', multiple=True, metavar='BAG=KG',
              help='known mass at the tool in one of the bags; repeat for others; bags with and '
                   'without it tell the drive gains too')
@click.option('--unknown-payload', multiple=True, metavar='BAG',
              help='one of the bags, recorded with a payload: its mass and half plate are '
                   'estimated, the parameters come from the other bags')
@click.option('--namespace', default=None, help='that the topics sit under')
@conditioning_options
@click.option('--compare-true', default=None, metavar='MODEL',
              help='model of a simulated machine, shown beside what was identified')
@report_option
def identify_bags(**options: Any) -> None:
    """Identify the parameters of equation (20) from measured bags."""
    with loading():
        from par4_identification.jobs import identify
    identify.identify_bags(identify.IdentificationRequest(**options))


def main() -> None:
    """Run the executable."""
    run(identify_bags)


if __name__ == '__main__':
    main()
