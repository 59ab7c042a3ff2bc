"""Node of par4_identification."""

from __future__ import annotations

from par4_identification.ros.monitor_parameters import MonitorParameters
from par4_identification.ros.record_parameters import RecordParameters
from par4_kinematics.ros.start import start_node


def record() -> int:
    """Run the node par4_record; return its exit code."""
    return start_node('par4_identification.ros.record_node', RecordParameters)


def monitor() -> int:
    """Run the node par4_monitor; return its exit code."""
    return start_node('par4_identification.ros.monitor_node', MonitorParameters)
