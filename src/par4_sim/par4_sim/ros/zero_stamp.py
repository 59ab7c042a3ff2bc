"""When a trajectory with a stamp of zero starts: the same for a reference and its torque."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_kinematics.interface import FEEDFORWARD_TORQUE, START_DELAY, Topic
from par4_kinematics.ros.convert import Trajectory
from par4_kinematics.stamps import SECOND


@dataclass(frozen=True, eq=False)
class Waiting:
    """A trajectory whose counterpart has not arrived yet."""

    topic: Topic
    trajectory: Trajectory
    start_ns: int

    @property
    def until_ns(self) -> int:
        """How long it waits: a torque until it starts, for its reference comes before that."""
        if self.topic is FEEDFORWARD_TORQUE:
            return self.start_ns
        return self.start_ns + int(self.trajectory.from_start_ns[-1])

    def belongs_to(self, topic: Topic, trajectory: Trajectory) -> bool:
        """Return whether a trajectory on `topic` is the counterpart."""
        own, other = self.trajectory, trajectory
        return (self.topic is not topic
                and np.array_equal(own.from_start_ns, other.from_start_ns)
                and (own.q is None or other.q is None or np.array_equal(own.q, other.q)))


class ZeroStamps:
    """Starts of trajectories that left theirs to the receiver.

    The first of a reference and its feedforward torque to arrive starts START_DELAY later; the
    other has the same times from the start and the same positions, where a torque tells them, and
    is given the same one. Times alone would give a torque to a reference whose own was refused. A
    reference that comes after a torque has started is another one: the torque's own was lost, and
    in the middle of a motion none may begin.
    """

    def __init__(self) -> None:
        self._waiting: list[Waiting] = []

    def start_ns(self, topic: Topic, trajectory: Trajectory, now_ns: int) -> int:
        """Return the start of a trajectory received on `topic` at `now_ns`: its stamp, if any."""
        if trajectory.stamp_ns != 0:
            return trajectory.stamp_ns
        self._waiting = [one for one in self._waiting if one.until_ns >= now_ns]
        for place, one in enumerate(self._waiting):
            if one.belongs_to(topic, trajectory):
                del self._waiting[place]
                return one.start_ns
        start_ns = now_ns + round(START_DELAY * SECOND)
        self._waiting.append(Waiting(topic, trajectory, start_ns))
        return start_ns
