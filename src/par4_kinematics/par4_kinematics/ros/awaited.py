"""What a node still waits for, and what to do where nobody publishes it."""

from __future__ import annotations

from par4_kinematics.interface import CLOCK, JOINT_STATES, REFERENCE, Topic

AWAITED = 5.0
"""Seconds of wall time after which a node says what it still waits for."""
STARTS = {
    CLOCK.name: 'use_sim_time is for a simulation',
    JOINT_STATES.name: 'start the driver of the robot, or par4_simulation, with the same '
                       'ROS_DOMAIN_ID and namespace',
    REFERENCE.name: 'start par4_motion with the same ROS_DOMAIN_ID and namespace',
}
"""Topic -> what to do where nobody publishes it."""


def waited_for(topic: Topic, nobody: bool) -> str:
    """Return the name of a topic that does not come and, if nobody publishes it, what to do."""
    return topic.name + (f', which nobody publishes: {STARTS[topic.name]}' if nobody else '')
