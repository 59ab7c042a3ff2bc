"""par4_bag: a bag in the contract's format from CSV, numpy or MATLAB logs of any machine."""

from __future__ import annotations

import sys
from pathlib import Path

import click
from rich.console import Console

from par4_identification.logs.table_bag import (
    Part,
    Scales,
    chosen_columns,
    measured_of_files,
    write_measured,
)
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import JOINT_NAMES, Axis, Robot, read_machine
from par4_sim.bag import STORAGES
from par4_sim.commands.entry import run


class Numbers(click.ParamType):
    """Positive numbers parted by commas."""

    name = 'number[,...]'

    def convert(self, value: str | tuple[float, ...], param: click.Parameter | None,
                ctx: click.Context | None) -> tuple[float, ...]:
        """Return the numbers."""
        if isinstance(value, tuple):
            return value
        try:
            numbers = tuple(float(part) for part in value.split(','))
        except ValueError:
            numbers = ()
        if not numbers or not all(0.0 < number < float('inf') for number in numbers):
            self.fail(f'{value!r} is not a positive number, or several parted by commas', param,
                      ctx)
        return numbers


@click.command('par4_bag', epilog='\b\nExample:\n'
    "  par4_bag log.csv \\\n"
    "      --columns 'time=t:ms position=2-5:deg voltage=6-9:V' \\\n"
    "      --robot reference --output my_bag")
@click.argument('files', nargs=-1, required=True, metavar='FILE...')
@click.option('--columns', required=True, metavar="'QUANTITY=COLUMN:UNIT ...'",
              help='what the columns are: time, position, velocity, torque, voltage; a column by '
                   'its name or its number from 1, those of several joints as a,b,c,d or 2-5; '
                   'units s ms us ns, rad deg turn counts m mm, rad/s deg/s turn/s rpm counts/s '
                   'm/s mm/s, Nm mNm N A mA, V mV')
@click.option('--output', required=True, type=click.Path(path_type=Path), metavar='BAG')
@click.option('--robot', default=None,
              help='robot.yaml or built-in name: names the joints, and the columns must fit it')
@click.option('--joints', default=None, metavar='NAME[,...]',
              help='names of the joints where there is no robot.yaml yet; arm_joint_0 .. '
                   'arm_joint_3 if there are four')
@click.option('--array', default=None, help='the table in an .npz or .mat file that holds several')
@click.option('--rate', default=None, type=click.FloatRange(min=0.0, min_open=True), metavar='HZ',
              help='of the samples, where no column is the time')
@click.option('--counts-per-turn', default=(), type=Numbers(),
              help='of the joint, behind its gear, for counts')
@click.option('--motor-gain', default=(), type=Numbers(),
              help='N m/A or N/A at the joint, for amperes')
@click.option('--between', default=None, type=(float, float), metavar='START END',
              help='only the samples between these times of the file, s')
@click.option('--unwrap', is_flag=True, help='positions that jump by whole turns go on')
@click.option('--storage', default='mcap', show_default=True, type=click.Choice(STORAGES))
def make_bag(files: tuple[str, ...], columns: str, output: Path, robot: str | None,
             joints: str | None, array: str | None, rate: float | None,
             counts_per_turn: tuple[float, ...], motor_gain: tuple[float, ...],
             between: tuple[float, float] | None, unwrap: bool, storage: str) -> None:
    """Make a bag of FILES: CSV, .npz or .mat, parts of one recording in order.

    Says what it read and what looks wrong; the other tools then read the bag.
    `par4_bag --inspect BAG` instead says what a bag holds and what each tool could do with it.
    """
    choices = chosen_columns(columns)
    machine = None if robot is None else read_machine(robot)
    names = joint_names(machine, joints, len(choices['position'].columns))
    if output.exists():
        raise InputError(f'{output}: exists already; give another path or remove it')
    start, end = between or (-float('inf'), float('inf'))
    with Console(stderr=True).status('reading the files') as status:
        measured = measured_of_files(files, choices, Scales(counts_per_turn, motor_gain),
                                     Part(array, rate, start, end, unwrap))
        kind = machine.kind if isinstance(machine, Axis) else 'revolute'
        if machine is not None and measured.kind != kind:
            raise InputError(f'position in {choices["position"].unit}: {robot} has {kind} joints; '
                             f'mend --columns or the robot file')
        counts = write_measured(measured, names, output, storage, lambda share: status.update(
            f'writing {output}: {share:.0%}'))
    console = Console(highlight=False)
    for line in measured.account():
        console.print(line, soft_wrap=True, markup=False)
    for finding in measured.findings():
        console.print(f'look at this: {finding}', soft_wrap=True, markup=False)
    console.print(f'{output}: ' + ', '.join(f'{topic} {count}' for topic, count in counts.items())
                  + f' of {", ".join(names)}', soft_wrap=True, markup=False)


def joint_names(machine: Robot | Axis | None, joints: str | None, count: int) -> tuple[str, ...]:
    """Return the names of `count` joints.

    Raises:
        InputError: both or neither given, or names of another number of joints.
    """
    if machine is not None and joints is not None:
        raise InputError('--joints and --robot both name the joints; give one of them')
    if machine is not None:
        names, source = machine.joint_names, '--robot'
    elif joints is not None:
        names, source = tuple(name.strip() for name in joints.split(',')), '--joints'
    elif count == LEGS:
        names, source = JOINT_NAMES, 'a Par4'
    else:
        raise InputError(f'no names for {count} columns of positions: name the joints by --joints '
                         f'as in the robot.yaml, or give --robot')
    if len(names) != count or len(set(names)) < count or not all(names):
        raise InputError(f'{source}: {len(names)} joints ({", ".join(names)}), the positions have '
                         f'{count} columns; give one column a joint, each with its own name')
    return names


def main() -> None:
    """Make a bag, or look at one with `--inspect BAG`."""
    if any(argument.split('=')[0] == '--inspect' for argument in sys.argv[1:]):
        from par4_identification.commands.inspect import inspect  # loads what all tools need
        run(inspect)
    run(make_bag)


if __name__ == '__main__':
    main()
