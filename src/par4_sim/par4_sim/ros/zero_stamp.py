"""When a trajectory with a stamp of zero starts: the same for a reference and its torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_kinematics.interface import START_DELAY, Topic
from par4_kinematics.ros.convert import Trajectory
from par4_kinematics.stamps import SECOND


@dataclass(frozen=True, eq=False)
class Waiting:
    """A trajectory whose counterpart has not arrived yet."""

    topic: str
    from_start_ns: np.ndarray
    start_ns: int

    @property
    def end_ns(self) -> int:
        return self.start_ns + int(self.from_start_ns[-1])


class ZeroStamps:
    """Starts of trajectories that left theirs to the receiver.

    The first of a reference and its feedforward torque to arrive starts START_DELAY later; the
    other has the same times from the start and is given the same one.
    """

    def __init__(self) -> None:
        self._waiting: list[Waiting] = []

    def start_ns(self, topic: Topic, trajectory: Trajectory, now_ns: int) -> int:
        """Return the start of a trajectory received on `topic` at `now_ns`: its stamp, if any."""
        if trajectory.stamp_ns != 0:
            return trajectory.stamp_ns
        self._waiting = [one for one in self._waiting if one.end_ns >= now_ns]
        for place, one in enumerate(self._waiting):
            if one.topic != topic.name and np.array_equal(one.from_start_ns,
                                                          trajectory.from_start_ns):
                del self._waiting[place]
                return one.start_ns
        start_ns = now_ns + round(START_DELAY * SECOND)
        self._waiting.append(Waiting(topic.name, trajectory.from_start_ns, start_ns))
        return start_ns
