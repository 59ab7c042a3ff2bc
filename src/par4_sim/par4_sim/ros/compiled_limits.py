"""Limits of references that are ready for the first one."""

from __future__ import annotations

import numpy as np

from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Robot
from par4_kinematics.ros.serialised_trajectory import read_serialised_trajectory, serialised_rest
from par4_kinematics.stamps import SECOND
from par4_kinematics.workspace import home_pose
from par4_sim.drives.reference import ReferenceQueue
from par4_sim.drives.reference_curve import ReferenceLimits


def compiled_limits(robot: Robot) -> ReferenceLimits:
    """Return the limits of references, all that these need compiled.

    A reference would come too late if it had to wait for that.
    """
    limits = ReferenceLimits(robot)
    home = inverse_kinematics(robot.geometry, home_pose(robot))
    queue = ReferenceQueue(home, limits)
    for count in (1, 2):
        points = read_serialised_trajectory(serialised_rest(home, count))
        motion = points.motion()
        limits.check(points.times(0), np.hstack(motion))
        queue.queue(0.0, points.times(count * SECOND), *motion)
        queue.queue_effort(points.times(count * SECOND), motion[0])
        queue.use_until(float(count))
    return limits
