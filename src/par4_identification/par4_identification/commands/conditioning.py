"""The options of the offline tools that set filters and rates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from par4_sim.commands.numbers import POSITIVE


def conditioning_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Return a command function with `--cutoff`, `--rows` and `--low-speed`."""
    for option in reversed((
        click.option('--cutoff', default=None, type=POSITIVE, metavar='HZ',
                     help='low-pass of the torque; by default 40 Hz, of an axis chosen from the '
                          'data'),
        click.option('--rows', default=None, type=POSITIVE, metavar='HZ',
                     help='rate of the rows; by default 2.5 times the cut-off'),
        click.option('--low-speed', default=None, type=POSITIVE, metavar='SPEED',
                     help='joint speed below which friction is not known, rad/s or m/s; of an '
                          'axis chosen from the data'))):
        command = option(command)
    return command
