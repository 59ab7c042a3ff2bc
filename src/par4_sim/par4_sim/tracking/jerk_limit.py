"""A limit of jerk for a time-optimal profile: its timing is averaged over a window of time.

Time-optimal path parametrisation has no limit of jerk; what it finds jumps from one acceleration to
another. Averaged over a window the same path is followed with jumps that take the window's time. A
longer window lowers the jerk and costs its own length; a slower pace lowers it with the third power
and costs in proportion. Of all windows the one is taken whose fastest pace within all limits takes
the least time. The time of the profile it came from stays a bound.
"""

from __future__ import annotations

import math

import numpy as np
import scipy

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Robot
from par4_sim.choices import STEP
from par4_sim.tracking.way import LONGEST, Averaged, Profile, joints_over_time

SHORTEST = 2.0 * STEP
"""Shortest window, s."""
PACES = 0.02, 2.0
"""Lowest and highest pace that are tried; lower ones where a way then still takes `LONGEST`."""
TIMES = 20_000
"""Most times at which limits are looked at."""
RESOLUTION = 1e-3
"""Relative resolution of window and pace."""
RESERVE = 1e-3
"""Share of the limits that is left unused: they must also hold between the times that are tried."""


def jerk_limited(robot: Robot, model: Model, profile: Profile, torque: float, acceleration: float,
                 jerk: float) -> Averaged:
    """Return the quickest average of a profile that keeps the limits.

    Args:
        robot: geometry and limit of joint speed.
        model: of the machine, effects included.
        profile: that keeps the limits but that of jerk.
        torque: limit of the joints, N m.
        acceleration, jerk: limits of the joints, rad/s2, rad/s3.

    Raises:
        InputError: none does at any pace that is tried.
    """
    def keeps(way: Averaged) -> bool:
        return _keeps(robot, model, way, torque, acceleration, jerk)

    slowest = Averaged(profile, profile.duration,
                       min(PACES[0], 2.0 * profile.duration / LONGEST))
    if not keeps(slowest):
        raise InputError(f'with joint jerks of at most {jerk:g} rad/s3 the limits are not even '
                         f'kept where the path takes {slowest.duration:.3g} s between two rests; '
                         f'raise the limit of the jerks')

    def quickest(log_window: float) -> Averaged:
        window = math.exp(log_window)
        low, high = slowest.pace, PACES[1]
        while high / low > 1.0 + RESOLUTION:
            middle = math.sqrt(low * high)
            kept = keeps(Averaged(profile, window, middle))
            low, high = (middle, high) if kept else (low, middle)
        return Averaged(profile, window, low)

    found = scipy.optimize.minimize_scalar(
        lambda log_window: quickest(log_window).duration, method='bounded',
        bounds=(math.log(SHORTEST), math.log(profile.duration)), options={'xatol': RESOLUTION})
    return quickest(found.x)


def _keeps(robot: Robot, model: Model, way: Averaged, torque: float, acceleration: float,
           jerk: float) -> bool:
    """Return whether a way keeps every limit at all times."""
    t = np.arange(0.0, way.duration, max(STEP, way.duration / TIMES))
    q, qd, qdd = joints_over_time(way, t)
    share = 1.0 - RESERVE
    if (np.abs(way.jerk(t)).max() > share * jerk or np.abs(qdd).max() > share * acceleration
            or np.abs(qd).max() > share * robot.limits.joint_speed):
        return False
    needed = model.torque(state_of_joints(robot.geometry, t, q, qd, qdd))
    return bool(np.abs(needed).max() <= share * torque)
