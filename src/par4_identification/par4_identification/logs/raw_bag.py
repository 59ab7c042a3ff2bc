"""What a bag holds, as columns of numpy arrays in the order of the bag; nothing is judged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class NamedColumns:
    """Rows whose columns carry joint names that may change from row to row.

    Attributes:
        topic: name with its namespace.
        received: bag time of each row, (n,) ns.
        stamp: of the header, (n,) ns, 0 = not set.
        layouts: every list of joint names that occurs.
        layout: which of them a row follows, (n,).
    """

    topic: str
    received: np.ndarray
    stamp: np.ndarray
    layouts: tuple[tuple[str, ...], ...]
    layout: np.ndarray

    def select(self, values: np.ndarray, joints: Sequence[str]) -> np.ndarray:
        """Return the columns of `values` of these joints (n, J); NaN where a row lacks one."""
        if self.layouts == (tuple(joints),):
            return values
        selected = np.full((len(self.layout), len(joints)), np.nan)
        for index, names in enumerate(self.layouts):
            rows = self.layout == index
            for column, joint in enumerate(joints):
                if joint in names:
                    selected[rows, column] = values[rows, names.index(joint)]
        return selected

    def names_count(self, joints: Sequence[str]) -> np.ndarray:
        """Return how many of these joints each row names, (n,)."""
        counts = np.array([len(set(joints) & set(names)) for names in self.layouts], dtype=int)
        return counts[self.layout]

    def names_twice(self, joints: Sequence[str]) -> np.ndarray:
        """Return whether each row names one of these joints more than once, (n,)."""
        twice = np.array([any(names.count(joint) > 1 for joint in joints)
                          for names in self.layouts], dtype=bool)
        return twice[self.layout]


@dataclass(frozen=True)
class JointSamples(NamedColumns):
    """The JointState messages of one topic, in the order of the bag.

    Attributes:
        position, velocity, effort: (n, widest layout); NaN where a message carries no value.
    """

    position: np.ndarray
    velocity: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True)
class TrajectoryPoints(NamedColumns):
    """The points of all JointTrajectory messages of one topic, in the order of the bag.

    Attributes:
        message: index of the message that a point came with, (n,).
        time_from_start: (n,) ns; absolute time = stamp + time_from_start.
        position, velocity, acceleration, effort: (n, widest layout); NaN where empty.
    """

    message: np.ndarray
    time_from_start: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray


@dataclass(frozen=True)
class RawBag:
    """The contract's topics of a bag, by their names in the contract.

    Attributes:
        path: of the bag.
        namespace: under which `joint_states` was found, '/' = none.
        joints: `joint_states` and, where it has messages, `amplifier_voltage`.
        trajectories: `reference` and `feedforward_torque`, where they have messages.
        ignored: type of every other topic.
        unreadable: number of messages of each topic that could not be decoded, where any.
    """

    path: Path
    namespace: str
    joints: dict[str, JointSamples]
    trajectories: dict[str, TrajectoryPoints]
    ignored: dict[str, str]
    unreadable: dict[str, int]
