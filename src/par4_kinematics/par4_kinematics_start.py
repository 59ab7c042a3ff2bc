"""Executables of par4_kinematics; the package itself is loaded once a signal is quiet."""

from par4_start import node_starts


def kinematics() -> int:
    """Run the node par4_kinematics; return its exit code."""
    node_starts()
    from par4_kinematics.ros import kinematics
    return kinematics()


def motion() -> int:
    """Run the node par4_motion; return its exit code."""
    node_starts()
    from par4_kinematics.ros import motion
    return motion()
