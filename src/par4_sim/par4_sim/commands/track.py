"""par4_track: how well controllers and models make a machine follow a motion."""

from __future__ import annotations

from typing import Any

import click

from par4_sim.choices import BAND
from par4_sim.commands.comparison_options import comparison_options
from par4_sim.commands.entry import loading, run
from par4_sim.commands.numbers import POSITIVE


@click.command('par4_track', epilog='\b\nExample:\n'
    '  par4_track adept --controller loops --feedforward table1 \\\n'
    '      --output tracked')
@comparison_options('tracking.json and report.html')
@click.option('--band', default=1e3 * BAND, show_default=True,
              type=POSITIVE,
              help='half width of the limit band of overshoot and settling time, mm')
def track(**options: Any) -> None:
    """Compare how a simulated machine follows MOTION (adept, excitation, circle, motion.yaml)."""
    with loading():
        from par4_sim.jobs import track
    track.track(**options)


def main() -> None:
    """Run the executable."""
    run(track)


if __name__ == '__main__':
    main()
