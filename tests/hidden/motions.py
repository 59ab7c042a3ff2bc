"""Motions of several shapes, drawn from a seed, within the limits of a robot."""

from __future__ import annotations

import numpy as np

from par4_kinematics.adept import adept_motion
from par4_kinematics.approach import with_approach
from par4_kinematics.circle import circle_motion
from par4_kinematics.errors import Par4Error
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import Motion, check_limits
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose

SHAPES = ('excitation', 'slow then fast', 'mixed', 'circles')
ODD_SHAPES = ('cycles', 'slow')
"""Of motions that nobody chose for identification."""
PAUSE = 0.4
"""s between the parts of a motion."""


def joined(name: str, parts: list[Motion], robot: Robot) -> Motion:
    """Return motions one after the other, with approaches and pauses between them."""
    rows = {key: [] for key in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd')}
    for number, motion in enumerate(parts):
        if number:
            motion = with_approach(motion, robot, rows['q'][-1][-1])
            rest = round(PAUSE / motion.period)
            for key in ('q', 'x'):
                rows[key].append(np.repeat(rows[key][-1][-1:], rest, axis=0))
            for key in ('qd', 'qdd', 'xd', 'xdd'):
                rows[key].append(np.zeros((rest, 4)))
        for key, kept in rows.items():
            kept.append(getattr(motion, key))
    whole = {key: np.concatenate(kept) for key, kept in rows.items()}
    motion = Motion(name, np.arange(len(whole['q'])) * parts[0].period, **whole)
    check_limits(motion, robot)
    return motion


def draw_motion(shape: str, robot: Robot, duration: float, seed: int) -> Motion:
    """Return a motion of about `duration` s from rest at home."""
    random = np.random.default_rng((seed, 5))
    hard = {'acceleration': float(random.uniform(30.0, 100.0)),
            'joint_speed': float(random.uniform(3.0, 8.0))}
    if shape == 'excitation':
        return excitation_motion(robot, duration, seed, **hard,
                                 slow_fraction=float(random.uniform(0.25, 0.6)))
    if shape == 'slow then fast':
        return joined(shape, [
            excitation_motion(robot, 0.55 * duration, seed, slow_fraction=0.7,
                              joint_speed=float(random.uniform(0.8, 2.0)), acceleration=15.0),
            excitation_motion(robot, 0.45 * duration, seed + 1, slow_fraction=0.2, **hard)], robot)
    if shape == 'slow':
        return excitation_motion(robot, duration, seed, slow_fraction=0.85, acceleration=8.0,
                                 joint_speed=float(random.uniform(0.6, 1.2)))
    if shape == 'cycles':
        return _cycles(robot, duration, random)
    wandering = excitation_motion(robot, 0.65 * duration, seed, **hard,
                                  slow_fraction=float(random.uniform(0.3, 0.6)))
    length = 0.35 * duration - 1.5
    if shape == 'mixed':
        return joined(shape, [wandering, _cycles(robot, length, random)], robot)
    radius, speed = random.uniform(0.3, 0.6), random.uniform(0.3, 1.2)
    radius *= robot.limits.workspace.radius
    turns = max(1.0, np.floor(length * speed / (2.0 * np.pi * radius)))
    return joined(shape, [wandering, circle_motion(robot, radius=float(radius), speed=float(speed),
                                                   turns=float(turns))], robot)


def _cycles(robot: Robot, length: float, random: np.random.Generator) -> Motion:
    """Return Adept cycles somewhere in the workspace, pauses in between."""
    cycles = []
    while sum(cycle.duration + PAUSE for cycle in cycles) < length:
        centre = home_pose(robot)[:3] + random.uniform(-0.03, 0.03, 3)
        try:
            cycle = adept_motion(
                robot, acceleration=float(random.uniform(15.0, 60.0)), round_trip=None,
                speed=2.0, theta_swing=float(random.uniform(0.0, 1.0)), centre=centre,
                azimuth=float(random.uniform(-np.pi, np.pi)), cycles=int(random.integers(1, 3)))
            check_limits(cycle, robot)
        except Par4Error:
            continue
        cycles.append(cycle)
    return joined('cycles', cycles, robot)
