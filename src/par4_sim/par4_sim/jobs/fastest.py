"""par4_fastest: the shortest time of a path within torque and a peak error."""

from __future__ import annotations

import math
from typing import Any

from rich.console import Console
from rich.table import Table

from par4_kinematics.limits import limits_not_given
from par4_kinematics.motion_file import free_motion_path, write_motion
from par4_sim.choices import OWN, STEP, TIME_OPTIMAL
from par4_sim.jobs.comparison import read_asked
from par4_sim.report.results import Results, origin, results_into
from par4_sim.report.terminal import print_table, say
from par4_sim.tracking.case import pairs_of
from par4_sim.tracking.fastest import fastest_cases

TOOL = 'par4_fastest'


def fastest(timing: tuple[str, ...], peak: float, joint_acceleration: float | None,
            joint_jerk: float | None, **options: Any) -> None:
    """Find how fast a simulated machine can do MOTION (adept, circle, a motion.yaml)."""
    asked = read_asked(**options)
    robot, played = asked.robot, asked.motion
    pairs = pairs_of(robot, asked.controllers, asked.models)
    with Console(stderr=True).status('looking for the bound') as status:
        from par4_sim.tracking.fastest_outcome import (
            HEADINGS,
            NAMES,
            best_of,
            fastest_json,
            outcome_of_fastest,
            rows_of_fastest,
        )
        from par4_sim.tracking.fastest_report import report_of_fastest
        from par4_sim.tracking.time_optimal import (  # toppra is slow to load
            PathLimits,
            fastest_along,
            motion_of,
        )
        limits = PathLimits(asked.machine.limit_of_drives(robot),
                            joint_acceleration or math.inf, joint_jerk or math.inf)
        bound = fastest_along(robot, asked.machine, played, limits)
        motions = {OWN: played, TIME_OPTIMAL: motion_of(
            bound, robot, f'{played.name}, time-optimal', STEP)}
        plans = {name: asked.plan(motions[name]) for name in timing}
        found = fastest_cases(plans, pairs, bound.bound, 1e-3 * peak, limits.acceleration,
                              limits.jerk, status.update)
        status.update('drawing the report')
        outcome = outcome_of_fastest(found, bound, played, robot, limits, 1e-3 * peak)
        provenance = origin(TOOL, robot, {
            **asked.options, 'timing': list(timing), 'peak_mm': peak,
            'joint_acceleration': joint_acceleration, 'joint_jerk': joint_jerk})
        results: Results = {
            'fastest.json': fastest_json(found, bound, played, robot, limits, 1e-3 * peak,
                                         provenance),
            'report.html': report_of_fastest(found, bound, outcome, played, robot, provenance)}
        best = best_of(found)
        with results_into(asked.output) as write:
            write(results)
            place = free_motion_path(asked.output / 'fastest.yaml', TOOL)
            if best is not None:
                write_motion(place, best.case.run.motion, maker=TOOL)
            elif place.exists():  # the fastest motion of an earlier run is none of this one
                place.unlink()
                place.with_suffix('.csv').unlink()
    table = Table(box=None, header_style='', pad_edge=False)
    for name in NAMES:
        table.add_column(name, no_wrap=True)
    for heading in HEADINGS:
        table.add_column(heading, justify='right', min_width=7)
    for names, cells in rows_of_fastest(found, bound):
        table.add_row(*names, *cells)
    print_table(table)
    say(outcome.sentence)
    say(f'results and report: {asked.output}',
        *([f'fastest motion: {place}'] if best is not None else []), *limits_not_given(robot),
        whole=True)
