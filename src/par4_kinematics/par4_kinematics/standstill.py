"""Whether joints have come to rest, by the positions that they tell."""

from __future__ import annotations

import numpy as np

STEADY = 1e-3
"""How far a joint that rests may wander, rad."""
SETTLED_NS = 50_000_000
"""How long joints must not have wandered farther to count as at rest."""


class Standstill:
    """Looks at joint positions until they rest: slower than 0.02 rad/s for 50 ms.

    Attributes:
        since_ns: stamp from which on no joint has wandered farther than `STEADY`; None before the
            first position.
    """

    def __init__(self) -> None:
        self.since_ns: int | None = None
        self._newest_ns = 0
        self._q = np.empty(0)

    def take(self, stamp_ns: int, q: np.ndarray) -> None:
        """Take positions q (n,), rad, that were valid at `stamp_ns`."""
        if self.since_ns is None or np.abs(q - self._q).max() > STEADY:
            self.since_ns, self._q = stamp_ns, q
        self._newest_ns = stamp_ns

    def reached(self, after_ns: int) -> bool:
        """Return whether the joints rest now, and it is later than `after_ns`."""
        return (self.since_ns is not None and self._newest_ns >= after_ns
                and self._newest_ns - self.since_ns >= SETTLED_NS)
