"""How a node tells its state and what it counts: on `/diagnostics` and, what is new, in its log."""

from __future__ import annotations

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from par4_kinematics.interface import COUNTS
from par4_kinematics.ros.convert import write_time
from par4_kinematics.ros.troubles import TROUBLE

OK: bytes = DiagnosticStatus.OK
WARN: bytes = DiagnosticStatus.WARN
ERROR: bytes = DiagnosticStatus.ERROR


@dataclass(frozen=True)
class NodeState:
    """What a node does now, in words, and how bad that is.

    Attributes:
        level: OK, WARN or ERROR.
        text: what it does; a change of it is logged.
        detail: what may change all the time.
    """

    level: bytes
    text: str
    detail: str = ''

    @property
    def said(self) -> str:
        """Text and detail."""
        return f'{self.text}: {self.detail}' if self.detail else self.text


class Diagnostics:
    """Tells of a node, and remembers what it has told."""

    def __init__(self, node: Node, publisher: Publisher) -> None:
        """Tell of `node` by a publisher of `/diagnostics`."""
        self._node, self._publisher = node, publisher
        self._reported: dict[str, int] = {}
        self._explained: set[str] = set()
        self._last_state = NodeState(OK, 'running')

    def new(self, faults: dict[str, int], expected: tuple[str, ...]) -> dict[str, int]:
        """Return the faults since the last call, by name, and log those that are not expected."""
        new = {name: count - self._reported.get(name, 0) for name, count in faults.items()
               if count > self._reported.get(name, 0)}
        self._reported = faults
        unsaid = {name: count for name, count in new.items() if name not in expected}
        if unsaid:
            self._node.get_logger().warning(', '.join(
                f'{count} {name}' + ('' if name in self._explained else f' ({COUNTS[name]})')
                for name, count in unsaid.items()))
            self._explained |= unsaid.keys()
        return new

    def log(self, state: NodeState) -> None:
        """Log a state that is another than the last one."""
        if (state.level, state.text) == (self._last_state.level, self._last_state.text):
            return
        good = state.level == self._last_state.level == OK
        self._last_state = state
        if state.level == OK:  # rclpy wants one severity a line
            if not good:
                self._node.get_logger().info(state.said)
        elif state.level == WARN:
            self._node.get_logger().warning(state.said)
        else:
            self._node.get_logger().error(state.said)

    def publish(self, stamp_ns: int, state: NodeState, new: dict[str, int], worrying: bool,
                values: dict[str, int | str]) -> None:
        """Publish a state, faults that are `new` and whether these are `worrying`, and values."""
        news = ', '.join(f'{count} {name}' for name, count in new.items())
        message = DiagnosticArray()
        write_time(message.header.stamp, stamp_ns)
        message.status = [DiagnosticStatus(
            level=max(state.level, WARN if worrying else OK),
            name=self._node.get_fully_qualified_name(),
            message=f'{state.said}; {news}' if news else state.said,
            values=[KeyValue(key=name, value=str(value)) for name, value in
                    {TROUBLE: '' if state.level == OK else state.text, **self._reported,
                     **values}.items()])]
        self._publisher.publish(message)

    def wait_until_heard(self, seconds: float) -> None:
        """Wait until all who hear the diagnostics have the last one, so long at the most."""
        self._publisher.wait_for_all_acked(Duration(seconds=seconds))
