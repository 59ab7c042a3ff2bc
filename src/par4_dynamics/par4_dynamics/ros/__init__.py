"""Node of par4_dynamics."""

from __future__ import annotations

from par4_dynamics.ros.feedforward_parameters import FeedforwardParameters
from par4_kinematics.ros.start import start_node


def feedforward() -> int:
    """Run the node par4_feedforward; return its exit code."""
    return start_node('par4_dynamics.ros.feedforward_node', FeedforwardParameters)
