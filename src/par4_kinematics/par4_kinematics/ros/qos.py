"""Message type and quality of service of a topic of the contract."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from par4_kinematics.interface import CLOCK, Topic


def message_type(topic: Topic) -> Any:
    """Return the message class of a topic."""
    package, _, name = topic.type.split('/')
    return getattr(import_module(f'{package}.msg'), name)


def qos_of(topic: Topic) -> QoSProfile:
    """Return reliable, keep last `depth`, volatile or transient local; `/clock` as ROS has it."""
    if topic is CLOCK:
        return QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    durability = (DurabilityPolicy.TRANSIENT_LOCAL if topic.transient_local
                  else DurabilityPolicy.VOLATILE)
    return QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE,
                      durability=durability)
