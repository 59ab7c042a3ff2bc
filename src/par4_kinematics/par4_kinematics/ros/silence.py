"""Whether something has fallen silent while time went on."""

from __future__ import annotations

from par4_kinematics.stamps import SECOND

LONGEST_LOOK = 0.1
"""Most wall time, s, that one look may count: while this process stood, messages waited unread."""


class Silence:
    """Counts for how long nothing new has come, while the clock went.

    Neither clock alone can tell. The wall's goes on while a simulation is paused, and the
    simulation's own runs ahead of messages where it is fast.
    """

    def __init__(self) -> None:
        self._wall = 0.0
        self._looked: float | None = None
        self._since_ns: int | None = None
        self._newest_ns = 0

    def heard(self) -> None:
        """Note that something new has come."""
        self._wall, self._looked, self._since_ns = 0.0, None, None

    def look(self, wall: float, now_ns: int) -> float:
        """Return the silence, s: the lesser of what both clocks say; 0 at the first look.

        Args:
            wall: s, of a clock that never stands.
            now_ns: of the clock whose standing is no silence.
        """
        if self._looked is None or self._since_ns is None or now_ns < self._newest_ns:
            self._wall, self._since_ns = 0.0, now_ns
        elif now_ns > self._newest_ns:
            self._wall += min(wall - self._looked, LONGEST_LOOK)
        self._looked, self._newest_ns = wall, now_ns
        return min(self._wall, (now_ns - self._since_ns) / SECOND)
