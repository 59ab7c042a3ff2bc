"""Whether all who follow the reference are there, and how fast the clock goes meanwhile."""

from __future__ import annotations

from par4_kinematics.interface import REFERENCE
from par4_kinematics.stamps import SECOND

SETTLING = 0.5
"""Seconds of wall time for which the number of listeners must have stayed the same."""
DISCOVERY = 3.5
"""Seconds of wall time in which listeners are found: a lost packet is repeated after 3 s."""


class Listeners:
    """Those who follow the reference, as they come.

    Attributes:
        found_at: wall time, s, by which whoever is there has been found.
    """

    def __init__(self, wanted: int, wall: float) -> None:
        """Wait for so many at the least, from a wall time, s, on."""
        self.found_at = wall + DISCOVERY
        self._wanted, self._count = wanted, 0
        self._since, self._since_ns = 0.0, 0

    def missing(self, count: int, wall: float, now_ns: int) -> str:
        """Return what is waited for while so many listen, '' once enough do and no more come.

        Args:
            count: of those who listen.
            wall: wall time, s.
            now_ns: time of the clock that the node follows.
        """
        if count != self._count or count < self._wanted:
            self._count = count
            self._since, self._since_ns = wall, now_ns
        if wall >= max(self.found_at, self._since + SETTLING):
            return ''
        found = f', {count} of {self._wanted} are there' if count < self._wanted else ''
        return f'subscribers of {REFERENCE.name}{found}'

    def pace(self, wall: float, now_ns: int) -> float:
        """Return how many times as fast as the wall's the clock went since the last one came."""
        return (now_ns - self._since_ns) / (wall - self._since) / SECOND
