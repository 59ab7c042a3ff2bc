"""par4_bag --inspect: what a bag holds and what each tool could do with it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_sim.commands.entry import loading


@click.command('par4_bag', epilog='\b\nExample:\n'
    '  par4_bag --inspect my_bag --robot reference')
@click.option('--inspect', 'bag', required=True, type=click.Path(path_type=Path),
              help='bag to look at; it stays as it is, whether whole or cut off')
@click.option('--robot', default='reference', show_default=True,
              help='robot.yaml or built-in name of the machine that it is of')
@click.option('--namespace', default=None, help='that the topics sit under')
@click.option('--json', 'as_json', is_flag=True, help='print one JSON object instead of tables')
def inspect(**options: Any) -> None:
    """Say what a bag holds and what each tool could do with it."""
    with loading():
        from par4_identification.jobs import inspect
    inspect.inspect(**options)
