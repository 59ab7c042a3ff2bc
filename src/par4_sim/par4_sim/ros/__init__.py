"""Node of par4_sim."""

from __future__ import annotations

from par4_kinematics.ros.start import start_node
from par4_sim.ros.simulation_parameters import SimulationParameters


def simulation() -> int:
    """Run the node par4_simulation; return its exit code."""
    return start_node('par4_sim.ros.simulation_node', SimulationParameters)
