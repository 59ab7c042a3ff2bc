"""Exciting motion: quasi-random displacements in operational space, slow and then fast.

The slow phase makes every joint reverse often at low speed (friction), the fast one has high
accelerations (inertias and masses). Each is a wide wander through the workspace plus a narrow,
quick one about it, and begins and ends at rest at home.

A wander joins random points by septic steps: step k lasts two intervals and starts one after step
k - 1, so that two always overlap. It is three times continuously differentiable, passes close to
its points without stopping, and is a convex combination of them: it stays where they are.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from par4_kinematics.acceleration import half_plate_accelerations, joint_motion
from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion, check_limits, motion_of_platform, sample_times
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import require_positive
from par4_kinematics.workspace import home_pose, reachable, workspace_grid

SHORTEST = 4.0
"""s"""
SLOW_JOINT_SPEED = 1.0
"""rad/s, at most in the slow phase."""
SLOW_ACCELERATION = 5.0
"""m/s2, at most in the slow phase."""
FAST_SPEED_SHARE = 0.55
"""Share of the robot's joint speed that the fast phase uses at most."""
WIDE_SHARE = np.array((0.75, 0.75, 0.6, 0.4))
"""Of the region in x, y, z, theta: the wide wander; the rest is for the narrow one."""
WIDE_LOAD = 0.45
"""Share of a phase's limits for the wide wander alone."""
SAMPLES_PER_INTERVAL = 10
"""At least, between the points of the narrow wander."""
MARGIN = 0.98
"""Of a phase's limits, so that samples between those checked keep them too."""


@dataclass(frozen=True)
class Phase:
    """Limits of one phase.

    Attributes:
        duration: s.
        joint_speed: rad/s.
        acceleration: of either half plate (D and D'), m/s2.
        shortest_interval: of a wander, s, so that its samples describe it.
    """

    duration: float
    joint_speed: float
    acceleration: float
    shortest_interval: float


def excitation_motion(robot: Robot, duration: float = 30.0, seed: int = 0, period: float = 1e-3, *,
                      slow_fraction: float = 0.4, acceleration: float = 100.0,
                      joint_speed: float | None = None) -> Motion:
    """Return a quasi-random motion from home to home for identification.

    It is fitted to the robot's workspace, joint range and joint speed; the same seed gives the
    same motion. Torque is not known here: lower `acceleration` where the drives are weak.

    Args:
        robot: the machine.
        duration: s, at least 4; the motion rests for up to a period at the end.
        seed: of the random points.
        period: seconds between samples.
        slow_fraction: share of the duration for the slow phase, 0.1 to 0.9.
        acceleration: limit of either half plate in the fast phase, m/s2.
        joint_speed: limit in the fast phase, rad/s; None for a little more than half of what the
            robot may.

    Raises:
        InputError: values out of range, or a robot whose workspace limits its legs do not reach.
        UnreachableError: the legs leave a gap within those limits.
    """
    if not SHORTEST <= duration < math.inf:
        raise InputError(f'excitation: a duration of {duration:g} s; at least {SHORTEST:g} s are '
                         f'needed for a slow and a fast phase')
    if not 0.1 <= slow_fraction <= 0.9:
        raise InputError(f'excitation: slow_fraction must be 0.1 to 0.9, found {slow_fraction:g}')
    if seed < 0:
        raise InputError(f'excitation: seed must be 0 or more, found {seed}')
    if joint_speed is None:
        joint_speed = FAST_SPEED_SHARE * robot.limits.joint_speed
    require_positive({'acceleration': acceleration, 'joint_speed': joint_speed}, 'excitation')
    t = sample_times(duration, period)
    home = home_pose(robot)
    region = reachable_region(robot, home)
    generator = np.random.default_rng(seed)
    slow_duration = slow_fraction * duration
    slow = Phase(slow_duration, min(SLOW_JOINT_SPEED, joint_speed),
                 min(SLOW_ACCELERATION, acceleration), SAMPLES_PER_INTERVAL * period)
    fast = replace(slow, duration=duration - slow_duration, joint_speed=joint_speed,
                   acceleration=acceleration)
    x = np.zeros((3, len(t), 4))
    x[0] = home
    for phase, start in ((slow, 0.0), (fast, slow_duration)):
        for wander in _fitted_wanders(phase, robot, home, region, generator):
            x += np.stack(wander.sample(t - start))
    motion = motion_of_platform('excitation', robot.geometry, t, *x)
    check_limits(motion, robot)
    return motion


@dataclass(frozen=True)
class Region:
    """Where the points of a motion lie: the robot's workspace limits, drawn towards home.

    Attributes:
        middle: of the cylinder, relative to home, (4,).
        radius, half_height, theta: its extent, m, m, rad.
    """

    middle: np.ndarray
    radius: float
    half_height: float
    theta: float


def reachable_region(robot: Robot, home: np.ndarray) -> Region:
    """Return the largest region that every leg reaches within its joint range."""
    low, high = robot.limits.joint_position
    grid = workspace_grid(robot) - home
    space = robot.limits.workspace
    for share in np.arange(0.95, 0.14, -0.05):
        poses = home + share * grid
        if not reachable(robot.geometry, poses).all():
            continue
        q = inverse_kinematics(robot.geometry, poses)
        if low <= q.min() and q.max() <= high:
            middle = np.array((0.0, 0.0, np.mean(space.z), 0.0)) - home
            return Region(share * middle, float(share * space.radius),
                          float(0.5 * share * np.ptp(space.z)), float(share * space.theta))
    raise InputError(
        f'excitation: about home (z {home[2]:.4g} m) the legs of robot {robot.name} reach less '
        f'than a seventh of its workspace limits within its joint range; set limits.workspace and '
        f'limits.joint_position in its file to where it can work')


@dataclass(frozen=True)
class Wander:
    """A smooth path from 0 near random points and back to 0.

    Attributes:
        points: (n, 4), m and rad, the first and the last zero.
        interval: seconds between the starts of its steps.
    """

    points: np.ndarray
    interval: float

    def sample(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the displacement and its first two time derivatives (n, 4) at times t (n,)."""
        steps = np.diff(self.points, axis=0)
        place = np.clip(t / self.interval, 0.0, len(steps) + 1.0)
        newest = np.minimum(place.astype(int), len(steps))
        padded = np.concatenate((np.zeros((1, 4)), steps, np.zeros((1, 4))))  # step k at k + 1
        x = np.concatenate((np.zeros((1, 4)), self.points))[newest]
        xd, xdd = np.zeros_like(x), np.zeros_like(x)
        for age in (0, 1):
            u = (0.5 * (place - newest + age))[:, None]
            step = padded[newest + 1 - age]
            x += step * u ** 4 * (35.0 - 84.0 * u + 70.0 * u ** 2 - 20.0 * u ** 3)
            xd += step * 140.0 * (u * (1.0 - u)) ** 3
            xdd += step * 420.0 * (u * (1.0 - u)) ** 2 * (1.0 - 2.0 * u)
        lasting = 2.0 * self.interval
        return x, xd / lasting, xdd / lasting ** 2


def _fitted_wanders(phase: Phase, robot: Robot, home: np.ndarray, region: Region,
                    generator: np.random.Generator) -> tuple[Wander, Wander]:
    """Return the wide and the narrow wander of a phase, as large as its limits let them be."""
    extent = np.array((region.radius, region.radius, region.half_height, region.theta))
    wide_extent = WIDE_SHARE * extent
    narrow_extent = extent - wide_extent
    # D moves about as fast as an elbow. A step of a wander peaks at 1.1 of its length per interval
    # and, with its neighbours, at about 3 of it per interval squared.
    speed = robot.geometry.arm_length * phase.joint_speed
    wide_interval = max(1.3 * wide_extent[0] / (WIDE_LOAD * speed),
                        math.sqrt(3.0 * wide_extent[0] / (WIDE_LOAD * phase.acceleration)))
    # Both limits are met at once, unless the narrow wander has too little room for that speed.
    narrow_interval = max(phase.shortest_interval,
                          min(2.5 * speed / phase.acceleration,
                              math.sqrt(8.0 * narrow_extent[0] / phase.acceleration)))
    wide = _random_wander(phase.duration, wide_interval, wide_extent, region.middle, generator)
    narrow = _random_wander(phase.duration, narrow_interval, narrow_extent, np.zeros(4), generator)
    t = np.arange(0.0, phase.duration, min(wide.interval, narrow.interval) / 16.0)
    still = np.zeros((3, len(t), 4))
    still[0] = home
    wide_scale = _largest_scale(phase, robot, still, np.stack(wide.sample(t)), WIDE_LOAD)
    moving = still + wide_scale * np.stack(wide.sample(t))
    narrow_scale = _largest_scale(phase, robot, moving, np.stack(narrow.sample(t)), MARGIN)
    return (Wander(wide_scale * wide.points, wide.interval),
            Wander(narrow_scale * narrow.points, narrow.interval))


def _random_wander(duration: float, interval: float, extent: np.ndarray, middle: np.ndarray,
                   generator: np.random.Generator) -> Wander:
    """Return a wander of `duration` with steps about every `interval` s, points in a cylinder.

    They lie in its outer half: wide strokes, and peaks that stand out less from the rest.
    """
    count = max(1, round(duration / interval) - 2)
    azimuth = generator.uniform(-math.pi, math.pi, count)
    radius = extent[0] * np.sqrt(generator.uniform(0.5, 1.0, count))
    points = np.zeros((count + 2, 4))
    points[1:-1] = middle + np.column_stack((
        radius * np.cos(azimuth), radius * np.sin(azimuth),
        extent[2:] * generator.uniform(-1.0, 1.0, (count, 2))))
    return Wander(points, duration / (count + 2))


def _largest_scale(phase: Phase, robot: Robot, base: np.ndarray, added: np.ndarray, share: float
                   ) -> float:
    """Return the largest scale of 0 to 1 at which base + scale added keeps `share` of the limits.

    base, added: x, xd, xdd stacked, (3, n, 4).
    """
    lowest, highest = 0.0, 1.0
    if _load(phase, robot, base + added) <= share:
        return highest
    for _ in range(12):
        middle = 0.5 * (lowest + highest)
        if _load(phase, robot, base + middle * added) <= share:
            lowest = middle
        else:
            highest = middle
    return lowest


def _load(phase: Phase, robot: Robot, x: np.ndarray) -> float:
    """Return the largest share of the phase's limits that a platform motion (3, n, 4) uses."""
    qd = joint_motion(robot.geometry, *x).qd
    fastest = np.linalg.norm(half_plate_accelerations(robot.geometry, *x), axis=-1).max()
    return max(np.abs(qd).max() / phase.joint_speed, fastest / phase.acceleration)
