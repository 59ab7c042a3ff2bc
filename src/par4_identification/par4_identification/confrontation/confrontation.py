"""The simulation confronted: a stretch of a log run through the plant, the model before and after.

The drives of the robot file follow the `reference` of the log, so that torque and motion can be
compared. Where the log has none, or where these drives are not those of the machine, they follow
the measured motion, helped by the feedforward of the model that is simulated; then the torque
alone means something.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.model import FRICTION, Model, build_model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.state import state_of_joints
from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.progress import Progress, silent
from par4_identification.diagnosis.verdict.answer import Diagnosis
from par4_identification.diagnosis.verdict.floor import noise_floor, torque_noise
from par4_identification.fitting.realisable import realisable
from par4_identification.logs.log import Log, Reference
from par4_identification.signals.filtering import central_difference
from par4_identification.signals.rows import Run, runs_of_log
from par4_kinematics.approach import with_approach
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.geometry import LEGS
from par4_kinematics.motion import motion_of_joints
from par4_kinematics.robot import Axis, Robot
from par4_sim.drive import DriveLoops
from par4_sim.reference import COLUMNS, TARGET, interpolate
from par4_sim.simulation import build_simulation

LENGTH = 6.0
"""Seconds of the log that are simulated."""
SHORTEST = 2.0
"""Seconds below which a stretch says too little."""
PERIOD = 1e-3
"""s, of the simulated samples."""
BLEND = 0.5
"""Seconds from rest to the speed at which a stretch begins."""
SETTLING = 0.7
"""Seconds at the beginning of a stretch that do not count: the integrals of the drives settle."""
CALM = 0.05
"""rad/s; a stretch begins below this where the motion offers it."""
UNLIKE = 0.2
"""Share of the torque of the feedback that drives may leave unexplained."""
STRAY = 0.05
"""Share of the motion by which simulated drives may miss what they follow."""

LATEST = 1e-3
"""Seconds by which a record of torque and the speeds that drives read may be late."""
UNEXPLAINED = 'from the reference the drives of the robot file would ask for another torque'

Followed = Literal['reference', 'measured motion']


@dataclass(frozen=True)
class Errors:
    """Rms (J,) of a difference with the model before and after, and what a perfect model leaves.
    """

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
    same: bool
    t: np.ndarray
    valid: np.ndarray
    measured: np.ndarray
    baseline: np.ndarray
    extended: np.ndarray
    torque: Errors
    deviations: tuple[np.ndarray, np.ndarray, np.ndarray] | None
    motion: Errors | None
    tracking: tuple[np.ndarray, np.ndarray] | None


    @property
    def drives_unlike(self) -> bool:
        """True where there is a reference that the drives of the robot file do not explain."""
        return self.why.startswith(UNEXPLAINED)


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
                        progress)
    except Par4Error as error:
        return Unsimulated(str(error))


def model_after(diagnosis: Diagnosis) -> ModelFile:
    """Return the extended model as a machine can have it."""
    return realisable(diagnosis.extended_model)


def model_before(diagnosis: Diagnosis) -> ModelFile:
    """Return the model without the causes: base parameters refitted, as the extended one else."""
    extended = model_after(diagnosis)
    lowest = {term.name: 0.0 if term.nonnegative else -np.inf for term in BASE_TERMS}
    return extended.model_copy(update={
        'parameters': {name: parameter.model_copy(update={
            'value': max(parameter.value, lowest[name])})
            for name, parameter in diagnosis.base_before.items()},
        'effects': extended.effects[:len(extended.effects) - len(diagnosis.causes)]})


def confront(robot: Robot, baseline: ModelFile, extended: ModelFile, log: Log,
             within: tuple[float, float] = (-np.inf, np.inf), fidelity: str = 'fast',
             length: float = LENGTH, progress: Progress = silent) -> Confrontation:
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

    Raises:
        InputError: no stretch that is long enough, drives that cannot follow, a model that no
            machine can have, a motion beyond the robot's limits.
        UnreachableError: a simulated machine leaves its workspace.
    """
    before, after = build_model(robot, baseline), build_model(robot, extended)
    same = baseline.effects == extended.effects and baseline.parameters == extended.parameters
    part = _stretch(log, robot, None if same else (before, after), within, length)
    measured, = runs_of_log(part, robot, CONDITIONING)
    limit = extended.torque_limit or robot.drives.torque_limit
    path, late, why = _path(log.reference, part, measured, robot, limit)
    # the counts of the encoders are in a measured motion already
    followers = _with_ideal_encoders(robot) if why else robot

    def simulated(model: Model, name: str) -> tuple[np.ndarray, np.ndarray]:
        own = replace(path, effort=_torque(robot, model, path)) if why else path
        return _closed_loop(followers, model, own, part.t, fidelity, late,
                            lambda share: progress(f'simulating the {name}: {share:.0%}'))

    new = simulated(after, 'extended model' if not same else 'model')
    old = new if same else simulated(before, 'old model')
    settled = part.t >= part.t[0] + SETTLING
    wanted = _positions(path, part.t)[:, :LEGS]
    if why:
        _refuse_stray(new[0][settled] - wanted[settled], wanted[settled])

    runs = [runs_of_log(replace(part, q=q, tau=tau), robot, CONDITIONING)[0] for q, tau in
            (old, new)]
    rows = measured.t >= part.t[0] + SETTLING
    valid = (measured.valid & runs[0].valid & runs[1].valid)[rows]
    if not valid.any():
        raise InputError(f'{log.name}: no joint moves for long enough to compare torques; give a '
                         f'bag of a livelier motion')
    torques = [run.tau[rows] for run in (measured, *runs)]
    noise = (noise_floor([measured], robot, after.without_effects()) if why else
             np.hypot(torque_noise([measured]), torque_noise(runs[1:])))
    deviations = motion = None
    if not why:
        deviations = tuple(q[settled] - wanted[settled] for q in (part.q, old[0], new[0]))
        counts = robot.drives.encoder_counts
        # both positions are rounded to counts, each with a variance of step^2 / 12
        rounding = np.full(LEGS, 2.0 * np.pi / counts / np.sqrt(6.0) if counts else 0.0)
        motion = Errors(*(_rms(q - deviations[0]) for q in deviations[1:]), rounding)
    return Confrontation(
        log=log.name, start=float(part.t[0]) + SETTLING, end=float(part.t[-1]), fidelity=fidelity,
        followed='measured motion' if why else 'reference', why=why, same=same,
        t=measured.t[rows], valid=valid, measured=torques[0], baseline=torques[1],
        extended=torques[2], torque=Errors(*(_rms(values - torques[0], valid)
                                             for values in torques[1:]), noise),
        deviations=deviations, motion=motion,
        tracking=None if same else tracking(robot, after, (before, after), path, part.t, progress))


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
    wanted = _positions(path, t)[settled, :LEGS]
    return tuple(_rms(_closed_loop(robot, machine, replace(
        path, effort=_torque(robot, model, path)), t, 'exact')[0][settled] - wanted)
        for model in feedforward)


# which stretch, and what is followed


def _stretch(log: Log, robot: Robot, models: tuple[Model, Model] | None,
             within: tuple[float, float], length: float) -> Log:
    """Return the part of a log that is simulated."""
    low, high = within
    if log.reference is not None and log.reference.t[0] < min(high, log.t[-1]) - SHORTEST:
        low = max(low, float(log.reference.t[0]))
    best, chosen = -1.0, None
    for run in runs_of_log(log, robot, CONDITIONING):
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


def _path(reference: Reference | None, part: Log, measured: Run, robot: Robot, limit: float
          ) -> tuple[Reference, float, str]:
    """Return what the drives follow, how late they read speeds, s, and why not the reference."""
    if reference is None:
        return _measured_path(measured), 0.0, 'the bag has no reference'
    rows = slice(max(0, int(np.searchsorted(reference.t, part.t[0] + 1e-9)) - 1),
                 int(np.searchsorted(reference.t, part.t[-1])) + 1)
    path = Reference(*(getattr(reference, name)[rows] for name in ('t', 'q', 'qd', 'qdd')),
                     None if reference.effort is None else reference.effort[rows])
    if (len(path.t) < 2 or path.t[0] > part.t[0] + part.period
            or not all(np.isfinite(values).all() for values in (path.q, path.qd, path.qdd))):
        return (_measured_path(measured), 0.0,
                'its reference lacks points, velocities or accelerations')
    left, feedback, late = _left_by_drives(path, part, measured, robot, limit)
    noise = float(np.sqrt(np.mean(measured.noise_floor ** 2)))
    if left > max(UNLIKE * feedback, 3.0 * noise):
        return _measured_path(measured), 0.0, (
            f'{UNEXPLAINED} than the bag holds ({left:.2g} N m rms apart, of {feedback:.2g} N m): '
            f'the machine has other drives, or a feedforward that the bag lacks')
    return path, late, ''


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
    targets = _positions(path, part.t)
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


def _with_ideal_encoders(robot: Robot) -> Robot:
    return robot.model_copy(update={
        'drives': robot.drives.model_copy(update={'encoder_counts': 0})})


def _refuse_stray(deviation: np.ndarray, wanted: np.ndarray) -> None:
    """Raise where the drives do not follow: then torques compare two different motions."""
    stray, way = (float(np.sqrt(np.mean((values - values.mean(axis=0)) ** 2)))
                  for values in (deviation, wanted))
    if stray > STRAY * way:
        raise InputError(f'the simulated drives cannot follow the measured motion, they miss it by '
                         f'{stray:.2g} rad rms of {way:.2g} rad; give the gains and limits of the '
                         f'machine in drives of the robot file')


# the closed loop


def _closed_loop(robot: Robot, model: Model, path: Reference, t: np.ndarray, fidelity: str,
                 late: float = 0.0, progress: Callable[[float], None] | None = None
                 ) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and recorded torques (n, 4) of a machine along a path at times t (n,), s.

    The machine approaches the first point from home, and its drives settle. They read speeds
    `late` seconds late, whatever those of the plant are.
    """
    from scipy.interpolate import CubicSpline  # slow to load and only needed here

    still = np.zeros((2, LEGS))
    rest = motion_of_joints('the stretch', robot.geometry, np.array((0.0, PERIOD)),
                            np.repeat(path.q[:1], 2, axis=0), still, still)
    home = build_simulation(robot, model, 'exact', PERIOD)
    approach = with_approach(rest, robot, home.q)
    there = home.time + approach.duration + BLEND
    home.close()
    # a whole number of samples, so that samples of an even log fall on simulated ones
    shift = PERIOD * np.ceil((there - path.t[0]) / PERIOD)
    simulation = build_simulation(robot, _warmed(model, -shift), fidelity, PERIOD)
    try:
        simulation.queue_reference(simulation.time + approach.t, approach.q, approach.qd,
                                   approach.qdd)
        simulation.queue_reference(shift + path.t, path.q, path.qd, path.qdd)
        # a speed read by d too late lets the drives ask for velocity_gain d qdd more; the plant's
        # are late by -velocity_offset
        late += simulation.plant.velocity_offset
        simulation.queue_effort(shift + path.t, _known_effort(path)
                                + late * robot.drives.velocity_gain * path.qdd)
        count = int(np.ceil((shift + t[-1] - simulation.time) / PERIOD)) + 2
        told = simulation.time - shift + PERIOD * np.arange(count)
        q, tau = np.empty((2, count, LEGS))
        for row in range(count):
            sample = simulation.next_sample()
            q[row], tau[row] = sample.q, sample.effort
            if progress and row % 200 == 0:
                progress(row / count)
    finally:
        simulation.close()
    return CubicSpline(told, q)(t), CubicSpline(told, tau)(t)


def _warmed(model: Model, begin: float) -> Model:
    """Return the model for a clock that begins `begin` seconds after that of the log.

    Only friction that drifts knows the time. With a the drop of a friction and T the time constant,
    1 - a (1 - exp(-(t + b) / T)) = c (1 - a' (1 - exp(-t / T))), c = 1 - a (1 - exp(-b / T)),
    a' = a exp(-b / T) / c. What went before the log by more than T is taken as T.
    """
    for index, active in enumerate(model.effects):
        if active.effect.name == 'friction_drift':
            left = np.exp(np.minimum(-begin / active.values['time_constant'], 1.0))
            base, warmed = dict(model.values), dict(active.values)
            for friction, drop in zip(FRICTION, ('drop', 'viscous_drop')):
                scale = 1.0 - active.values[drop] * (1.0 - left)
                base[friction] = scale * base[friction]
                warmed[drop] = active.values[drop] * left / scale
            effects = list(model.effects)
            effects[index] = replace(active, values=warmed)
            return replace(model, effects=tuple(effects), values=base)
    return model


def _torque(robot: Robot, model: Model, path: Reference) -> np.ndarray:
    """Return the feedforward torque (m, 4), N m, of a model along a path."""
    return model.torque(state_of_joints(robot.geometry, path.t, path.q, path.qd, path.qdd))


def _positions(path: Reference, t: np.ndarray) -> np.ndarray:
    """Return the targets (n, TARGET) of a path at times t (n,), as the drives see them."""
    points = np.zeros((len(path.t), COLUMNS))
    points[:] = np.concatenate((path.q, path.qd, path.qdd, _known_effort(path)), axis=1)
    targets = np.empty((len(t), TARGET))
    for row, time in enumerate(t):
        interpolate(path.t, points, time, 0.0, targets[row])
    return targets


def _known_effort(path: Reference) -> np.ndarray:
    """Return the feedforward torque (m, 4), N m, of a path; what is missing counts as zero."""
    return np.zeros_like(path.q) if path.effort is None else np.nan_to_num(path.effort)


def _rms(values: np.ndarray, valid: np.ndarray | None = None) -> np.ndarray:
    """Return the rms (J,) of values (m, J) over valid rows; NaN where there is none."""
    kept = np.ones(values.shape, dtype=bool) if valid is None else valid
    with np.errstate(invalid='ignore'):
        return np.sqrt((np.where(kept, values, 0.0) ** 2).sum(axis=0) / kept.sum(axis=0))
