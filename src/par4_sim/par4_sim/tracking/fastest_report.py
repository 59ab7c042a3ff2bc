"""The report of `par4_fastest`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_sim.report.drawing import drawn, image, legend
from par4_sim.report.outcome import Outcome
from par4_sim.report.page import rendered
from par4_sim.report.words import joint_labels
from par4_sim.tracking.fastest import Reached, Unreached
from par4_sim.tracking.fastest_outcome import HEADINGS, NAMES, rows_of_fastest
from par4_sim.tracking.plots import COLOURS
from par4_sim.tracking.time_optimal import Fastest

WAYS = 4
"""Ways between two rests that are drawn."""


def report_of_fastest(found: Sequence[Reached | Unreached], fastest: Fastest, outcome: Outcome,
                      motion: Motion, robot: Robot, provenance: Mapping[str, Any]) -> str:
    """Return the report.

    Args:
        found: of each controller with each model and timing.
        fastest: of the path.
        outcome: in words.
        motion: at its own pace.
        robot: that was moved.
        provenance: of the runs.
    """
    return rendered(
        'par4_sim.tracking', 'fastest.html', outcome,
        f'Fastest pace of {motion.name} on {robot.name}', 'What it rests on', provenance,
        names_of=NAMES, headings=HEADINGS, rows=rows_of_fastest(found, fastest),
        torque=torque_over_path(fastest, joint_labels(robot)))


def torque_over_path(fastest: Fastest, joints: Sequence[str]) -> str:
    """Return the torque of the time-optimal motion along its path, a picture a stretch."""
    profiles = fastest.profiles[:WAYS]
    with drawn(3.0) as figure:
        axes = figure.subplots(1, len(profiles), squeeze=False, sharey=True)[0]
        for row, (axis_of, profile) in enumerate(zip(axes, profiles, strict=True), start=1):
            for torque, colour in zip(profile.torque.T, COLOURS, strict=False):
                axis_of.plot(100.0 * profile.s[:-1], torque, color=colour)
            axis_of.set_title(f'way {row}, {profile.duration:.4f} s')
            axis_of.set_xlabel('share of the way, %')
        axes[0].set_ylabel('torque, N m')
        legend(figure, tuple(zip(joints, COLOURS, strict=False)))
        return image(figure)
