"""A motion that is being sent as a reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_kinematics.motion import Motion
from par4_kinematics.ros.convert import Trajectory
from par4_kinematics.stamps import SECOND

CHUNK_NS = SECOND // 4
"""Length of one message."""


@dataclass
class Played:
    """A motion that is being sent.

    Attributes:
        motion: with the approach from where the robot stood.
        start_ns: time of its first sample, ns.
        times_ns: of the points, (n,) ns; those of a way to rest once it brakes.
        points: q, qd, qdd of the points, (n, 4) each.
        sent: how many of the points have been sent.
    """

    motion: Motion
    start_ns: int
    times_ns: np.ndarray
    points: tuple[np.ndarray, ...]
    sent: int = 0

    def asked(self, at_ns: int) -> tuple[int, tuple[np.ndarray, ...]]:
        """Return the time since the start, ns, of a time, ns, and q, qd, qdd there, (4,) each.

        Before the first point and after the last these are that point's.
        """
        at_ns = int(np.clip(at_ns, self.times_ns[0], self.times_ns[-1]))
        after = int(np.searchsorted(self.times_ns, at_ns))
        before = max(0, after - 1)
        span_ns = int(self.times_ns[after] - self.times_ns[before])
        share = (at_ns - int(self.times_ns[before])) / span_ns if span_ns else 0.0
        return at_ns - self.start_ns, tuple(
            part[before] + share * (part[after] - part[before]) for part in self.points)

    def asked_since(self, at_ns: int, span_ns: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and the largest q within a span of time, ns, up to a time, (4,) each."""
        first, last = np.searchsorted(self.times_ns, (at_ns - span_ns, at_ns))
        q = self.points[0][max(0, first - 1):last + 1]
        return q.min(axis=0), q.max(axis=0)

    def next_chunk(self) -> Trajectory:
        """Return the next points to send and count them as sent."""
        first, times_ns = self.sent, self.times_ns
        self.sent = int(np.searchsorted(times_ns, times_ns[first] + CHUNK_NS))
        part = slice(first, self.sent)
        return Trajectory(int(times_ns[0]), times_ns[part] - times_ns[0],
                          *(values[part] for values in self.points))
