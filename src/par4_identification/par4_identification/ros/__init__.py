"""Node of par4_identification."""

from __future__ import annotations

import sys
from importlib import import_module

from par4_identification.ros.monitor_parameters import MonitorParameters
from par4_identification.ros.record_parameters import RecordParameters, asked_to_mend
from par4_kinematics.ros.start import start_node


def record() -> int:
    """Run the node par4_record, or what mends a bag; return its exit code."""
    if asked_to_mend(sys.argv[1:]):
        return import_module('par4_identification.ros.record_node').main()
    return start_node('par4_identification.ros.record_node', RecordParameters)


def monitor() -> int:
    """Run the node par4_monitor; return its exit code."""
    return start_node('par4_identification.ros.monitor_node', MonitorParameters)
