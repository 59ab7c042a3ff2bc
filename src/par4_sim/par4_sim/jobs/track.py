"""par4_track: how well controllers and models make a machine follow a motion."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

from par4_kinematics.limits import limits_not_given
from par4_sim.jobs.comparison import read_asked
from par4_sim.report.results import origin, write_results
from par4_sim.report.terminal import print_table, say
from par4_sim.report.words import in_words
from par4_sim.tracking.case import Case, compared, model_name
from par4_sim.tracking.comparison import (
    BRIEF,
    cells_of,
    headings_of,
    outcome_of_tracking,
    tracking_json,
)


def track(band: float, **options: Any) -> None:
    """Compare how a simulated machine follows MOTION (adept, excitation, circle, motion.yaml)."""
    asked = read_asked(**options)
    robot, played = asked.robot, asked.motion
    plan = asked.plan(played, cycles=asked.cycles, band=1e-3 * band)
    with Console(stderr=True).status('simulating') as status:
        cases = compared(plan, asked.controllers, asked.models, status.update)
        status.update('drawing the report')
        # the plot library is slow to load, and some homes make it talk on stderr
        from par4_sim.tracking.report import report_of_tracking
        outcome = outcome_of_tracking(cases, played, model_name(options['machine']), robot,
                                      plan.band)
        provenance = origin('par4_track', robot, {**asked.options, 'band_mm': band})
        write_results(asked.output, {
            'tracking.json': tracking_json(cases, played, robot, plan.cycles, plan.band,
                                           provenance),
            'report.html': report_of_tracking(cases, outcome, robot, plan.band, provenance)})
    print_table(_table(cases))
    say(outcome.sentence)
    say(f'results and report: {asked.output}', *limits_not_given(robot), whole=True)


def _table(cases: list[Case]) -> Table:
    table = Table(box=None, header_style='', pad_edge=False)
    table.add_column('controller', no_wrap=True)
    table.add_column('feedforward', no_wrap=True)
    for heading in headings_of(BRIEF):
        table.add_column(heading, justify='right')
    for case in cases:
        table.add_row(in_words(case.controller), case.feedforward, *cells_of(case, BRIEF))
    return table
