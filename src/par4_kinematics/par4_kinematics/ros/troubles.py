"""What is wrong with a robot, as the nodes that speak for it tell on `/diagnostics`."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.topic_endpoint_info import TopicEndpointInfo


class Troubles:
    """The errors that nodes tell of themselves now."""

    def __init__(self) -> None:
        self._told: dict[str, str] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Take what nodes tell: an error lasts until its node tells something else."""
        for status in message.status:
            if status.level == DiagnosticStatus.ERROR:
                self._told[status.name] = status.message or 'ERROR'
            else:
                self._told.pop(status.name, None)

    def of(self, publishers: Iterable[TopicEndpointInfo]) -> str:
        """Return the error that one of the publishers of a topic has; empty where none has one."""
        nodes = (f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
                 for publisher in publishers)
        return next((self._told[node] for node in nodes if node in self._told), '')
