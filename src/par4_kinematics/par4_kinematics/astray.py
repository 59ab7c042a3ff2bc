"""Whether joints are elsewhere than their references were of late, as where another moves them."""

from __future__ import annotations

import numpy as np

LAG_NS = 100_000_000
"""How late a drive may be: a joint is where its reference was at some time within so long."""
ASTRAY_NS = 500_000_000
"""For how long joints must have been astray without a pause."""


class Astray:
    """Looks at joints beside their references; it finds those that go another way.

    A lag of the drives is no way of their own: it is not told, however far behind the joint is.
    """

    def __init__(self, allowed: float) -> None:
        """Look at joints that may be so far astray, rad, for as long as they like."""
        self._allowed = allowed
        self._since_ns: int | None = None

    def take(self, q: np.ndarray, least: np.ndarray, most: np.ndarray, stamp_ns: int) -> np.ndarray:
        """Return how far each joint is astray, (n,) rad; 0 where that has not lasted long enough.

        Args:
            q: positions of the joints, (n,) rad.
            least, most: of their references within the last `LAG_NS`, (n,) rad.
            stamp_ns: time of all of these.
        """
        away = np.maximum(np.maximum(least - q, q - most), 0.0)
        if away.max() <= self._allowed:
            self._since_ns = None
        elif self._since_ns is None:
            self._since_ns = stamp_ns
        elif stamp_ns - self._since_ns >= ASTRAY_NS:
            return away
        return np.zeros(len(q))
