"""Lost messages by the numbers that publishers give them, for several publishers on one topic.

ROS tells the number of a message but not its publisher. A publisher numbers without holes and its
messages come in order; so a number goes on from the nearest one below it, and what was counted as
lost turns out to be another publisher's when the first missing number does come.
"""

from __future__ import annotations

REMEMBERED = 1000
"""Holes that another publisher may still turn out to go on in, the newest: it does so with its next
message."""


class Numbering:
    """The numbers received on one topic.

    Attributes:
        missing: how many messages were published but not received, between received ones.
    """

    def __init__(self) -> None:
        self.missing = 0
        self._ends: list[int] = []
        self._holes: dict[int, int] = {}

    def take(self, number: int) -> None:
        """Take the number of a received message."""
        if number - 1 in self._ends:
            self._ends[self._ends.index(number - 1)] = number
        elif number in self._holes:  # its publisher goes on here: another one is beyond the hole
            self.missing -= self._holes.pop(number)
            self._ends.append(number)
        else:
            below = max((end for end in self._ends if end < number), default=None)
            if below is None:
                self._ends.append(number)
                return
            self._ends[self._ends.index(below)] = number
            self._holes[below + 1] = number - below - 1
            if len(self._holes) > REMEMBERED:
                del self._holes[next(iter(self._holes))]
            self.missing += number - below - 1
