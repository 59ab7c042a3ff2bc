"""Nodes of par4_kinematics and what the nodes of all packages share."""

from __future__ import annotations

from par4_kinematics.ros.kinematics_parameters import KinematicsParameters
from par4_kinematics.ros.motion_parameters import MotionParameters
from par4_kinematics.ros.start import start_node


def kinematics() -> int:
    """Run the node par4_kinematics; return its exit code."""
    return start_node('par4_kinematics.ros.kinematics_node', KinematicsParameters)


def motion() -> int:
    """Run the node par4_motion; return its exit code."""
    return start_node('par4_kinematics.ros.motion_node', MotionParameters)
