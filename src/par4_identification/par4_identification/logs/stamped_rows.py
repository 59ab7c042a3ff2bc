"""Samples of one topic as they were received: those that carry all joints and a stamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from par4_identification.logs.masks import count
from par4_identification.logs.raw_bag import JointSamples
from par4_kinematics.errors import InputError
from par4_kinematics.stamps import SECOND

SET_BACK = SECOND
"""No transport holds a message back for so long (ns): the clock was set back."""


@dataclass(frozen=True)
class StampedRows:
    """Stamped samples (n,) ns, (n, J) of one topic as they were received, and what was dropped."""

    topic: str
    received: np.ndarray
    stamp: np.ndarray
    values: np.ndarray
    dropped: dict[str, int]

    def part(self, kept: np.ndarray) -> StampedRows:
        """Return the rows (n,) that are true in a mask."""
        return replace(self, received=self.received[kept], stamp=self.stamp[kept],
                       values=self.values[kept])


def stamped_rows(path: str | Path, samples: JointSamples, values: np.ndarray,
                 joints: Sequence[str], quantity: str) -> StampedRows | None:
    """Return the stamped rows with all joints, or None if none carries the quantity.

    Raises:
        InputError: a joint is nowhere, every message names one twice, or no message is stamped.
    """
    known = {name for names in samples.layouts for name in names}
    missing = [joint for joint in joints if joint not in known]
    if missing:
        raise InputError(f'{path}: has no {quantity} of {", ".join(missing)}, as the robot file '
                         f'names the joints; {samples.topic} holds '
                         f'{", ".join(sorted(known)) or "no joint"}; give the robot file of this '
                         'machine by --robot, or name the joints alike')
    named, twice = samples.names_count(joints), samples.names_twice(joints)
    if twice.any() and twice[named == len(joints)].all():
        which = [joint for joint in joints
                 if any(names.count(joint) > 1 for names in samples.layouts)]
        raise InputError(f'{path}: every message on {samples.topic} names {", ".join(which)} more '
                         f'than once, so that nothing tells which {quantity} counts; give each '
                         'joint a name of its own')
    complete = (named == len(joints)) & ~twice
    selected = samples.select(values, joints)
    if not np.isfinite(selected[complete]).any():
        return None
    stamped = samples.stamp > 0
    if not stamped[complete].any():
        raise InputError(f'{path}: no message on {samples.topic} has a header stamp; set it to the '
                         'time of the measurement')
    # A simulated clock starts at zero; there, zero is a time.
    if samples.stamp[stamped & complete].min() < SET_BACK:
        stamped = samples.stamp >= 0
    kept = complete & stamped
    received, stamp, selected = ((part if kept.all() else part[kept])
                                 for part in (samples.received, samples.stamp, selected))
    return StampedRows(samples.topic, received, stamp, selected, {
        'read': len(named), 'other_joints': count(named == 0),
        'incomplete': count((named > 0) & (named < len(joints)) & ~twice),
        'named_twice': count(twice),
        'not_stamped': count(complete & ~stamped)})


def reordered(samples: JointSamples, joints: Sequence[str]) -> int:
    """Return how many messages name these joints in another order."""
    differs = np.array([[name for name in names if name in joints] != list(joints)
                        for names in samples.layouts])
    return count(differs[samples.layout])
