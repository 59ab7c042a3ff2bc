"""Publishes the samples of a simulation on the topics of the contract.

About 30 times a second `joint_states` also carries the passive joints, after the four of the arms
and in the same message: a message without the arms would break the contract, one with them and a
stamp of its own would be a second sample of the same time.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from rclpy.duration import Duration
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message

from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    BASE_FRAME,
    CLOCK,
    JOINT_STATES,
    ROBOT_DESCRIPTION,
    TRUE_POSE,
    TRUE_TORQUE,
    Topic,
)
from par4_kinematics.robot import JOINT_NAMES, Robot
from par4_kinematics.ros.convert import write_pose, write_time
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.qos import message_type
from par4_kinematics.workspace import home_pose
from par4_sim.bags.message_layout import JointStateTemplate
from par4_sim.closed_loop.simulation import Sample
from par4_sim.description.robot_tree import tree_joint_positions

CLOCK_PERIOD_NS = 10_000_000
PATIENCE = Duration(seconds=0.5)
"""Wall time for which the last samples of a topic are waited for: a listener may have been killed.
"""
PASSIVE_PERIOD_NS = 33_000_000
"""Of the passive joints; cell.launch.py lets robot_state_publisher take each message with them."""


class SamplePublisher:
    """The publishers of the simulation; messages are reused, publishing copies them.

    Joint states are written over in their serialised form: to turn a message object into bytes
    takes as long as to publish them.

    Attributes:
        published: messages sent so far, by topic.
    """

    def __init__(self, node: Par4Node, robot: Robot, description: str, publish_clock: bool
                 ) -> None:
        self.published: Counter[str] = Counter()
        self._geometry = robot.geometry
        self._clock_due_ns = 0
        self._passive_due_ns = 0
        self._tested: frozenset[Topic] = frozenset()
        # who only could publish a clock counts as one: others are warned of a second
        topics = (JOINT_STATES, AMPLIFIER_VOLTAGE, ROBOT_DESCRIPTION, TRUE_TORQUE, TRUE_POSE,
                  *((CLOCK,) if publish_clock else ()))
        self._publishers: dict[Topic, Publisher] = {
            topic: node.publisher_of(topic) for topic in topics}
        self._messages: dict[Topic, Any] = {
            topic: message_type(topic)() for topic in (ROBOT_DESCRIPTION, TRUE_POSE, CLOCK)}
        self._arms = _template(JOINT_NAMES, 3)
        self._effort_alone = _template(JOINT_NAMES, 1)
        self._with_passive = _template(
            list(tree_joint_positions(robot.geometry, home_pose(robot))), 3)
        self.describe(description)

    def describe(self, description: str) -> None:
        """Publish the URDF of the robot; whoever comes later gets it, too."""
        self._messages[ROBOT_DESCRIPTION].data = description
        self._send(ROBOT_DESCRIPTION, self._messages[ROBOT_DESCRIPTION])

    def close(self) -> None:
        """Wait until the last samples have reached all who listen, but not for long."""
        for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE):
            self._publishers[topic].wait_for_all_acked(PATIENCE)

    def _send(self, topic: Topic, message: Any) -> None:
        """Publish a message or the bytes of one."""
        self._publishers[topic].publish(message)
        self.published[topic.name] += 1

    def publish(self, now_ns: int, sample: Sample) -> None:
        """Publish a sample valid at `now_ns`; the clock at 100 Hz, the truth if someone listens."""
        self._send(JOINT_STATES, self._joint_state(now_ns, sample))
        self._send(AMPLIFIER_VOLTAGE,
                   self._effort_alone.filled(now_ns, ((), (), sample.voltage)))
        if now_ns >= self._clock_due_ns:
            self._clock_due_ns = now_ns + CLOCK_PERIOD_NS
            self._tested = frozenset(topic for topic in (TRUE_TORQUE, TRUE_POSE)
                                     if self._publishers[topic].get_subscription_count() > 0)
            if CLOCK in self._publishers:
                write_time(self._messages[CLOCK].clock, now_ns)
                self._send(CLOCK, self._messages[CLOCK])
        if TRUE_TORQUE in self._tested:
            self._send(TRUE_TORQUE,
                       self._effort_alone.filled(now_ns, ((), (), sample.true_torque)))
        if TRUE_POSE in self._tested:
            write_pose(self._messages[TRUE_POSE], now_ns, sample.true_pose,
                       self._geometry.rotation_amplification)
            self._send(TRUE_POSE, self._messages[TRUE_POSE])

    def _joint_state(self, now_ns: int, sample: Sample) -> bytes:
        """Return the joint state of a sample, with the passive joints when they are due."""
        if now_ns >= self._passive_due_ns:
            self._passive_due_ns = now_ns + PASSIVE_PERIOD_NS
            with contextlib.suppress(UnreachableError):  # a machine unlike its description
                return self._with_passive.filled(now_ns,
                                                 joints_with_passive(self._geometry, sample))
        return self._arms.filled(now_ns, (sample.q, sample.qd, sample.effort))


def _template(names: Sequence[str], arrays: int) -> JointStateTemplate:
    """Return a joint state in the base frame that tells the last so many of its arrays."""
    message = message_type(JOINT_STATES)()
    message.header.frame_id = BASE_FRAME
    message.name = list(names)
    for field in ('position', 'velocity', 'effort')[-arrays:]:
        setattr(message, field, [0.0] * len(names))
    return JointStateTemplate(serialize_message(message))


def joints_with_passive(geometry: Geometry, sample: Sample
                        ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, velocity, effort (J,) of a sample in the order of `tree_joint_positions`.

    The arms come first, as measured. The passive joints are those of the true pose; their velocity
    is not known (NaN) and nothing drives them.

    Raises:
        UnreachableError: a pose that the described robot cannot reach.
    """
    position = np.array(list(tree_joint_positions(geometry, sample.true_pose).values()))
    velocity, effort = np.full_like(position, np.nan), np.zeros_like(position)
    for values, measured in ((position, sample.q), (velocity, sample.qd), (effort, sample.effort)):
        values[:LEGS] = measured
    return position, velocity, effort
