"""Whether the clock that a node follows goes on, jumps back, or is that of two simulations."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable

from rclpy.clock import Clock, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.node import Node

from par4_kinematics.interface import CLOCK
from par4_kinematics.ros.diagnostics import ERROR, WARN, NodeState
from par4_kinematics.stamps import SECOND

TO_AND_FRO = 3.0
"""Seconds within which two jumps back of a clock are those of two clocks."""
JUMP_PERIOD = 10.0
"""Seconds of wall time at the least between lines that a clock jumped back: two clocks make it do
so all the time, and the state says that already."""


class ClockWatch:
    """Looks at the clock of a node."""

    def __init__(self, node: Node, wall_clock: Clock, jumped_back: Callable[[], None]) -> None:
        """Watch the clock of `node`; `jumped_back` is called when it has, which is told already."""
        self._node, self._wall_clock, self._jumped_back = node, wall_clock, jumped_back
        self._now_ns, self._moved = 0, math.inf
        self._jumped: deque[float] = deque(maxlen=2)
        self._jumps = node.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1),
                          on_clock_change=False), post_callback=self._on_jump)

    def _on_jump(self, jump: TimeJump) -> None:
        self._jumped.append(time.monotonic())
        back = -jump.delta.nanoseconds / SECOND
        self._node.get_logger().warning(
            f'the clock jumped back by {back:.3f} s: the simulation was started again, or two '
            f'publish {CLOCK.name}', throttle_duration_sec=JUMP_PERIOD,
            throttle_time_source_type=self._wall_clock)
        self._jumped_back()

    def look(self) -> None:
        """Note when the clock moved; before its first time it is waited for."""
        now_ns = self._node.get_clock().now().nanoseconds
        if now_ns in (0, self._now_ns):
            return
        self._now_ns, self._moved = now_ns, time.monotonic()

    @property
    def age(self) -> float:
        """Seconds of wall time since the clock moved, less than zero before its first time."""
        return time.monotonic() - self._moved

    def state(self, clocks: int) -> NodeState | None:
        """Return that so many publish the clock, and whether they do so now; None if it is one."""
        if clocks > 1 and self._jumps_to_and_fro():
            return NodeState(ERROR, f'{clocks} publish {CLOCK.name}: end all but one '
                                    f'simulation, or give each a ROS_DOMAIN_ID of its own')
        if clocks > 1:
            return NodeState(WARN, f'{clocks} publish {CLOCK.name}, one of which may have been '
                                   f'killed: it counts for some 20 s more')
        return None

    def _jumps_to_and_fro(self) -> bool:
        """Return whether the clock has just jumped back more than once, as two clocks do."""
        return (len(self._jumped) == self._jumped.maxlen
                and time.monotonic() - self._jumped[0] < TO_AND_FRO)
