"""What computed torque will do over a horizon of its reference, and what corrections change of it.

The law makes of every joint the loop eddot + damping edot + stiffness e = -c, where c is a
correction of the acceleration that it asks for, held over each interval of the horizon. So errors
are known in advance, exactly and alike for every joint. Torques and poses are those of the law's
model along the errors with the corrections that were planned before, and taken as linear in what
changes of these.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_dynamics.rigid_body import torque_of_joints_sample
from par4_kinematics.acceleration import closed_legs, platform_speed
from par4_kinematics.geometry import HOME
from par4_kinematics.position import forward_sample
from par4_sim.drives.controller import CARRIED, FEEDFORWARD, INTEGRAL, hand_over
from par4_sim.drives.reference import TARGET, interpolate


def responses(damping: float, stiffness: float, interval: float, count: int
              ) -> tuple[np.ndarray, np.ndarray]:
    """Return how the error of a joint goes on, and what corrections add to it.

    Args:
        damping, stiffness: of the law, 1/s, 1/s2.
        interval: over which a correction is held, s.
        count: of intervals.

    Returns:
        free: (count, 2, 2), error and its rate in the middle of each interval from those at the
            beginning of the horizon.
        forced: (count, 2, count), what a correction of 1 rad/s2 in each interval adds to both.
    """
    from scipy.linalg import expm  # slow to load, and of one law alone

    system = np.zeros((3, 3))  # error, rate, correction
    system[0, 1] = 1.0
    system[1] = -stiffness, -damping, -1.0
    half = expm(0.5 * system * interval)
    whole = half @ half
    free, forced = np.empty((count, 2, 2)), np.zeros((count, 2, count))
    to_begin, by_begin = np.eye(2), np.zeros((2, count))
    for row in range(count):
        free[row], forced[row] = half[:2, :2] @ to_begin, half[:2, :2] @ by_begin
        forced[row, :, row] += half[:2, 2]
        to_begin, by_begin = whole[:2, :2] @ to_begin, whole[:2, :2] @ by_begin
        by_begin[:, row] += whole[:2, 2]
    return free, forced


@numba.njit(cache=True, error_model='numpy')
def _pass_on(times, points, t, interval, per_torque, state, target):
    """Write the target (TARGET,) at time t and hand over what sets in or stops since t - interval.

    What is handed over is the torque of the very point at which feedforward sets in or stops.
    """
    had, has = False, False
    interpolate(times, points, t, 0.0, target)
    for joint in range(4):
        had = had or state[FEEDFORWARD, joint] != 0.0
        has = has or target[8 + joint] != 0.0
    if has and not had:
        row = np.searchsorted(times, t - interval, side='right')
        while row < times.shape[0] - 1 and not math.isfinite(points[row, 12]):
            row += 1
        first = target.copy()
        first[8:12] = points[row, 12:16]
        hand_over(first, state, per_torque, interval)
    elif had and not has:
        row = np.searchsorted(times, t, side='right') - 1
        while row > 0 and times[row] > t - interval and not math.isfinite(points[row, 12]):
            row -= 1
        if math.isfinite(points[row, 12]):
            state[FEEDFORWARD] = points[row, 12:16]
    hand_over(target, state, per_torque, interval)


@numba.njit(cache=True, error_model='numpy')
def predict(gains, geometry, bodies, state, times, points, start, interval, errors, plan,
            torques, inertias, speeds, poses, pulls):
    """Write what the law does with planned corrections in the middle of each interval.

    Args:
        gains, geometry, bodies, state: of the law.
        times, points: of the ReferenceQueue.
        start: time of the beginning of the horizon, s.
        interval: s.
        errors: of the joints and their rates there (count, 2, 4), rad, rad/s.
        plan: corrections of the intervals (count, 4), rad/s2.
        torques: commands (count, 4), N m, written.
        inertias: what the model says of the joints' (count, 4, 4), kg m2, written.
        speeds: of the joints (count, 4), rad/s, written.
        poses: (count, 4), written.
        pulls: derivative of the pose by the joint positions, (count, 4, 4), written.

    Returns:
        Whether the mechanism closes everywhere.
    """
    target, ahead = np.empty(TARGET), state.copy()
    per_torque = 1.0 if gains[2] > 0.0 else 0.0
    # of the reference, as planned, and that with a unit of acceleration more on each joint
    motions, found = np.empty((6, 3, 4)), np.empty((6, 4))
    directions, pose = np.empty((2, 4)), np.empty((1, 4))
    pose[0] = np.array(HOME)
    for row in range(errors.shape[0]):
        _pass_on(times, points, start + (row + 0.5) * interval, interval, per_torque,
                 ahead, target)
        for joint in range(4):
            left, speed = errors[row, 0, joint], errors[row, 1, joint]
            motions[0, 0, joint], motions[0, 1, joint] = target[joint], target[4 + joint]
            motions[0, 2, joint] = target[12 + joint]
            motions[1:, 0, joint] = target[joint] - left
            motions[1:, 1, joint] = target[4 + joint] - speed
            motions[1:, 2, joint] = (target[12 + joint] + gains[0] * speed + gains[1] * left
                                     + plan[row, joint])
            motions[2 + joint, 2, joint] += 1.0
            speeds[row, joint] = motions[1, 1, joint]
        for part in range(6):
            if not torque_of_joints_sample(geometry, bodies, motions[part], found[part]):
                return False
        for column in range(4):
            inertias[row, :, column] = found[2 + column] - found[1]
        for joint in range(4):
            torques[row, joint] = (target[8 + joint] + ahead[INTEGRAL, joint]
                                   + ahead[CARRIED, joint] + found[1, joint] - found[0, joint])
            directions[0, joint] = math.cos(motions[1, 0, joint])
            directions[1, joint] = math.sin(motions[1, 0, joint])
        if forward_sample(geometry, directions[:1], directions[1:], 0, pose) < 0:
            return False
        poses[row] = pose[0]
        reaches, inverse = closed_legs(geometry, pose[0, 0], pose[0, 1], pose[0, 2],
                                       math.cos(pose[0, 3]), math.sin(pose[0, 3]))
        for column in range(4):
            unit = (1.0 if column == 0 else 0.0, 1.0 if column == 1 else 0.0,
                    1.0 if column == 2 else 0.0, 1.0 if column == 3 else 0.0)
            pull = platform_speed(geometry, reaches, inverse, unit)
            for axis in range(4):
                pulls[row, axis, column] = pull[axis]
    return True
