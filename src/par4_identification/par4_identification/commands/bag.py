"""par4_bag: a bag in the contract's format from CSV, numpy or MATLAB logs of any machine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from par4_identification.logs.units import HIGHEST_RATE_HZ, LOWEST_RATE_HZ, UNITS
from par4_sim.choices import STORAGES
from par4_sim.commands.entry import loading, run
from par4_sim.commands.numbers import ANY_SIGN, Number, Numbers


@click.command('par4_bag', epilog='\b\nExample:\n'
    "  par4_bag log.csv \\\n"
    "      --columns 'time=t:ms position=2-5:deg voltage=6-9:V' \\\n"
    "      --robot reference --output my_bag")
@click.argument('files', nargs=-1, required=True, metavar='FILE...')
@click.option('--columns', required=True, metavar="'QUANTITY=COLUMN:UNIT ...'",
              help='what the columns are: time, position (of a single axis without one its '
                   'velocity), velocity, torque, voltage; a column by its name or its number from '
                   '1, those of several joints as a,b,c,d or 2-5; units '
                   + ', '.join(' '.join(units) for units in UNITS.values())
                   + ', or how much of one, such as 0.088deg')
@click.option('--output', required=True, type=click.Path(path_type=Path), metavar='BAG')
@click.option('--robot', default=None,
              help='robot.yaml or built-in name: names the joints, and the columns must fit it')
@click.option('--joints', default=None, metavar='NAME[,...]',
              help='names of the joints where there is no robot.yaml yet; arm_joint_0 .. '
                   'arm_joint_3 if there are four')
@click.option('--array', default=None, help='the table in an .npz or .mat file that holds several')
@click.option('--rate', default=None, type=Number(min=LOWEST_RATE_HZ, max=HIGHEST_RATE_HZ),
              metavar='HZ',
              help='of the samples, where no column is the time')
@click.option('--counts-per-turn', default=(), type=Numbers(),
              help='of the joint, behind its gear, for counts')
@click.option('--motor-gain', default=(), type=Numbers(),
              help='N m/A or N/A at the joint, for amperes')
@click.option('--rated-torque', default=(), type=Numbers(),
              help='N m or N at the joint, for % and permille')
@click.option('--between', default=None, type=(ANY_SIGN, ANY_SIGN), metavar='START END',
              help='only the samples between these times of the file, s')
@click.option('--unwrap', is_flag=True, help='positions that jump by whole turns go on')
@click.option('--wraps-after', default=None, type=Number(min=0.0, min_open=True), metavar='WAY',
              help='positions that start again after this way go on; in their unit, such as 65536 '
                   'for a counter of 16 bits')
@click.option('--storage', default='mcap', show_default=True, type=click.Choice(STORAGES))
def make_bag(**options: Any) -> None:
    """Make a bag of FILES: CSV, .npz or .mat, parts of one recording in order.

    Files with different columns and a time of the same name are put beside each other.

    Says what it read and what looks wrong; the other tools then read the bag.

    With `--inspect` it says instead what a bag holds and what each tool could do with it:

    \b
      par4_bag --inspect BAG [--robot NAME] [--namespace NAME] [--json]
      par4_bag --inspect --help
    """
    with loading():
        from par4_identification.jobs import bag
    bag.make_bag(**options)


def main() -> None:
    """Make a bag, or look at one with `--inspect BAG`."""
    if any(argument.split('=')[0] == '--inspect' for argument in sys.argv[1:]):
        from par4_identification.commands.inspect import inspect
        run(inspect)
    run(make_bag)


if __name__ == '__main__':
    main()
