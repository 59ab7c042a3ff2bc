"""What came on a topic that a node listens to: how much, what is missing, how long ago."""

from __future__ import annotations

import time
from typing import Any

from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.convert import is_foreign
from par4_kinematics.ros.numbering import Numbering


class Arrivals:
    """What came on a topic.

    Attributes:
        stream: whether messages are to come all the time.
        received: how many messages came.
        numbering: of the messages.
        others: the first joints of a JointState, while only such as tell of other joints than the
            robot's have come; else empty.
    """

    def __init__(self, stream: bool) -> None:
        self.stream = stream
        self.received = 0
        self.numbering = Numbering()
        self.others = ''
        self._robot_heard = False
        self._last: float | None = None

    def take(self, number: int) -> None:
        """Take the number of a message that came now."""
        self.received += 1
        self.numbering.take(number)
        self._last = time.monotonic()

    def hear(self, message: Any) -> None:
        """Note whose joints a JointState tells of, until it is the robot's."""
        if self._robot_heard:
            return
        self._robot_heard = not is_foreign(message)
        self.others = '' if self._robot_heard else ', '.join(message.name[:len(JOINT_NAMES)])

    @property
    def age(self) -> float | None:
        """Seconds of wall time since the newest message, None before the first."""
        return None if self._last is None else time.monotonic() - self._last
