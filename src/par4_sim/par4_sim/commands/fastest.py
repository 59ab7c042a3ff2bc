"""par4_fastest: the shortest time of a path within torque and a peak error."""

from __future__ import annotations

from typing import Any

import click

from par4_sim.choices import PEAK, TIMINGS
from par4_sim.commands.comparison_options import comparison_options
from par4_sim.commands.entry import loading, run
from par4_sim.commands.numbers import POSITIVE


@click.command('par4_fastest', epilog='\b\nExample:\n'
    '  par4_fastest adept --feedforward table1_full --output fastest')
@comparison_options('fastest.json, report.html and the fastest motion, fastest.yaml')
@click.option('--timing', default=tuple(TIMINGS), multiple=True, show_default=True,
              type=click.Choice(tuple(TIMINGS)),
              help='of the path: as MOTION has it, or time-optimal; may be given several times')
@click.option('--peak', default=1e3 * PEAK, show_default=True,
              type=POSITIVE, help='limit of the error of D, mm')
@click.option('--joint-acceleration', default=None,
              type=POSITIVE,
              help='limit of the joint accelerations asked for, rad/s2  [default: none]')
@click.option('--joint-jerk', default=None,
              type=POSITIVE,
              help='limit of the joint jerks asked for, rad/s3  [default: none]')
def fastest(**options: Any) -> None:
    """Find how fast a simulated machine can do MOTION (adept, circle, a motion.yaml)."""
    with loading():
        from par4_sim.jobs import fastest
    fastest.fastest(**options)


def main() -> None:
    """Run the executable."""
    run(fastest)


if __name__ == '__main__':
    main()
