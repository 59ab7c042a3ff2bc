"""par4_cell: the compositions of the launch files, without `ros2 launch`."""

from __future__ import annotations

import signal
import sys
from pathlib import Path

import click

from par4_kinematics.errors import InputError
from par4_sim.cell.cell import COMPOSITIONS, Composition
from par4_sim.cell.running_cell import run_session
from par4_sim.commands.entry import run
from par4_start import STOPPED, tool_is_interrupted

VIEW = 'rviz'
"""Argument that launch files have beyond those of a composition."""


def _described(name: str, composition: Composition) -> str:
    lines = [f'{name}: {composition.summary}']
    for argument in composition.arguments:
        allowed = f' (one of {", ".join(argument.allowed)})' if argument.allowed else ''
        lines.append(f'  {argument.name}:={argument.written}  {argument.description}{allowed}')
    return '\b\n' + '\n'.join(lines)


@click.command('par4_cell', epilog='\n\n'.join(
    _described(*item) for item in COMPOSITIONS.items()) + '\n\n\b\nExample:\n'
    '  par4_cell identification duration:=20 noise:=0.05 output:=identified')
@click.argument('composition', metavar='COMPOSITION', type=click.Choice(tuple(COMPOSITIONS)))
@click.argument('arguments', nargs=-1, metavar='[NAME:=VALUE]...')
@click.option('--log', default=None, type=click.Path(path_type=Path, dir_okay=False),
              help='file for what the nodes say, instead of this terminal')
def cell(composition: str, arguments: tuple[str, ...], log: Path | None) -> None:
    """Run the nodes of a COMPOSITION together, as its launch file does.

    When a part fails, all end. When a motion has been played, all end; Ctrl-C ends them before.
    """
    given: dict[str, str] = {}
    for argument in arguments:
        name, sign, value = argument.partition(':=')
        if not sign:
            raise InputError(f'argument {argument!r}: give it as NAME:=VALUE')
        if name == VIEW:
            raise InputError(f'argument {VIEW}: RViz is no part of this suite, ros2 launch starts '
                             f'it where ROS is installed (ros2 launch par4_sim cell.launch.py '
                             f'{VIEW}:=true); window:=true shows the robot without it')
        if name in given:
            raise InputError(f'argument {name}: given twice, as {given[name]!r} and {value!r}; '
                             f'give it once')
        given[name] = value
    session = COMPOSITIONS[composition].session(given)
    tool_is_interrupted()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # the terminal was closed
        signal.signal(signal.SIGHUP, signal.default_int_handler)
    try:
        code = run_session(session, log)
    except KeyboardInterrupt:
        code = 0 if session.player is None else STOPPED
    sys.exit(code)


def main() -> None:
    """Run the executable."""
    run(cell)


if __name__ == '__main__':
    main()
