"""The options with which a command takes its motion."""

from __future__ import annotations

from collections.abc import Callable

import click

from par4_sim.choices import PERIOD
from par4_sim.commands.numbers import ANY_SIGN, FROM_ONE, NOT_NEGATIVE, POSITIVE, SEED, Number

_OPTIONS = (
    click.option('--duration', default=None, type=Number(min=0.1),
                 help='seconds, of excitation or circle'),
    click.option('--motion-seed', default=None, type=SEED,
                 help='seed of the excitation  [default: 0]'),
    click.option('--period', default=None, type=Number(min=2e-4, max=0.1),
                 help=f'seconds between the points of the reference of a named motion; torque is '
                      f'interpolated linearly between them, so that shorter is more exact  '
                      f'[default: {PERIOD:g}]'),
    click.option('--cycles', default=None, type=FROM_ONE,
                 help='adept: round trips  [default: 1]'),
    click.option('--speed', default=None, type=POSITIVE, help='adept: limit, m/s  [default: 5]'),
    click.option('--acceleration', default=None, type=POSITIVE,
                 help='adept: limit, m/s2  [default: 150]'),
    click.option('--jerk', default=None, type=POSITIVE,
                 help='adept: limit, m/s3  [default: none, trapezoids of speed]'),
    click.option('--round-trip', default=None, type=NOT_NEGATIVE,
                 help='adept: seconds, 0 for corners without blend  [default: 0.25]'),
    click.option('--theta-swing', default=None, type=ANY_SIGN,
                 help='adept: range of theta, rad  [default: 0]'))


def motion_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of its motion."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command
