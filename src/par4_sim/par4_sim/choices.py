"""What the options of commands and nodes offer, by name, and their defaults.

It stands apart from what does the work, so that `--help` loads nothing but this.
"""

from __future__ import annotations

from pathlib import Path

FIDELITIES: tuple[str, ...] = ('accurate', 'fast', 'exact')
"""Simulated machines: `plant.py` says what they have in common."""
STEP = 0.25e-3
"""Default physics step of a simulation, s; drives run at the same rate."""
STORAGES = ('mcap', 'sqlite3')
"""Formats of bags."""
REPAIR = '--repair'
"""Option by which `par4_record` mends a bag instead of recording one."""
LAWS = ('loops', 'computed_torque', 'predictive', 'torque')
"""Laws of the drives."""
POSITION_LAWS = LAWS[:3]
"""Laws that follow a reference of positions."""
TORQUE_LAW = LAWS[3]
"""Law for which feedforward torque is the command."""
PREDICTIVE = LAWS[2]
LOOKED_AHEAD = 4.0
"""How many times the limit of the drives a feedforward torque may be for a predictive law."""
LEARNING = 'learning'
CONTROLLERS = (*LAWS, LEARNING)
"""What `par4_track` compares: the laws, and the loops with feedforward that learns."""
NO_FEEDFORWARD = 'none'
PERIOD = 1e-3
"""Seconds between the points of the reference of a named motion."""
BAND = 0.5e-3
"""Half width of the limit band, m."""
CYCLES = 10
"""How often a learning controller does the motion."""
OWN, TIME_OPTIMAL = 'own', 'time_optimal'
TIMINGS = {OWN: 'own timing', TIME_OPTIMAL: 'time-optimal'}
"""How a path is timed, in words: as the motion that was given, or as time-optimal motion."""
PEAK = 0.5e-3
"""Limit of the peak error of D, m."""


def repair_command(bag: str | Path) -> str:
    """Return the command that mends a bag, as errors tell it."""
    return f'par4_record {REPAIR} {bag}'
