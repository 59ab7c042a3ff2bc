"""When a trajectory with a stamp of zero starts: the same for a reference and its torque."""

from __future__ import annotations

from collections import deque

import numpy as np

from par4_kinematics.interface import START_DELAY, Topic
from par4_kinematics.ros.convert import SECOND, Trajectory


class ZeroStamps:
    """Starts of trajectories that left theirs to the receiver.

    The first of a reference and its feedforward torque to arrive starts START_DELAY later; the
    other has the same times from the start and is given the same one.
    """

    def __init__(self) -> None:
        self._open: deque[tuple[str, np.ndarray, int]] = deque()

    def start_ns(self, topic: Topic, trajectory: Trajectory, now_ns: int) -> int:
        """Return the start of a trajectory received on `topic` at `now_ns`: its stamp, if any."""
        if trajectory.stamp_ns != 0:
            return trajectory.stamp_ns
        while self._open and self._open[0][2] + int(self._open[0][1][-1]) < now_ns:
            self._open.popleft()
        for entry in self._open:
            arrived, from_start_ns, start_ns = entry
            if arrived != topic.name and np.array_equal(from_start_ns, trajectory.from_start_ns):
                self._open.remove(entry)
                return start_ns
        start_ns = now_ns + round(START_DELAY * SECOND)
        self._open.append((topic.name, trajectory.from_start_ns, start_ns))
        return start_ns
