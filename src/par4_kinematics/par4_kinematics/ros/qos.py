"""Topics of the contract in a node: their message type and quality of service."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.qos import (
    DurabilityPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
from rclpy.subscription import Subscription

from par4_kinematics.errors import InputError
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


def on_topic(create: Callable[..., Any], topic: Topic, **options: Any) -> Any:
    """Return what `create` makes of a topic: a publisher or, with more options, a subscription.

    Raises:
        InputError: parameters `qos_overrides` of the node that are not understood.
    """
    try:
        return create(msg_type=message_type(topic), topic=topic.name, qos_profile=qos_of(topic),
                      qos_overriding_options=QoSOverridingOptions.with_default_policies(
                          callback=_without_negative_depth), **options)
    except (AssertionError, AttributeError, RuntimeError, TypeError, ParameterException,
            InvalidQosOverridesError):
        raise InputError(
            f'qos_overrides of {topic.name}: not understood; depth is a whole number from 0 to '
            f'2^31 - 1, history keep_last or keep_all, reliability reliable or best_effort'
        ) from None


def _without_negative_depth(profile: QoSProfile) -> SetParametersResult:
    """Refuse what rcl would refuse, too, but with lines of its own on the terminal."""
    return SetParametersResult(successful=profile.depth >= 0)


def unheard(node: Node, name: str, subscription: Subscription) -> tuple[str, str] | None:
    """Return that a publisher of a topic cannot be heard, and why; None if all can be.

    Args:
        node: that listens.
        name: of the topic, as the contract has it.
        subscription: to that topic.
    """
    for publisher in node.get_publishers_info_by_topic(subscription.topic_name):
        answer, reason = qos_check_compatible(publisher.qos_profile, subscription.qos_profile)
        if answer == QoSCompatibility.ERROR:
            return (f'{name} of {publisher.node_name} is not heard: its quality of service is not '
                    f'what this node takes',
                    f'{" ".join(reason.split())} Publish it reliable, as the contract has it')
    return None
