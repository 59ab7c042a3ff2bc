"""Trajectories that wait for the physics, put together so that a stream costs what a chunk does."""

from __future__ import annotations

from queue import Empty, SimpleQueue

import numpy as np

from par4_kinematics.ros.convert import Trajectory

MOST = 1000
"""Trajectories taken at a time: a flood of them must not stop the clock."""
Batch = tuple[np.ndarray, list[np.ndarray]]
"""Times (n,), s, and arrays (n, 4)."""


class Inbox:
    """Trajectories from one thread for another, in the order in which they came.

    Args:
        fields: attributes of a Trajectory that the receiver wants.
    """

    def __init__(self, *fields: str) -> None:
        self._fields = fields
        self._waiting: SimpleQueue[tuple[int, Trajectory]] = SimpleQueue()

    def put(self, start_ns: int, trajectory: Trajectory) -> None:
        """Leave a trajectory that starts at `start_ns`."""
        self._waiting.put((start_ns, trajectory))

    def take(self, epoch_ns: int) -> list[list[Batch]]:
        """Return what waits, with times after `epoch_ns`: groups that go on in time."""
        groups: list[list[Batch]] = []
        end = np.inf
        for _ in range(MOST):
            try:
                start_ns, trajectory = self._waiting.get_nowait()
            except Empty:
                break
            times = trajectory.times(start_ns - epoch_ns)
            if times[0] <= end:
                groups.append([])
            groups[-1].append((times, [getattr(trajectory, field) for field in self._fields]))
            end = times[-1]
        return groups


def joined(group: list[Batch]) -> Batch:
    """Return the trajectories of a group as one."""
    if len(group) == 1:
        return group[0]
    return (np.concatenate([times for times, _ in group]),
            [np.concatenate(parts) for parts in zip(*(arrays for _, arrays in group),
                                                    strict=True)])
