"""par4_validate: how well a model calculates the torque of a measured bag."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_identification.commands.conditioning import conditioning_options
from par4_identification.commands.report_option import report_option
from par4_sim.commands.entry import loading, run


@click.command('par4_validate', epilog='\b\nExample:\n'
    '  par4_validate other_bag --model identified/model.yaml \\\n'
    '      --robot reference --output validated')
@click.argument('bag')
@click.option('--model', required=True, help='model.yaml or built-in name')
@click.option('--robot', required=True, help='robot.yaml or built-in name')
@click.option('--output', required=True, type=click.Path(path_type=Path),
              help='folder for validation.json and report.html')
@click.option('--namespace', default=None, help='that the topics sit under')
@conditioning_options
@report_option
def validate_bag(**options: Any) -> None:
    """Cross-validate a model on a bag that it was not identified from."""
    with loading():
        from par4_identification.jobs import validate
    validate.validate_bag(**options)


def main() -> None:
    """Run the executable."""
    run(validate_bag)


if __name__ == '__main__':
    main()
