"""Motions that tell causes apart: strokes at constant speed, reversals, vibrations, cycles.

Each shows some of the differences between effects: many constant speeds in both directions show
friction curves, reversals show presliding, vibrations show delays, the corners of the workspace
show static torques, and turning theta alone shows what belongs to theta.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np

from par4_dynamics.model import Model
from par4_identification.excitation.motion_limits import MotionLimits, largest_loads, limits_of
from par4_kinematics.adept import adept_motion
from par4_kinematics.approach import with_approach
from par4_kinematics.errors import Par4Error
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import (
    Motion,
    check_limits,
    motion_of_platform,
    sample_times,
    waypoints_motion,
)
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose

SPEEDS = (0.06, 0.12, 0.25, 0.5, 1.0, 2.0, 4.0)
"""Joint speeds, roughly, of strokes along an axis, rad/s."""
STROKE = 0.8
"""s that a slow stroke lasts; a fast one is as wide as the workspace."""
EXTENT_SHARE = 0.9
"""Of the workspace's radius, height and angle that strokes and vibrations use."""
LOAD_SHARE = 0.6
"""Of the acceleration limit that vibrations use."""
FREQUENCIES = (1.0, 2.0, 4.0, 7.0, 11.0, 16.0)
"""Hz, of vibrations."""
REVERSALS = ((0.004, 5.0), (0.008, 4.0), (0.015, 4.0), (0.03, 3.0), (0.06, 2.0))
"""Amplitude, rad of a joint, and Hz of small reversals."""
CYCLES = 6
"""Of a vibration at each frequency, of which the first and the last grow and fade."""
AXES = {'x': 0, 'y': 1, 'z': 2, 'theta': 3}
EXCITATION = 12.0
"""s"""


def motion_library(robot: Robot, model: Model) -> list[Motion]:
    """Return the motions of the library that keep the limits of a robot, from home and back.

    Args:
        robot: the machine.
        model: computes the torque, which must stay within that of the drives.

    Returns:
        motions; none if the drives cannot even hold the platform, or the workspace is out of reach.
    """
    try:
        limits = limits_of(robot, model)
    except Par4Error:
        return []
    motions, at_home = [], _at_home(robot)
    for name, make in _makers(robot, limits):
        try:
            motion = joined([make(), at_home], name, robot)
            check_limits(motion, robot)
        except Par4Error:  # this one is not for this robot
            continue
        if _share_of_limits(limits, motion, robot, model) <= 1.0:
            motions.append(motion)
    return motions


def _share_of_limits(limits: MotionLimits, motion: Motion, robot: Robot, model: Model) -> float:
    """Return the largest share of speed, acceleration and torque; poses are checked elsewhere."""
    loads = largest_loads(limits, motion, robot, model)
    return max(loads[kind] for kind in ('joint speed', 'acceleration', 'torque'))


def _at_home(robot: Robot) -> Motion:
    """Return two samples of rest at home."""
    still = np.zeros((2, 4))
    return motion_of_platform('home', robot.geometry, sample_times(1e-3, 1e-3),
                              still + home_pose(robot), still, still)


def joined(parts: Sequence[Motion], name: str, robot: Robot) -> Motion:
    """Return motions one after the other, from rest at home, with an approach to each.

    Raises:
        UnreachableError: the mechanism does not close on the way between two.
        InputError: the way between two leaves the robot's limits.
    """
    at = inverse_kinematics(robot.geometry, home_pose(robot))
    times, samples, end = [], [], 0.0
    for part in parts:
        whole = with_approach(part, robot, at)
        times.append(end + whole.t)
        samples.append([getattr(whole, field) for field in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd')])
        end = times[-1][-1] + whole.period
        at = whole.q[-1]
    return Motion(name, np.concatenate(times), *map(np.concatenate, zip(*samples, strict=True)))


def _makers(robot: Robot, limits: MotionLimits) -> Iterator[tuple[str, Callable[[], Motion]]]:
    """Yield the name of each motion and what makes it."""
    for axis in AXES:
        yield (f'strokes along {axis} at many speeds',
               partial(_strokes, robot, limits, axis, SPEEDS))
    for axis in ('z', 'theta'):
        yield (f'slow strokes along {axis}',
               partial(_strokes, robot, limits, axis, SPEEDS[:4]))
        yield (f'fast strokes along {axis}',
               partial(_strokes, robot, limits, axis, SPEEDS[4:]))
    for speed in (0.15, 0.6):
        yield (f'corners of the workspace at {speed:g} m/s',
               partial(_corners, robot, limits, speed))
    for axis in ('x', 'z'):
        yield (f'small reversals along {axis}',
               partial(_vibrations, robot, axis, [
                   (amplitude * robot.geometry.arm_length, frequency)
                   for amplitude, frequency in REVERSALS]))
    for axis in AXES:
        yield (f'vibration along {axis} of increasing frequency',
               partial(_widest_vibrations, robot, limits, axis))
    for acceleration in (5.0, 20.0, 60.0):
        for azimuth in (0.0, 0.25 * math.pi):
            yield (f'Adept cycles at {acceleration:g} m/s2 along {math.degrees(azimuth):.0f} deg',
                   partial(adept_motion, robot, acceleration=acceleration, speed=3.0,
                           round_trip=None, theta_swing=limits.extent[2], azimuth=azimuth,
                           cycles=4))
    for name, slow_fraction, share in (
            ('mostly slow excitation', 0.85, 1.0), ('excitation', 0.4, 1.0),
            ('gentle excitation', 0.4, 0.3), ('fast excitation', 0.1, 1.0)):
        yield (name, partial(
            excitation_motion, robot, EXCITATION, slow_fraction=slow_fraction,
            acceleration=share * limits.acceleration,
            joint_speed=share ** 0.5 * limits.joint_speed))


def _extent(limits: MotionLimits, axis: str) -> float:
    """Return how far a motion along an axis may go from the middle of the workspace."""
    return EXTENT_SHARE * float(limits.extent[{'x': 0, 'y': 0, 'z': 1, 'theta': 2}[axis]])


def _strokes(robot: Robot, limits: MotionLimits, axis: str, speeds: Sequence[float]) -> Motion:
    """Return strokes to and fro about the middle at constant speeds, given as joint speeds."""
    parts = []
    for joint_speed in speeds:
        turning = axis == 'theta'
        reach = robot.geometry.arm_length
        speed = joint_speed * reach / (robot.geometry.platform_bar_length if turning else 1.0)
        half = min(_extent(limits, axis), 0.5 * STROKE * speed)
        step = np.zeros(4)
        step[AXES[axis]] = half
        poses = [limits.middle, limits.middle + step, limits.middle - step, limits.middle + step,
                 limits.middle - step, limits.middle]
        # a tenth of the stroke for each change of speed
        quick = speed ** 2 / (0.2 * half)
        limit = 0.9 * limits.acceleration / (
            robot.geometry.platform_bar_length if turning else 1.0)
        quick = min(quick, limit)
        laws = {'speed': speed, 'acceleration': quick, 'jerk': 20.0 * quick ** 2 / speed}
        parts.append(waypoints_motion(robot, np.array(poses).tolist(), **(
            {f'theta_{name}': value for name, value in laws.items()} if turning else laws)))
    return joined(parts, 'strokes', robot)


def _corners(robot: Robot, limits: MotionLimits, speed: float) -> Motion:
    """Return a slow tour of the rim of the workspace, high and low, theta to either side."""
    poses = [limits.middle]
    radius, height, angle = EXTENT_SHARE * limits.extent
    for number in range(6):
        azimuth = number * math.pi * 5.0 / 6.0  # across, so that each way is long
        side = 1.0 if number % 2 else -1.0
        poses.append(limits.middle + np.array((
            radius * math.cos(azimuth), radius * math.sin(azimuth), side * height,
            side * angle * (1.0 if number % 3 else -1.0))))
    poses.append(limits.middle)
    return waypoints_motion(robot, np.array(poses).tolist(), speed=speed, acceleration=4.0 * speed,
                            theta_speed=6.0 * speed, theta_acceleration=24.0 * speed)


def _widest_vibrations(robot: Robot, limits: MotionLimits, axis: str) -> Motion:
    """Return the widest vibrations along an axis that the limits allow."""
    return _vibrations(robot, axis, _widest(robot, limits, axis))


def _widest(robot: Robot, limits: MotionLimits, axis: str) -> list[tuple[float, float]]:
    """Return the widest vibration along an axis at each frequency, amplitude and Hz."""
    arm = robot.geometry.platform_bar_length if axis == 'theta' else 1.0
    speed = LOAD_SHARE * limits.joint_speed * robot.geometry.arm_length / arm
    return [(min(0.7 * _extent(limits, axis), speed / rate,
                 LOAD_SHARE * limits.acceleration / arm / rate ** 2), frequency)
            for frequency in FREQUENCIES for rate in (2.0 * math.pi * frequency,)]


def _vibrations(robot: Robot, axis: str, vibrations: Sequence[tuple[float, float]]) -> Motion:
    """Return bursts of `CYCLES` sine waves about home along an axis, amplitude and Hz of each."""
    starts = np.cumsum([0.0, *(CYCLES / frequency for _, frequency in vibrations)])
    t = sample_times(starts[-1], 1e-3)
    x = np.zeros((3, len(t), 4))
    x[0] = home_pose(robot)
    for (amplitude, frequency), start, end in zip(vibrations, starts[:-1], starts[1:], strict=True):
        rows = (t >= start) & (t < end)
        u = (t[rows] - start) * frequency  # cycles
        wave, rate = np.sin(2.0 * math.pi * u), 2.0 * math.pi
        slope, bend = rate * np.cos(2.0 * math.pi * u), -rate ** 2 * wave
        size, size_d, size_dd = _fade(u)
        x[0, rows, AXES[axis]] += amplitude * size * wave
        x[1, rows, AXES[axis]] = amplitude * frequency * (size_d * wave + size * slope)
        x[2, rows, AXES[axis]] = amplitude * frequency ** 2 * (
            size_dd * wave + 2.0 * size_d * slope + size * bend)
    return motion_of_platform('vibrations', robot.geometry, t, *x)


def _fade(u: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return an envelope that grows over the first cycle and fades over the last; derivatives."""
    sign = np.where(u > 0.5 * CYCLES, -1.0, 1.0)
    v = np.clip(np.minimum(u, CYCLES - u), 0.0, 1.0)
    return (v ** 3 * (10.0 - 15.0 * v + 6.0 * v ** 2), sign * 30.0 * (v * (1.0 - v)) ** 2,
            60.0 * v * (1.0 - v) * (1.0 - 2.0 * v))
