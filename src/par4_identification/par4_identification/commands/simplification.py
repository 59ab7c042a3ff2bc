"""par4_simplification: the paper's validation of (20) against the whole mechanism."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_sim.commands.entry import loading, run


@click.command('par4_simplification', epilog='\b\nExample:\n'
    '  par4_simplification --robot reference --model table1 \\\n'
    '      --output simplification')
@click.option('--robot', default='reference', show_default=True,
              help='robot.yaml or built-in name; its bodies are what (20) leaves out')
@click.option('--model', default='table1', show_default=True,
              help='model.yaml or built-in name; its base parameters are those of both sides')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for simplification.json and report.html')
@click.option('--motion', default=None,
              help='adept, excitation, circle or a motion.yaml  [default: the Adept cycle of '
                   '15 G, jerk-limited, theta over the range of the robot]')
@click.option('--fidelity', default='accurate', show_default=True,
              type=click.Choice(('accurate', 'fast')))
def simplify(**options: Any) -> None:
    """Measure what equation (20) leaves out, by imposed displacement in pybullet (Fig. 6)."""
    with loading():
        from par4_identification.jobs import simplification
    simplification.simplify(**options)


def main() -> None:
    """Run the executable."""
    run(simplify)


if __name__ == '__main__':
    main()
