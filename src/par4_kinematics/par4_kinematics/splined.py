"""A motion through given joint positions at given times, as other planners send them."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion, check_limits, motion_of_joints, sample_times
from par4_kinematics.robot import Robot

STARTS_AT = 0.02
"""rad by which a trajectory that begins at once may begin elsewhere than the robot stands."""
POINT_AT_REST = 1e-6
"""rad/s and rad/s2 up to which a point is at rest: planners compute their ends with rounding."""


def splined_motion(name: str, robot: Robot, q_now: ArrayLike, t: ArrayLike, q: ArrayLike,
                   qd: ArrayLike | None = None, qdd: ArrayLike | None = None,
                   period: float = 1e-3) -> Motion:
    """Return the motion from rest at q_now (4,), rad, through points, sampled evenly.

    Positions alone become a quintic spline with four continuous derivatives that begins and ends
    at rest; of two points it is the quintic of least jerk. Positions and velocities become the
    cubic between each two points, with accelerations the quintic, as the drives interpolate.

    Args:
        name: of the motion.
        robot: whose limits must hold on the whole way.
        q_now: where it stands, (4,).
        t: times of the points from the start, increasing, (n,) s; a first one at 0 is where the
            robot stands, else the way begins there.
        q, qd, qdd: at the points, (n, 4), rad, rad/s, rad/s2.
        period: of the samples, s.

    Raises:
        InputError: times that do not increase, a first point elsewhere or in motion, accelerations
            without velocities, an end in motion, or limits that the way breaks.
        UnreachableError: the mechanism does not close on the way.
    """
    start = np.asarray(q_now, dtype=float)
    knots = np.asarray(t, dtype=float)
    columns = [np.asarray(part, dtype=float) for part in (q, qd, qdd) if part is not None]
    if qd is None and qdd is not None:
        raise InputError(f'{name}: accelerations without velocities; send both, or positions only')
    if not len(knots) or knots[0] < 0.0 or (np.diff(knots) <= 0.0).any():
        raise InputError(f'{name}: times from the start must be 0 or more and increase')
    if any(np.abs(part[-1]).max() > POINT_AT_REST for part in columns[1:]):
        raise InputError(f'{name}: it ends in motion; send a last point at rest')
    if knots[0] == 0.0:
        apart = float(np.abs(columns[0][0] - start).max())
        if apart > STARTS_AT:
            raise InputError(f'{name}: it begins {apart:.3g} rad from where the robot stands, at '
                             f'most {STARTS_AT:g} rad are allowed; begin there, or later than 0 s')
        if len(columns) > 1 and np.abs(columns[1][0]).max() > POINT_AT_REST:
            raise InputError(f'{name}: it begins in motion, and the robot rests; send a first '
                             f'point at rest, or begin later than 0 s')
    else:
        knots = np.concatenate(([0.0], knots))
        columns = [np.vstack((start if order == 0 else np.zeros(4), part))
                   for order, part in enumerate(columns)]
    if len(knots) < 2:
        raise InputError(f'{name}: a single point at 0 s is no motion; send a later one')
    if len(columns) == 1:
        rest = [(1, np.zeros(4)), (2, np.zeros(4))]
        path = scipy.interpolate.make_interp_spline(knots, columns[0], k=5, bc_type=(rest, rest))
    else:
        path = scipy.interpolate.BPoly.from_derivatives(knots, np.stack(columns, axis=1))
    times = sample_times(float(knots[-1]), period)
    inside = np.minimum(times, knots[-1])
    parts = [path(inside), path.derivative()(inside), path.derivative().derivative()(inside)]
    motion = motion_of_joints(name, robot.geometry, times, *parts)
    check_limits(motion, robot)
    return motion
