"""The Adept motion: 25 mm up, 305 mm across, 25 mm down, and back.

Each way is three straight segments whose time laws overlap at the two corners: not at all, and
the platform stops in the corners; wholly, and lift and lowering happen within the crossing.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion, motion_of_platform, sample_times
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import SCurve, TimeLaw, Trapezoid, require_positive
from par4_kinematics.workspace import home_pose

LIFT = 0.025
"""m"""
REACH = 0.305
"""m"""
CORNERS = 4
"""Corners of a round trip; at its two ends the platform comes to rest."""


def adept_motion(robot: Robot, *, speed: float = 5.0, acceleration: float = 150.0,
                 jerk: float | None = None, round_trip: float | None = 0.25,
                 theta_swing: float = 0.0, centre: Sequence[float] | None = None,
                 azimuth: float = 0.0, cycles: int = 1, period: float = 1e-3) -> Motion:
    """Return `cycles` round trips of the Adept motion; the defaults are the paper's run.

    Args:
        robot: the machine.
        speed, acceleration: limits of each segment, m/s and m/s2. Where two overlap at a corner
            the platform reaches sqrt(2) of the acceleration.
        jerk: limit of each segment, m/s3; None for trapezoids of speed.
        round_trip: wanted seconds of a round trip, which set the overlap; None for no overlap.
        theta_swing: range of theta, from -theta_swing / 2 to +theta_swing / 2 during the way
            across and back, rad.
        centre: middle of the pick and place points, (3,) m in `base`; None for the home pose's.
        azimuth: direction of the way across, rad.
        cycles: number of round trips.
        period: seconds between samples.

    Raises:
        InputError: values that are not positive, or a round trip that no overlap gives.
        UnreachableError: a sample that a leg cannot reach.
    """
    lift, across = (_segment(length, speed, acceleration, jerk) for length in (LIFT, REACH))
    if cycles < 1:
        raise InputError(f'adept motion: cycles must be at least 1, found {cycles}')
    overlap = _overlap(lift, across, round_trip)
    middle = home_pose(robot)[:3] if centre is None else np.asarray(centre, dtype=float)
    if middle.shape != (3,):
        raise InputError(f'adept motion: centre must be x, y, z, found shape {middle.shape}')
    step_across = np.array((REACH * math.cos(azimuth), REACH * math.sin(azimuth), 0.0, theta_swing))
    step_up = np.array((0.0, 0.0, LIFT, 0.0))
    one_way = 2.0 * (lift.duration - overlap) + across.duration
    t = sample_times(2.0 * cycles * one_way, period)
    x = np.zeros((3, len(t), 4))
    x[0] += np.append(middle, 0.0) - 0.5 * step_across
    gone = np.zeros((len(t) + 1, 4))  # by the segments that end at each sample
    for way in range(2 * cycles):
        start = way * one_way
        for law, delay, step in (
                (lift, 0.0, step_up),
                (across, lift.duration - overlap, step_across if way % 2 == 0 else -step_across),
                (lift, one_way - lift.duration, -step_up)):
            first, last = np.searchsorted(t, (start + delay, start + delay + law.duration))
            parts = np.stack(law.sample(t[first:last] - start - delay))
            x[:, first:last] += parts[..., None] / law.length * step
            gone[last] += step
    x[0] += np.cumsum(gone[:-1], axis=0)
    return motion_of_platform('adept', robot.geometry, t, *x)


def _segment(length: float, speed: float, acceleration: float, jerk: float | None) -> TimeLaw:
    if jerk is None:
        return Trapezoid(length, speed, acceleration)
    return SCurve(length, speed, acceleration, jerk)


def _overlap(lift: TimeLaw, across: TimeLaw, round_trip: float | None) -> float:
    """Return the seconds that two segments overlap at each corner."""
    if round_trip is None:
        return 0.0
    require_positive({'round_trip': round_trip}, 'adept motion')
    longest = 4.0 * lift.duration + 2.0 * across.duration
    shortest = longest - CORNERS * min(lift.duration, across.duration)
    if not shortest <= round_trip <= longest:
        raise InputError(
            f'adept motion: a round trip of {round_trip:g} s, but these limits give '
            f'{shortest:.4g} s (corners fully blended) to {longest:.4g} s (not blended); choose '
            f'one of these, or other limits of speed, acceleration and jerk')
    return (longest - round_trip) / CORNERS
