"""The options of the commands that run controllers with models on a simulated machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import click

from par4_sim.choices import CONTROLLERS, CYCLES, FIDELITIES, NO_FEEDFORWARD
from par4_sim.commands.motion_options import motion_options
from par4_sim.commands.numbers import FROM_ONE


def comparison_options(written: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return what gives a command the options of a comparison; `written` is what it writes."""
    options = (
        click.argument('motion'),
        click.option('--robot', default='reference', show_default=True,
                     help='robot.yaml or built-in name'),
        click.option('--machine', default='table1_full', show_default=True,
                     help='model.yaml or built-in name: the machine as it truly is, effects '
                          'included'),
        click.option('--controller', default=('loops',), multiple=True, show_default=True,
                     type=click.Choice(CONTROLLERS),
                     help='law of the drives; may be given several times'),
        click.option('--feedforward', default=(NO_FEEDFORWARD,), multiple=True, show_default=True,
                     help='model.yaml or built-in name whose torques the drives get, or none; may '
                          'be given several times'),
        click.option('--output', required=True, type=click.Path(path_type=Path),
                     help=f'folder for {written}'),
        click.option('--fidelity', default='exact', show_default=True,
                     type=click.Choice(FIDELITIES)),
        motion_options,
        click.option('--learning-cycles', default=CYCLES, show_default=True,
                     type=FROM_ONE,
                     help='how often a learning controller does the motion'))

    def with_options(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(options):
            command = option(command)
        return command

    return with_options
