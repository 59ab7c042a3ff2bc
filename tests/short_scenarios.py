"""Scenarios of the blind study with shorter motions: the same is asked of less data and time."""

from __future__ import annotations

from dataclasses import replace

from hidden.motions import draw_motion
from hidden.scenario import Scenario, Task, draw_scenario

FIT = 10.0
"""s of motion to fit."""
HELD_OUT = {'slow then fast': 9.0}
"""s of motion held out, by shape: two excitations take 4 s each, at the least."""
SHORTEST = 6.5
"""s of motion held out of all other shapes."""


def short_scenario(task: Task) -> Scenario:
    """Return the scenario that a task draws, with motions of its shape that are shorter."""
    scenario = draw_scenario(task)
    durations = FIT, HELD_OUT.get(scenario.shape, SHORTEST)
    return replace(scenario, motions=tuple(
        draw_motion(scenario.shape, scenario.known.robot, duration, task.seed + 1000 * more)
        for more, duration in enumerate(durations)))
