"""Whether joints stand while their references move, as after a trip of the drives."""

from __future__ import annotations

import numpy as np

STANDS = 0.01
"""How far a joint that stands may wander, rad."""
STANDING_NS = 200_000_000
"""How long a joint must have stood: far longer than any joint that follows, but late, turns."""


class Standing:
    """Looks at joints beside their references; it finds those that do not move as they should.

    A joint that follows, however late, moves while its reference does, so no lag of a drive is
    taken for a stand.
    """

    def __init__(self, q: np.ndarray, reference: np.ndarray, stamp_ns: int) -> None:
        """Begin with positions and references (n,), rad, of one time, ns."""
        self._q, self._reference = q.copy(), reference.copy()
        self._since_ns = np.full(len(q), stamp_ns, dtype=np.int64)

    def take(self, q: np.ndarray, reference: np.ndarray, stamp_ns: int) -> np.ndarray:
        """Return how far the reference of each joint has gone while the joint stood, (n,) rad.

        It is 0 for a joint that has not stood for `STANDING_NS`.
        """
        moved = np.abs(q - self._q) > STANDS
        self._q[moved], self._reference[moved] = q[moved], reference[moved]
        self._since_ns[moved] = stamp_ns
        gone: np.ndarray = np.where(stamp_ns - self._since_ns >= STANDING_NS,
                                    np.abs(reference - self._reference), 0.0)
        return gone
