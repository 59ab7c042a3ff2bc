"""The page of a report about a machine: its names, its bags, its cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from par4_identification.logs.log import Log
from par4_identification.reports.names import Names
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.page import rendered
from par4_sim.report.words import in_words, joint_labels, number, torque_name, typeset


def page_of(template: str, machine: Robot | Axis, logs: Sequence[Log], outcome: Outcome,
            title: str, insights_title: str, provenance: dict[str, Any],
            facts_title: str = 'Where this comes from', **content: Any) -> str:
    """Return the page of a report.

    Args:
        template: file in `templates/`.
        machine: that was measured.
        logs: that were read, a row each.
        outcome: the first screen.
        title: of the page.
        insights_title: of the findings.
        provenance: told at the end, under `facts_title`.
        content: what the template asks for.
    """
    return rendered(
        'par4_identification.reports', template, outcome, title, insights_title, provenance,
        facts_title, names=picture_names(machine), bags=[_bag_cells(log) for log in logs],
        **content)


def joint_cells(values: np.ndarray, total: float, text: Callable[[float], str]) -> list[str]:
    """Return a cell a joint and, of several joints, one for all of them."""
    return [text(float(value)) for value in values] + ([text(total)] if len(values) > 1 else [])


def picture_names(machine: Robot | Axis) -> Names:
    """Return what axes of pictures of a machine are labelled with."""
    return Names(joint_labels(machine), torque_name(machine),
                 typeset(unit_on(machine, 'N m')), typeset(unit_on(machine, 'rad/s')))


def _bag_cells(log: Log) -> dict[str, Any]:
    accounts = log.bag_accounts
    return {'name': Path(log.name).name, 'duration': number(accounts.duration),
            'samples': accounts.samples, 'rate': number(1.0 / accounts.period, 4),
            'segments': accounts.segments, 'source': in_words(accounts.torque_source),
            'findings': accounts.findings()}
