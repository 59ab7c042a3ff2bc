"""A circle of D in a horizontal plane while theta swings, from rest to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion, motion_of_platform, sample_times
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import SCurve, require_positive
from par4_kinematics.workspace import home_pose

TURNS = 3
"""Where nobody says how many."""
RISE_SHARE = 0.5
"""Share of a turn in which the circle gets up to speed, and in which it stops."""


def circle_motion(robot: Robot, *, radius: float | None = None, speed: float = 1.0,
                  turns: float = TURNS, theta_swing: float | None = None,
                  centre: Sequence[float] | None = None, period: float = 1e-3) -> Motion:
    """Return a circle that starts and stops smoothly (jerk-limited) on its +x side.

    Args:
        robot: the machine.
        radius: of the circle, m; None for half the radius of the robot's workspace.
        speed: of D along the circle, m/s; the centripetal acceleration is speed^2 / radius.
        turns: number of turns, start and stop included.
        theta_swing: range of theta, from -theta_swing / 2 to +theta_swing / 2 once a turn, rad;
            None for the robot's range of theta (half of the way to either side).
        centre: of the circle, (3,) m in `base`; None for the home pose's.
        period: seconds between samples.

    Raises:
        InputError: values that are not positive.
        UnreachableError: a sample that a leg cannot reach.
    """
    space = robot.limits.workspace
    radius = 0.5 * space.radius if radius is None else radius
    require_positive({'radius': radius, 'speed': speed, 'turns': turns}, 'circle')
    swing = space.theta if theta_swing is None else theta_swing
    middle = home_pose(robot)[:3] if centre is None else np.asarray(centre, dtype=float)
    if middle.shape != (3,):
        raise InputError(f'circle: centre must be x, y, z, found shape {middle.shape}')
    rate = speed / radius
    # A rise of which each jerk phase takes half covers rate * rise / 2.
    rise = 4.0 * math.pi * min(RISE_SHARE, 0.5 * turns) / rate
    law = SCurve(2.0 * math.pi * turns, rate, 2.0 * rate / rise, 4.0 * rate / rise ** 2)
    t = sample_times(law.duration, period)
    phase, phase_rate, phase_acceleration = (part[:, None] for part in law.sample(t))
    # Pose and its derivatives by the phase: cosine and sine of the circle, sine of theta.
    radii = np.array((radius, radius, 0.0, 0.5 * swing))
    quarter = 0.5 * math.pi * np.array((1.0, 0.0, 0.0, 0.0))
    sine, cosine = np.sin(phase + quarter), np.cos(phase + quarter)
    x = np.append(middle, 0.0) + radii * sine
    xd = radii * cosine * phase_rate
    xdd = radii * (cosine * phase_acceleration - sine * phase_rate ** 2)
    return motion_of_platform('circle', robot.geometry, t, x, xd, xdd)
