"""par4_excite: an excitation motion by design, and what to expect of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from par4_identification.excitation.request import ACCELERATION, DesignRequest
from par4_sim.commands.entry import loading, run
from par4_sim.commands.numbers import ANY_WHOLE, POSITIVE, Numbers

DEFAULTS = DesignRequest()


@click.command('par4_excite', epilog='\b\nExample:\n'
    '  par4_excite --robot reference --duration 20 --output motion.yaml')
@click.option('--robot', required=True, help='robot.yaml or built-in name')
@click.option('--model', default='table1', show_default=True,
              help='model.yaml or built-in name: about what the machine is')
@click.option('--output', required=True, type=click.Path(path_type=Path, dir_okay=False),
              help='motion.yaml to write, with a CSV of the samples beside it')
@click.option('--duration', default=DEFAULTS.duration, show_default=True, type=POSITIVE, help='s')
@click.option('--joint-speed', default=None, type=POSITIVE,
              help='at most, rad/s  [default: 0.55 of what the robot may]')
@click.option('--acceleration', default=ACCELERATION, show_default=True, type=POSITIVE,
              help='of either half plate at most, m/s2')
@click.option('--torque-limit', default=None, type=POSITIVE,
              help='of the model, N m  [default: 0.9 of what the drives have]')
@click.option('--torque-noise', default='0.05', show_default=True, type=Numbers(),
              metavar='N_M',
              help='to expect of a sample, N m rms; one number, or four with commas')
@click.option('--harmonics', default=DEFAULTS.harmonics, show_default=True, type=ANY_WHOLE,
              help='of the periodic paths')
@click.option('--base-frequency', default=None, type=POSITIVE,
              help='of the fast path, Hz  [default: to suit speed and acceleration]')
@click.option('--periods', default=None, type=ANY_WHOLE,
              help='of the slow path, 2 or more; the fast one is repeated as often as there is '
                   'time  [default: of about 4 s]')
@click.option('--slow-fraction', default=DEFAULTS.slow_fraction, show_default=True, type=POSITIVE,
              help='share of the duration for the slow path')
@click.option('--starts', default=DEFAULTS.starts, show_default=True, type=ANY_WHOLE,
              help='random paths that each optimisation begins with')
@click.option('--seed', default=DEFAULTS.seed, show_default=True, type=ANY_WHOLE)
def excite(**options: Any) -> None:
    """Design the motion from which the base parameters are known best."""
    with loading():
        from par4_identification.jobs import excite
    excite.excite(**options)


def main() -> None:
    """Run the executable."""
    run(excite)


if __name__ == '__main__':
    main()
