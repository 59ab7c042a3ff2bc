"""The report of the drive gains that static pushes tell."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from par4_identification.gains.known_payload import DriveGains
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.drive_gain import gains_rows
from par4_identification.reports.page import page_of
from par4_kinematics.robot import Robot
from par4_sim.report.outcome import Outcome


def report_of_gains(gains: DriveGains, outcome: Outcome, robot: Robot, logs: Sequence[Log],
                    provenance: dict[str, Any]) -> str:
    """Return the report of the drive gains that static pushes tell.

    Args:
        gains: as estimated.
        outcome: in words.
        robot: whose gains are nominal.
        logs: with the pushes.
        provenance: of the run.
    """
    return page_of('drive_gain.html', robot, logs, outcome, f'Drive gains of {robot.name}',
                   'What it rests on', provenance, rows=gains_rows(gains, robot))
