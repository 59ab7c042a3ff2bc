"""What came on the topics that a node listens to: how much, what is missing, how long ago."""

from __future__ import annotations

import time
from collections import deque
from typing import Any

from par4_kinematics.interface import DIAGNOSTICS
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.convert import is_foreign, time_ns
from par4_kinematics.ros.numbering import Numbering
from par4_kinematics.stamps import SECOND

SILENCE = 0.95
"""Seconds of wall time after which a stream that flowed, or the clock, counts as dead."""
FASTEST, STEP = 100.0, 0.05
"""rad/s and rad: what joints turn from one message to the next is less than the first makes of the
time between, and the second."""
JUMPS, WITHIN = 4, 1.0
"""So many jumps in so many s are those of positions that come from two places; a reset is one."""


class Places:
    """Whether JointStates tell of one place of the robot's joints, or jump between two."""

    def __init__(self) -> None:
        self._names: list[str] | None = None
        self._order: list[int] = []
        self._last: tuple[int, list[float]] | None = None
        self._jumped: deque[float] = deque(maxlen=JUMPS)

    def take(self, message: Any) -> None:
        """Take a JointState of the robot; positions that are not told are passed over."""
        if message.name != self._names:
            self._names = list(message.name)
            self._order = [self._names.index(name) if name in self._names else -1
                           for name in JOINT_NAMES] if self._names else [*range(len(JOINT_NAMES))]
        if len(message.position) <= max(self._order) or min(self._order) < 0:
            return
        stamp_ns, told = time_ns(message.header.stamp), message.position
        q = [told[place] for place in self._order]
        if self._last is not None:
            before_ns, before = self._last
            most = STEP + FASTEST * abs(stamp_ns - before_ns) / SECOND
            if any(abs(one - other) > most for one, other in zip(q, before)):
                self._jumped.append(time.monotonic())
        self._last = stamp_ns, q

    @property
    def are_two(self) -> bool:
        """Whether positions have jumped to and fro of late."""
        return (len(self._jumped) == JUMPS and self._jumped[-1] - self._jumped[0] < WITHIN
                and time.monotonic() - self._jumped[-1] < WITHIN)


class Arrivals:
    """What came on a topic.

    Attributes:
        stream: whether messages are to come all the time.
        received: how many messages came.
        numbering: of the messages.
        places: of the joints that JointStates tell of.
        others: the first joints of a JointState, while only such as tell of other joints than the
            robot's have come; else empty.
    """

    def __init__(self, stream: bool) -> None:
        self.stream = stream
        self.received = 0
        self.numbering = Numbering()
        self.places = Places()
        self.others = ''
        self._robot_heard = False
        self._last: float | None = None

    def take(self, number: int) -> None:
        """Take the number of a message that came now."""
        self.received += 1
        self.numbering.take(number)
        self._last = time.monotonic()

    def hear(self, message: Any) -> None:
        """Note whose joints a JointState tells of, until it is the robot's; then where they are."""
        foreign = is_foreign(message)
        if not foreign:
            self.places.take(message)
        if self._robot_heard:
            return
        self._robot_heard = not foreign
        self.others = '' if self._robot_heard else ', '.join(message.name[:len(JOINT_NAMES)])

    @property
    def age(self) -> float | None:
        """Seconds of wall time since the newest message, None before the first."""
        return None if self._last is None else time.monotonic() - self._last


class Inputs(dict[str, Arrivals]):
    """What came on each of the topics that a node takes, by its name."""

    @property
    def awaited(self) -> list[str]:
        """The streams of which nothing has come."""
        return [name for name, input_ in self.items() if input_.stream and input_.age is None]

    @property
    def dead(self) -> list[str]:
        """The streams that flowed and do not any more."""
        return [name for name, input_ in self.items()
                if input_.stream and input_.age is not None and input_.age > SILENCE]

    @property
    def mixed(self) -> str:
        """That the positions of the robot come from two places, '' if they do not."""
        return next((f'{name}: the positions jump to and fro, as of two robots or publishers; end '
                     f'all but one, or give each a namespace'
                     for name, input_ in self.items() if input_.places.are_two), '')

    @property
    def foreign(self) -> str:
        """That JointStates tell of other joints than the robot's, '' if they do not."""
        return next((f'{name} tell of {input_.others} only; the joints of the robot are '
                     f'{", ".join(JOINT_NAMES)}'
                     for name, input_ in self.items() if input_.others), '')

    @property
    def missed(self) -> int:
        """How many messages did not come.

        Of the diagnostics of others none counts as missed: all nodes number theirs on one topic, so
        that those of the second look like a hole in those of the first until its next one comes, a
        second later; and then what was missed is told again.
        """
        return sum(input_.numbering.missing for name, input_ in self.items()
                   if name != DIAGNOSTICS.name)

    @property
    def measures(self) -> dict[str, str]:
        """Of each topic the age of its newest message and how many came, for the diagnostics."""
        told = {}
        for name, input_ in self.items():
            told[f'{name}_age'] = 'none yet' if input_.age is None else f'{input_.age:.2f} s'
            told[f'{name}_received'] = str(input_.received)
        return told
