"""par4_record --repair: mends a bag that was cut off."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NoReturn

import click

from par4_sim.choices import REPAIR, repair_command
from par4_sim.commands.entry import loading, run


@click.command('par4_record', epilog='\b\nExample:\n'
    '  ' + repair_command('my_bag'))
@click.option(REPAIR, 'bag', required=True, type=click.Path(path_type=Path),
              help='bag that was cut off; it stays as it is')
@click.option('--output', default=None, type=click.Path(path_type=Path),
              help='bag to write  [default: BAG_repaired]')
def repair(**options: Any) -> None:
    """Write what a cut-off bag still holds as a complete bag."""
    with loading():
        from par4_identification.jobs.repair import repaired
    click.echo(repaired(**options))


def main() -> NoReturn:
    """Run the command and exit."""
    run(repair)
