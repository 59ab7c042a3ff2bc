"""Publishes the samples of a simulation on the topics of the contract."""

from __future__ import annotations

from collections import Counter
from typing import Any

from rclpy.publisher import Publisher

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
from par4_kinematics.ros.convert import write_joint_state, write_pose, write_time
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.qos import message_type
from par4_sim.simulation import Sample
from par4_sim.urdf import robot_description

CLOCK_PERIOD_NS = 10_000_000


class SamplePublisher:
    """The publishers of the simulation; messages are reused, publishing copies them.

    Attributes:
        published: messages sent so far, by topic.
    """

    def __init__(self, node: Par4Node, robot: Robot, publish_clock: bool) -> None:
        self.published: Counter[str] = Counter()
        self._amplification = robot.geometry.rotation_amplification
        self._publish_clock = publish_clock
        self._clock_due_ns = 0
        self._tested: frozenset[Topic] = frozenset()
        topics = (JOINT_STATES, AMPLIFIER_VOLTAGE, ROBOT_DESCRIPTION, TRUE_TORQUE, TRUE_POSE, CLOCK)
        self._publishers: dict[Topic, Publisher] = {
            topic: node.publisher_of(topic) for topic in topics}
        self._messages: dict[Topic, Any] = {topic: message_type(topic)() for topic in topics}
        for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE, TRUE_TORQUE):
            self._messages[topic].name = list(JOINT_NAMES)
            self._messages[topic].header.frame_id = BASE_FRAME
        self._messages[ROBOT_DESCRIPTION].data = robot_description(robot)
        self._send(ROBOT_DESCRIPTION)

    def _send(self, topic: Topic) -> None:
        self._publishers[topic].publish(self._messages[topic])
        self.published[topic.name] += 1

    def publish(self, now_ns: int, sample: Sample) -> None:
        """Publish a sample valid at `now_ns`; the clock at 100 Hz, the truth if someone listens."""
        write_joint_state(self._messages[JOINT_STATES], now_ns, sample.q, sample.qd, sample.effort)
        self._send(JOINT_STATES)
        write_joint_state(self._messages[AMPLIFIER_VOLTAGE], now_ns, effort=sample.voltage)
        self._send(AMPLIFIER_VOLTAGE)
        if now_ns >= self._clock_due_ns:
            self._clock_due_ns = now_ns + CLOCK_PERIOD_NS
            self._tested = frozenset(topic for topic in (TRUE_TORQUE, TRUE_POSE)
                                     if self._publishers[topic].get_subscription_count() > 0)
            if self._publish_clock:
                write_time(self._messages[CLOCK].clock, now_ns)
                self._send(CLOCK)
        if TRUE_TORQUE in self._tested:
            write_joint_state(self._messages[TRUE_TORQUE], now_ns, effort=sample.true_torque)
            self._send(TRUE_TORQUE)
        if TRUE_POSE in self._tested:
            write_pose(self._messages[TRUE_POSE], now_ns, sample.true_pose, self._amplification)
            self._send(TRUE_POSE)
