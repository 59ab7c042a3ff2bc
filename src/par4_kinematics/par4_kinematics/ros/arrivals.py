"""What came on a topic that a node listens to: how much, what is missing, how long ago."""

from __future__ import annotations

import time

from par4_kinematics.ros.numbering import Numbering


class Arrivals:
    """What came on a topic.

    Attributes:
        stream: whether messages are to come all the time.
        received: how many messages came.
        numbering: of the messages.
    """

    def __init__(self, stream: bool) -> None:
        self.stream = stream
        self.received = 0
        self.numbering = Numbering()
        self._last: float | None = None

    def take(self, number: int) -> None:
        """Take the number of a message that came now."""
        self.received += 1
        self.numbering.take(number)
        self._last = time.monotonic()

    @property
    def age(self) -> float | None:
        """Seconds of wall time since the newest message, None before the first."""
        return None if self._last is None else time.monotonic() - self._last
