"""par4_trend: base parameters and effects of dated bags over time, and when they changed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_sim.commands.entry import loading, run


@click.command('par4_trend', epilog='\b\nExample:\n'
    '  par4_trend bags/2026-* --robot reference --output life')
@click.argument('bags', nargs=-1, required=True, metavar='BAG...')
@click.option('--robot', required=True, help='robot.yaml or built-in name')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for trend.json and report.html; what each bag said is kept there and '
                   'not computed again')
@click.option('--scheduler', default=None, metavar='ADDRESS',
              help='of a dask cluster whose workers see the same files, as tcp://HOST:8786; '
                   'without one all cores of this machine')
@click.option('--model', default=None,
              help='model.yaml or built-in name whose rigid body is known and whose effects are '
                   'followed')
@click.option('--namespace', default=None, help='that the topics sit under')
def trend_of_bags(**options: Any) -> None:
    """Follow a machine over its life through dated bags."""
    with loading():
        from par4_identification.jobs import trend
    trend.trend_of_bags(**options)


def main() -> None:
    """Run the executable."""
    run(trend_of_bags)


if __name__ == '__main__':
    main()
