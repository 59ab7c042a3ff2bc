"""The motion that was asked for, from the reference in a bag."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.logs.clock import Clock
from par4_identification.logs.log import Reference
from par4_identification.logs.raw_bag import RawBag, TrajectoryPoints
from par4_identification.logs.stamps import nearest_stamp
from par4_kinematics.interface import FEEDFORWARD_TORQUE, REFERENCE, START_DELAY
from par4_sim.drives.waiting_torque import MATCH


def reference_of(bag: RawBag, joints: Sequence[str], clock: Clock) -> tuple[Reference | None, str]:
    """Return the motion asked for, and whether it was read, absent or why it is ignored.

    A message replaces every earlier point from its own first time on. A stamp of zero starts
    START_DELAY after receipt, which is placed by the positions received around it.
    """
    points = bag.trajectories.get(REFERENCE.name)
    if points is None or not len(points.stamp):
        return None, 'absent'
    missing = sorted(set(joints) - {name for names in points.layouts for name in names})
    if missing:
        return None, f'{points.topic} lacks {", ".join(missing)}'
    time = _point_times(points, clock)
    first = np.full(points.message[-1] + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, points.message, time)
    replaced_from = np.append(np.minimum.accumulate(first[::-1])[::-1][1:],
                              np.iinfo(np.int64).max)
    q = points.select(points.position, joints)
    kept = np.flatnonzero((time < replaced_from[points.message]) & np.isfinite(q).all(axis=1))
    if not len(kept) or (np.diff(time[kept]) <= 0).any():
        return None, f'{points.topic} has no points with increasing times'
    return Reference(
        1e-9 * time[kept], q[kept], points.select(points.velocity, joints)[kept],
        points.select(points.acceleration, joints)[kept],
        _feedforward(bag, joints, clock, time[kept])), 'read'


def _point_times(points: TrajectoryPoints, clock: Clock) -> np.ndarray:
    """Return the time of each point, (n,) ns."""
    start = np.where(points.stamp > 0, clock.time(points.received, points.stamp),
                     clock.at_receipt(points.received) + round(1e9 * START_DELAY))
    return start + points.time_from_start


def _feedforward(bag: RawBag, joints: Sequence[str], clock: Clock, time: np.ndarray
                 ) -> np.ndarray | None:
    """Return the torque that came for reference points at `time` (m,) ns, (m, J), or None."""
    points = bag.trajectories.get(FEEDFORWARD_TORQUE.name)
    if points is None or len(points.stamp) < 2:
        return None
    # reversed, so that the newest of one time is the one that `unique` keeps
    own, newest = np.unique(_point_times(points, clock)[::-1], return_index=True)
    if len(own) < 2:
        return None
    effort = points.select(points.effort, joints)[::-1][newest]
    nearest = nearest_stamp(own, time)
    matched = np.abs(own[nearest] - time) <= 1e9 * MATCH
    effort = np.where(matched[:, None], effort[nearest], np.nan)
    return effort if np.isfinite(effort).any() else None
