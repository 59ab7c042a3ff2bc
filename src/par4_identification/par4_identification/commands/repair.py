"""par4_record --repair: mends a bag that was cut off."""

from __future__ import annotations

from pathlib import Path

import click

from par4_sim.bag_repair import repair_bag
from par4_sim.commands.entry import run


@click.command('par4_record', epilog='\b\nExample:\n'
    '  par4_record --repair my_bag')
@click.option('--repair', 'bag', required=True, type=click.Path(path_type=Path),
              help='bag that was cut off; it stays as it is')
@click.option('--output', default=None, type=click.Path(path_type=Path),
              help='bag to write  [default: BAG_repaired]')
def repair(bag: Path, output: Path | None) -> None:
    """Write what a cut-off bag still holds as a complete bag."""
    summary = repair_bag(bag, output or bag.with_name(f'{bag.stem}_repaired'))
    topics = ', '.join(f'{name} {count}' for name, count in sorted(summary.messages.items()))
    damaged = f'; {summary.damaged} damaged parts left out' if summary.damaged else ''
    without = (f'; left out {", ".join(sorted(summary.left_out))}, of unknown type'
               if summary.left_out else '')
    click.echo(f'{summary.output}: {sum(summary.messages.values())} messages recovered ({topics})'
               f'{damaged}{without}')


def main() -> None:
    """Run the command."""
    run(repair)
