"""What is wrong with a robot, as the nodes that speak for it tell on `/diagnostics`."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.topic_endpoint_info import TopicEndpointInfo


class Troubles:
    """The errors and warnings that nodes tell of themselves now."""

    def __init__(self) -> None:
        self._told: dict[str, tuple[bytes, str]] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Take what nodes tell: it lasts until its node tells something else."""
        for status in message.status:
            if status.level in (DiagnosticStatus.WARN, DiagnosticStatus.ERROR):
                self._told[status.name] = status.level, status.message or 'ERROR'
            else:
                self._told.pop(status.name, None)

    def of(self, publishers: Iterable[TopicEndpointInfo], least: bytes = DiagnosticStatus.ERROR
           ) -> str:
        """Return what one of the publishers of a topic tells, at least as bad; empty if none does.
        """
        nodes = (f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
                 for publisher in publishers)
        told = (self._told.get(node, (DiagnosticStatus.OK, '')) for node in nodes)
        return next((message for level, message in told if level >= least), '')
