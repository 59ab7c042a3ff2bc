"""Whether joints stand while their references move, as after a trip of the drives."""

from __future__ import annotations

import numpy as np

STANDS = 0.01
"""How far a joint that stands may wander, rad."""
STANDING_NS = 500_000_000
"""How long a joint must have stood since its reference went: longer than any drive is late, and
than a robot that ends in order rests before it does."""


class Standing:
    """Looks at joints beside their references; it finds those that do not move as they should.

    A joint that follows moves in time, however late and far behind it is, so that a lag of the
    drives is not taken for a stand.
    """

    def __init__(self, q: np.ndarray, reference: np.ndarray, stamp_ns: int) -> None:
        """Begin with positions and references (n,), rad, of one time, ns."""
        self._q, self._reference = q.copy(), reference.copy()
        self._since_ns = np.full(len(q), stamp_ns, dtype=np.int64)
        self._asked = np.zeros(len(q), dtype=bool)

    def take(self, q: np.ndarray, reference: np.ndarray, stamp_ns: int) -> np.ndarray:
        """Return how far the reference of each joint has gone while the joint stood, (n,) rad.

        It is 0 for a joint that has not stood for `STANDING_NS` since its reference went.
        """
        moved = np.abs(q - self._q) > STANDS
        self._q[moved], self._reference[moved] = q[moved], reference[moved]
        self._asked[moved] = False
        gone = np.abs(reference - self._reference)
        self._asked |= gone > STANDS
        self._since_ns[~self._asked] = stamp_ns
        stood: np.ndarray = stamp_ns - self._since_ns >= STANDING_NS
        return np.where(stood, gone, 0.0)
