"""The simulation confronted: a stretch of a log run through the plant, the model before and after.

The drives of the robot file follow the `reference` of the log, so that torque and motion can be
compared. Where the log has none, or where these drives are not those of the machine, they follow
the measured motion, helped by the feedforward of the model that is simulated; then the torque
alone means something.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_identification.confrontation.closed_loop import (
    closed_loop,
    targets_at,
    torque_along,
)
from par4_identification.confrontation.followed import (
    SETTLING,
    followed_of,
    stretch_of,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.progress import Progress, silent
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_identification.diagnosis.verdict.floor import noise_floor, torque_noise
from par4_identification.fitting.realisable import realisable
from par4_identification.fitting.simulated import with_ideal_encoders
from par4_identification.logs.log import Log, Reference
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.geometry import LEGS
from par4_kinematics.robot import Axis, Robot

LENGTH = 6.0
"""Seconds of the log that are simulated."""
STRAY = 0.05
"""Share of the motion by which simulated drives may miss what they follow."""

Followed = Literal['reference', 'measured motion']


@dataclass(frozen=True)
class Differences:
    """Rms (J,) of what differs with the model before and after, and what a perfect model leaves."""

    baseline: np.ndarray
    extended: np.ndarray
    floor: np.ndarray


@dataclass(frozen=True)
class Confrontation:
    """What the plant does along a measured motion with two models, beside the measurement.

    Attributes:
        log: name of the bag.
        start, end: of what counts, on the clock of the log, s.
        fidelity: of the plant.
        followed: 'reference' or 'measured motion'.
        why: why the reference was not followed; empty if it was.
        drives_unlike: True where there is a reference that the drives of the robot file do not
            explain.
        same: True where there is one model only.
        t: of the rows, s, (m,).
        valid: where the joints move, in the measurement and both simulations, (m, J).
        measured, baseline, extended: torque, filtered alike, (m, J), N m.
        torque: simulated minus measured over valid rows, N m.
        deviations: from the reference: measured, with the model before, after, (m, J) rad each;
            None where the measured motion was followed.
        motion: simulated minus measured positions, rad; None likewise.
        tracking: of the `exact` machine with the extended model: deviation from what is followed
            with feedforward from the model before and after, (J,) rad each; None for one model.
    """

    log: str
    start: float
    end: float
    fidelity: str
    followed: Followed
    why: str
    drives_unlike: bool
    same: bool
    t: np.ndarray
    valid: np.ndarray
    measured: np.ndarray
    baseline: np.ndarray
    extended: np.ndarray
    torque: Differences
    deviations: tuple[np.ndarray, np.ndarray, np.ndarray] | None
    motion: Differences | None
    tracking: tuple[np.ndarray, np.ndarray] | None


@dataclass(frozen=True)
class Unsimulated:
    """Why the simulation could not be confronted; one sentence without its full stop."""

    reason: str


def confront_diagnosis(diagnosis: Diagnosis, machine: Robot | Axis, logs: Sequence[Log],
                       fidelity: str = 'fast', length: float = LENGTH,
                       progress: Progress = silent) -> Confrontation | Unsimulated | None:
    """Return what the plant says of a diagnosis on data held out; None without plant or model.

    Args:
        diagnosis: with the model before and after.
        machine: a single axis has no plant.
        logs: that were diagnosed.
        fidelity, length, progress: see `confront`.
    """
    if not isinstance(machine, Robot):
        return None
    rows = {run.name: 0 for run in diagnosis.holdout.runs}
    for run in diagnosis.holdout.runs:
        rows[run.name] += int(run.valid.sum())
    name = max(rows, key=rows.__getitem__)
    log = next(log for log in logs if log.name == name)
    times = np.concatenate([run.t[run.valid.any(axis=1)] for run in diagnosis.holdout.runs
                            if run.name == name])
    try:
        return confront(machine, model_before(diagnosis), model_after(diagnosis), log,
                        (float(times.min()) - SETTLING, float(times.max())), fidelity, length,
                        progress, diagnosis.holdout.runs[0].conditioning)
    except Par4Error as error:
        return Unsimulated(str(error))


def model_after(diagnosis: Diagnosis) -> ModelFile:
    """Return the extended model as a machine can have it."""
    return realisable(diagnosis.extended_model, diagnosis.effects)


def model_before(diagnosis: Diagnosis) -> ModelFile:
    """Return the model without the causes, base parameters refitted, as a machine can have it."""
    return realisable(diagnosis.refitted_model, diagnosis.effects)


def confront(robot: Robot, baseline: ModelFile, extended: ModelFile, log: Log,
             within: tuple[float, float] = (-np.inf, np.inf), fidelity: str = 'fast',
             length: float = LENGTH, progress: Progress = silent,
             conditioning: Conditioning = CONDITIONING) -> Confrontation:
    """Return the differences between a log and the plant with the model before and after.

    The stretch begins where the machine is slow and is the one in which the torques of the two
    models differ most, by their own word and not by the measured torque; with one model the one
    with the fastest motion.

    Args:
        robot: geometry, bodies, drives.
        baseline, extended: the machine without and with what was found.
        log: measured.
        within: on the clock of the log, s.
        fidelity: of the plant.
        length: s at most.
        progress: called with the name of each step.
        conditioning: of the torques that are compared.

    Raises:
        InputError: no stretch that is long enough, drives that cannot follow, a model that no
            machine can have, a motion beyond the robot's limits.
        UnreachableError: a simulated machine leaves its workspace.
    """
    before, after = build_model(robot, baseline), build_model(robot, extended)
    same = baseline.effects == extended.effects and baseline.parameters == extended.parameters
    part = stretch_of(log, robot, None if same else (before, after), within, length, conditioning)
    measured, = runs_of_log(part, robot, conditioning)
    course = followed_of(log.reference, part, measured, robot, after.limit_of_drives(robot))
    path, late, why = course.path, course.late, course.why_not
    # the counts of the encoders are in a measured motion already
    followers = with_ideal_encoders(robot) if why else robot

    def simulated(model: Model, name: str) -> tuple[np.ndarray, np.ndarray]:
        own = replace(path, effort=torque_along(robot, model, path)) if why else path
        return closed_loop(followers, model, own, part.t, fidelity, late,
                            lambda share: progress(f'simulating the {name}: {share:.0%}'))

    new = simulated(after, 'extended model' if not same else 'model')
    old = new if same else simulated(before, 'old model')
    settled = part.t >= part.t[0] + SETTLING
    wanted = targets_at(path, part.t)[:, :LEGS]
    if why:
        _refuse_stray(new[0][settled] - wanted[settled], wanted[settled])

    runs = [runs_of_log(replace(part, q=q, tau=tau), robot, conditioning)[0] for q, tau in
            (old, new)]
    rows = measured.t >= part.t[0] + SETTLING
    valid = (measured.valid & runs[0].valid & runs[1].valid)[rows]
    if not valid.any():
        raise InputError(f'{log.name}: no joint moves for long enough to compare torques; give a '
                         f'bag of a livelier motion')
    torques = [run.tau[rows] for run in (measured, *runs)]
    noise = (noise_floor([measured], after.without_effects()) if why else
             np.hypot(torque_noise([measured]), torque_noise(runs[1:])))
    deviations = motion = None
    if not why:
        deviations = (part.q[settled] - wanted[settled], old[0][settled] - wanted[settled],
                      new[0][settled] - wanted[settled])
        motion = _differences_of_motion(*deviations, robot.drives.encoder_counts)
    followed = None
    if not same:
        with_old, with_new = tracking(robot, after, (before, after), path, part.t, progress)
        followed = with_old, with_new
    return Confrontation(
        log=log.name, start=float(part.t[0]) + SETTLING, end=float(part.t[-1]), fidelity=fidelity,
        followed='measured motion' if why else 'reference', why=why,
        drives_unlike=course.drives_unlike, same=same,
        t=measured.t[rows], valid=valid, measured=torques[0], baseline=torques[1],
        extended=torques[2], torque=Differences(_rms(torques[1] - torques[0], valid),
                                                _rms(torques[2] - torques[0], valid), noise),
        deviations=deviations, motion=motion, tracking=followed)


def tracking(robot: Robot, machine: Model, feedforward: Sequence[Model], path: Reference,
             t: np.ndarray, progress: Progress = silent) -> tuple[np.ndarray, ...]:
    """Return the rms deviations (J,), rad, of a machine from a path, with each feedforward.

    Args:
        robot: geometry, drives.
        machine: as it truly is.
        feedforward: models that the drives get their torque from.
        path: to follow.
        t: times at which the deviation counts but for the settling, (n,) s on its clock.
        progress: called with the name of each step.
    """
    progress('feedforward on the simulated machine')
    settled = t >= t[0] + SETTLING
    wanted = targets_at(path, t)[settled, :LEGS]
    return tuple(_rms(closed_loop(robot, machine, replace(
        path, effort=torque_along(robot, model, path)), t, 'exact')[0][settled] - wanted)
        for model in feedforward)


def _differences_of_motion(measured: np.ndarray, old: np.ndarray, new: np.ndarray, counts: int
                           ) -> Differences:
    """Return by how much two motions differ from the measured one, rad, each (m, J).

    `counts` are those of the encoders a turn, 0 where they are not known. Both positions are
    rounded to counts, each with a variance of step^2 / 12.
    """
    rounding = np.full(LEGS, 2.0 * np.pi / counts / np.sqrt(6.0) if counts else 0.0)
    return Differences(_rms(old - measured), _rms(new - measured), rounding)


def _refuse_stray(deviation: np.ndarray, wanted: np.ndarray) -> None:
    """Raise where the drives do not follow: then torques compare two different motions."""
    stray, way = (float(np.sqrt(np.mean((values - values.mean(axis=0)) ** 2)))
                  for values in (deviation, wanted))
    if stray > STRAY * way:
        raise InputError(f'the simulated drives cannot follow the measured motion, they miss it by '
                         f'{stray:.2g} rad rms of {way:.2g} rad; give the gains and limits of the '
                         f'machine in drives of the robot file')


def _rms(values: np.ndarray, valid: np.ndarray | None = None) -> np.ndarray:
    """Return the rms (J,) of values (m, J) over valid rows; NaN where there is none."""
    kept = np.ones(values.shape, dtype=bool) if valid is None else valid
    with np.errstate(invalid='ignore'):
        return np.sqrt((np.where(kept, values, 0.0) ** 2).sum(axis=0) / kept.sum(axis=0))
