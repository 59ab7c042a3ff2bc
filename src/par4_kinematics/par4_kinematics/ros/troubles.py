"""What is wrong with a robot, as the nodes that speak for it tell on `/diagnostics`."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.topic_endpoint_info import TopicEndpointInfo

TROUBLE = 'trouble'
"""Value of a status that says what its node's state is, in a few words; empty where it is well.

The message of the status has more: what to do, and new counts of things that are no state.
"""


@dataclass(frozen=True)
class Trouble:
    """What a node tells of itself.

    Attributes:
        level: WARN or ERROR.
        text: what is wrong.
        endpoints: of the node's publishers of the topic when it told; empty where it had none.
    """

    level: bytes
    text: str
    endpoints: frozenset[bytes]


class Troubles:
    """The errors and warnings that nodes which publish a topic tell of themselves now."""

    def __init__(self) -> None:
        self._told: dict[str, Trouble] = {}

    def take(self, message: DiagnosticArray, publishers: Iterable[TopicEndpointInfo]) -> None:
        """Take what nodes tell: it lasts until its node tells something else, or starts anew."""
        endpoints = [(_node(publisher), bytes(publisher.endpoint_gid)) for publisher in publishers]
        for status in message.status:
            text = next((pair.value for pair in status.values if pair.key == TROUBLE),
                        status.message or 'ERROR')
            if text and status.level in (DiagnosticStatus.WARN, DiagnosticStatus.ERROR):
                self._told[status.name] = Trouble(
                    status.level, text,
                    frozenset(gid for node, gid in endpoints if node == status.name))
            else:
                self._told.pop(status.name, None)

    def of(self, publishers: Iterable[TopicEndpointInfo], least: bytes = DiagnosticStatus.ERROR
           ) -> str:
        """Return what one of the publishers of a topic tells, at least as bad; empty if none does.

        What a node told that has been started anew since, so that it publishes from another
        endpoint, is over.
        """
        for publisher in publishers:
            told = self._told.get(_node(publisher))
            if told is not None and told.level >= least and (
                    not told.endpoints or bytes(publisher.endpoint_gid) in told.endpoints):
                return told.text
        return ''


def _node(publisher: TopicEndpointInfo) -> str:
    return f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
