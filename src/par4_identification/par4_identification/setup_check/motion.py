"""Whether the machine moves at all, and whether it passes a singular pose."""

from __future__ import annotations

import numpy as np

from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches
from par4_identification.setup_check.equations import SLOW, slow_of_axis, stretches_of
from par4_identification.setup_check.finding import Finding, SetupCheck
from par4_identification.setup_check.log_faults import joints_in_words
from par4_identification.setup_check.mending import sound_time, without
from par4_kinematics.position import closes, forward_kinematics
from par4_kinematics.robot import Robot
from par4_kinematics.velocity import condition_number
from par4_kinematics.workspace import home_pose
from par4_sim.report.words import number

LEAST_MOVING = 1.0
"""s that every joint must move faster than `SLOW`, an axis that is slower than that as a whole
faster than a share of its fast speeds."""
ILL = 12.0
"""Condition number of J_x, in that of the home pose, beyond which a pose counts as singular."""
STILL_ILL = 4.0
"""The same, from which samples on the way to a singular pose are left out."""
PROBED_HZ = 200.0
BESIDE = 0.1
"""s that are left out beyond these samples."""
MOST = 0.5
"""Share of the samples beyond which it is not the pose that is wrong."""


def moving(check: SetupCheck) -> SetupCheck:
    """Return the check with a finding if joints do not move."""
    parts = stretches_of(check.logs)
    if not parts:
        return check
    joints = parts[0].q.shape[1]
    time = np.zeros(joints)
    for part in parts:
        slow = SLOW if isinstance(check.machine, Robot) else min(SLOW, slow_of_axis(part))
        time += part.period * ((np.abs(part.qd) >= slow) & part.known).sum(axis=0)
    still = tuple(int(joint) for joint in np.flatnonzero(time < LEAST_MOVING))
    if not still:
        return check
    who = 'no joint' if len(still) == joints else joints_in_words(still)
    verb = 'moves' if len(still) == joints else ('does not move' if len(still) == 1 else
                                                 'do not move')
    return check.after([Finding(
        'not_moving', still, None,
        f'{who} {verb} for longer than {number(float(time[list(still)].max()), 2)} s in all; a '
        'resting joint tells neither its inertia nor its friction',
        'Check that the drives are on and that the motion was sent, then record a longer motion of '
        f'all joints{", as par4_excite designs it" if isinstance(check.machine, Robot) else ""}.',
        False, True)])


def passing_singular_poses(check: SetupCheck) -> SetupCheck:
    """Return the check with the stretches beside singular poses left out."""
    if not isinstance(check.machine, Robot):
        return check
    for number_of_log, log in enumerate(check.logs):
        wrong, worst = near_singular(log, check.machine)
        share = float(wrong.mean())
        if not 0.0 < share < MOST:
            continue
        mended = without(log, wrong)
        first, last = np.flatnonzero(wrong)[[0, -1]]
        passes = len(stretches(wrong))
        certain = sound_time(mended) > 0.3 * sound_time(log) and sound_time(mended) >= 2.0
        logs = list(check.logs)
        if certain:
            logs[number_of_log] = mended
        where = forward_kinematics(check.machine.geometry, log.q[worst]) if closes(
            check.machine.geometry, log.q[worst]) else None
        pose = '' if where is None else (
            f', nearest at x {where[0]:.3f}, y {where[1]:.3f}, z {where[2]:.3f} m, '
            f'theta {where[3]:.2f} rad')
        check = check.after([Finding(
            'singular_pose', tuple(range(log.q.shape[1])),
            (round(float(log.t[first]), 3), round(float(log.t[last]), 3)),
            f'{log.name} passes a singular pose {passes} time{"s" if passes > 1 else ""}{pose}, '
            f'where the joints do not hold the platform ({number(100.0 * share, 2)} % of the '
            'samples); there no torque can be calculated',
            'Keep the motion away from that pose; these stretches are left out.'
            if certain else 'Record a motion that keeps away from that pose.', certain,
            not certain)], logs)
    return check


def near_singular(log: Log, robot: Robot) -> tuple[np.ndarray, int]:
    """Return which samples (n,) are near a singular pose, and the nearest one."""
    every = max(1, round(1.0 / (PROBED_HZ * log.period)))
    probes = np.arange(0, len(log.q), every)
    closed = closes(robot.geometry, log.q[probes])
    wrong = np.zeros(len(log.q), dtype=bool)
    if closed.mean() < 1.0 - MOST:
        return wrong, 0
    condition = np.full(len(probes), np.inf)
    condition[closed] = condition_number(
        robot.geometry, forward_kinematics(robot.geometry, log.q[probes[closed]]))
    home = float(condition_number(robot.geometry, home_pose(robot)))
    ill = condition > ILL * home
    # a mechanism that does not close although no pose is ill has other faults than its poses
    if not (ill & closed).any():
        return wrong, 0
    reach = round(BESIDE / log.period)
    for first, end in stretches(condition > STILL_ILL * home):
        if ill[first:end].any():
            wrong[max(probes[first] - reach, 0):probes[end - 1] + reach + 1] = True
    finite = np.where(np.isfinite(condition), condition, 0.0)
    return wrong, int(probes[int(np.argmax(finite))])
