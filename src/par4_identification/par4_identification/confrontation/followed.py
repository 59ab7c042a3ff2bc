"""Which stretch of a log is simulated, and what the drives follow in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.model import Model
from par4_identification.confrontation.closed_loop import targets_at
from par4_identification.logs.log import Log, Reference
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import central_difference
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.run import Run
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Robot
from par4_sim.drives.drive import DriveLoops

SHORTEST = 2.0
"""Seconds below which a stretch says too little."""
SETTLING = 0.7
"""Seconds at the beginning of a stretch that do not count: the integrals of the drives settle."""
CALM = 0.05
"""rad/s; a stretch begins below this where the motion offers it."""
UNLIKE = 0.2
"""Share of the torque of the feedback that drives may leave unexplained."""
LATEST = 1e-3
"""Seconds by which a record of torque and the speeds that drives read may be late."""


@dataclass(frozen=True)
class Followed:
    """What simulated drives follow.

    Attributes:
        path: the reference, or the measured motion.
        late: how late the drives read speeds, s.
        why_not: why it is not the reference; empty where it is.
        drives_unlike: whether there is a reference that the drives of the robot file do not
            explain.
    """

    path: Reference
    late: float
    why_not: str
    drives_unlike: bool = False


def stretch_of(log: Log, robot: Robot, models: tuple[Model, Model] | None,
             within: tuple[float, float], length: float, conditioning: Conditioning) -> Log:
    """Return the part of a log that is simulated."""
    low, high = within
    if log.reference is not None and log.reference.t[0] < min(high, log.t[-1]) - SHORTEST:
        low = max(low, float(log.reference.t[0]))
    best, chosen = -1.0, None
    for run in runs_of_log(log, robot, conditioning):
        state, period = run.state, log.period
        inside = np.flatnonzero((state.t >= low) & (state.t <= high))
        if min(len(inside) * period, length) < SHORTEST:
            continue
        liveliness = state.qd ** 2 if models is None else (
            models[1].torque(state) - models[0].torque(state)) ** 2
        gained = np.append(0.0, np.cumsum(liveliness.mean(axis=1)))
        samples = min(len(inside), round(length / period) + 1)
        starts = inside[:len(inside) - samples + 1:max(1, round(0.02 / period))]
        calm = np.abs(state.qd[starts]).max(axis=1)
        starts = starts[calm <= max(CALM, float(np.percentile(calm, 5.0)))]
        score = (gained[starts + samples] - gained[starts]) / samples
        if score.max() > best:
            first = int(starts[np.argmax(score)])
            best, chosen = score.max(), state.t[first:first + samples]
    if chosen is None:
        raise InputError(f'{log.name}: no uninterrupted {SHORTEST:g} s to simulate in the data '
                         f'held out; give a longer bag')
    first = int(np.searchsorted(log.t, chosen[0] - 0.5 * log.period))
    rows = slice(first, first + len(chosen))
    doubtful = None if log.doubtful is None else log.doubtful[rows]
    return replace(log, t=log.t[rows], q=log.q[rows], tau=log.tau[rows], doubtful=doubtful,
                   segments=(slice(0, len(chosen)),), reference=None)


def followed_of(reference: Reference | None, part: Log, measured: Run, robot: Robot, limit: float
              ) -> Followed:
    """Return what the drives follow: the reference, if they explain the torque by it."""
    if reference is None:
        return Followed(_measured_path(measured), 0.0, 'the bag has no reference')
    rows = slice(max(0, int(np.searchsorted(reference.t, part.t[0] + 1e-9)) - 1),
                 int(np.searchsorted(reference.t, part.t[-1])) + 1)
    path = Reference(reference.t[rows], reference.q[rows], reference.qd[rows],
                     reference.qdd[rows],
                     None if reference.effort is None else reference.effort[rows])
    if (len(path.t) < 2 or path.t[0] > part.t[0] + part.period
            or not all(np.isfinite(values).all() for values in (path.q, path.qd, path.qdd))):
        return Followed(_measured_path(measured), 0.0,
                        'its reference lacks points, velocities or accelerations')
    left, feedback, late = _left_by_drives(path, part, measured, robot, limit)
    noise = float(np.sqrt(np.mean(measured.noise_floor ** 2)))
    if left > max(UNLIKE * feedback, 3.0 * noise):
        return Followed(_measured_path(measured), 0.0, (
            f'from the reference the drives of the robot file would ask for another torque than '
            f'the bag holds ({left:.2g} N m rms apart, of {feedback:.2g} N m): the machine has '
            f'other drives, or a feedforward that the bag lacks'), drives_unlike=True)
    return Followed(path, late, '')


def _left_by_drives(path: Reference, part: Log, measured: Run, robot: Robot, limit: float
                    ) -> tuple[float, float, float]:
    """Return what the drives do not explain of the torque, the feedback's, N m rms, and a delay.

    The drives are run over the measured positions, without any model of the machine. Where their
    integrals begin is unknown, and so are, to a fraction of a sample, the times at which the
    torque was recorded and at which the drives read speeds: what is left counts without its mean
    and without what these two delays explain. The one of speeds, s, is returned.
    """
    drives = DriveLoops(robot.drives, limit, part.period)
    drives.restart(part.tau[0])
    targets = targets_at(path, part.t)
    # the error is what is differentiated: of the speed itself differences lose 0.1 % of much
    rate = central_difference(targets[:, :LEGS] - part.q, part.period)
    commands = np.array([drives.follow(target, q, target[LEGS:2 * LEGS] - slip).copy()
                         for target, q, slip in zip(targets, part.q, rate, strict=True)])
    rows = measured.t >= part.t[0] + SETTLING
    left, feedback, recorded_late, speeds_late = (
        values[rows] - values[rows].mean(axis=0) for values in (
            measured.tau - measured.rows(commands),
            measured.tau - measured.rows(targets[:, 2 * LEGS:3 * LEGS]),
            -measured.rows(central_difference(commands, part.period)),
            robot.drives.velocity_gain * measured.rows(measured.state.qdd)))
    columns = np.stack((recorded_late.ravel(), speeds_late.ravel()), axis=1)
    delays = np.linalg.lstsq(columns, left.ravel())[0].clip(-LATEST, LATEST)
    left = left.ravel() - columns @ delays
    return (float(np.sqrt(np.mean(left ** 2))), float(np.sqrt(np.mean(feedback ** 2))),
            float(delays[1]))


def _measured_path(measured: Run) -> Reference:
    """Return the measured motion, filtered as everywhere, as drives can follow it."""
    state = measured.state
    return Reference(state.t, state.q, state.qd, state.qdd)
