"""The report of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from par4_kinematics.robot import Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.page import rendered
from par4_sim.report.words import joint_labels, number
from par4_sim.tracking.case import Case
from par4_sim.tracking.comparison import FIELDS, MILLI, cells_of, headings_of
from par4_sim.tracking.plots import desired_and_obtained, errors_by_cycle, torques


def report_of_tracking(cases: Sequence[Case], outcome: Outcome, robot: Robot, band: float,
                       provenance: Mapping[str, Any]) -> str:
    """Return the report of a comparison.

    Args:
        cases: at least one, all of one motion.
        outcome: in words.
        robot: that was moved.
        band: half width of the limit band, m.
        provenance: of the runs.
    """
    motion = cases[0].run.motion
    return rendered(
        'par4_sim.tracking', 'tracking.html', outcome,
        f'Tracking of {motion.name} on {robot.name}', 'What it rests on', provenance,
        motion=motion.name, position=desired_and_obtained(cases),
        learning=errors_by_cycle(cases) if any(case.learned for case in cases) else '',
        torque=torques(cases, joint_labels(robot)),
        headings=headings_of(FIELDS),
        rows=[(case.label, cells_of(case, FIELDS)) for case in cases],
        band=f'{number(MILLI * band)} mm')
