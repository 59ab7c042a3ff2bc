"""The look at setup and log before anything else: what is wrong, and the data with it mended.

The order matters: units before all that is measured in them, faults of the samples before any
model, the pace before all that is judged at speeds, the wiring before what a model says of times,
times before zeros and dimensions, the scale last.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from par4_dynamics.model import Model
from par4_identification.logs.log import Log
from par4_identification.setup_check.calibration import calibration_findings, calibration_of
from par4_identification.setup_check.equations import (
    equations_of,
    equations_or_none,
    stretches_of,
)
from par4_identification.setup_check.finding import SetupCheck
from par4_identification.setup_check.log_faults import without_log_faults
from par4_identification.setup_check.mending import slowed
from par4_identification.setup_check.motion import moving, passing_singular_poses
from par4_identification.setup_check.pace import pace_finding, pace_of
from par4_identification.setup_check.scale import scale_findings
from par4_identification.setup_check.timing import (
    on_time,
    timing_findings,
    timing_of,
    with_memory,
    with_warming,
)
from par4_identification.setup_check.units import in_si
from par4_identification.setup_check.wiring import (
    Wiring,
    believed_wiring,
    wiring_findings,
)
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import Geometry
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Remark
from par4_sim.report.words import shortened

BEYOND_DOUBT = 0.985
"""Share of the torque that a wiring explains from which nothing else need be asked."""
SOUND = 0.1
"""|residual| / |torque| in motion of what is left beside singular poses that are believed."""
NOT_CLOSED = 'the mechanism does not close with the recorded positions'
SINGULAR = 'the equations of these data are singular'
TOO_LITTLE = 'a joint hardly moves or the mechanism does not close with the recorded positions'
"""Why a step of the check cannot look."""
LOOK_AT = ('Check by hand what was not looked for, or record a longer motion of all joints within '
           'the workspace.')
Step = Callable[[SetupCheck], SetupCheck]


def check_setup(logs: Sequence[Log], machine: Robot | Axis, model: Model | None = None
                ) -> SetupCheck:
    """Return the mistakes of the setup and the faults of the logs, and the logs mended.

    Only findings whose mend is certain are mended. What cannot be looked for is remarked; behind a
    finding that makes the data useless nothing more is looked for.

    Args:
        logs: as they were read.
        machine: as the robot file has it.
        model: a model of this machine; without one a common factor of all torques hardly shows.
    """
    check = SetupCheck((), tuple(logs), machine)
    steps: tuple[tuple[str, Step], ...] = (
        ('wrong units', in_si), ('faults of the samples', without_log_faults),
        ('joints that do not move', moving), ('a wrong pace of the samples', _paced),
        ('exchanged joints and reversed signs', _wired), ('singular poses', _past_singular_poses),
        ('delays', _timed), ('wrong zeros and dimensions', _calibrated),
        ('singular poses', passing_singular_poses),
        ('a common factor of all torques', lambda check: scale_findings(check, model)))
    for mistake, step in steps:
        if check.useless:
            break
        try:
            check = step(check)
        except UnreachableError:
            check = check.remarking(not_sought(mistake, NOT_CLOSED))
        except np.linalg.LinAlgError:
            check = check.remarking(not_sought(mistake, SINGULAR))
    return check


def not_sought(mistake: str, reason: str) -> Remark:
    """Return that a mistake was not looked for, and why."""
    return Remark(False, f'Not looked for: {mistake}, because {reason}.', LOOK_AT)


def _geometry(check: SetupCheck) -> Geometry | None:
    return check.machine.geometry if isinstance(check.machine, Robot) else None


def _paced(check: SetupCheck) -> SetupCheck:
    """Return the check with logs whose samples came at another rate than stamped put right."""
    if not isinstance(check.machine, Robot):
        return check
    for number, log in enumerate(check.logs):
        pace = pace_of(stretches_of([log]), check.machine.geometry)
        if pace is not None:
            logs = list(check.logs)
            logs[number] = slowed(log, pace.factor)
            check = check.after([pace_finding(pace, log)], logs)
    return check


def _wired(check: SetupCheck) -> SetupCheck:
    """Return the check with joints and signs put right."""
    stretches, geometry = stretches_of(check.logs), _geometry(check)
    if not stretches:
        return check
    now = equations_or_none(stretches, geometry)
    wiring = believed_wiring(stretches, geometry, now)
    if wiring is None:
        return check
    logs = [rewired(log, wiring) for log in check.logs]
    after = equations_or_none(stretches_of(logs), geometry)
    if after is not None and after.explained() < BEYOND_DOUBT and _explained_otherwise(
            check) > after.explained():
        return check
    return check.after(wiring_findings(
        wiring, None if now is None else now.explained(),
        0.0 if after is None else after.explained(),
        now is not None and now.fit().physical, geometry is None), logs)


def _explained_otherwise(check: SetupCheck) -> float:
    """Return the most that any other mistake explains of the torque with the present wiring."""
    rivals = [check]
    for step in (passing_singular_poses, _timed, _calibrated):
        try:
            rivals += [step(rivals[-1])]
        except (np.linalg.LinAlgError, UnreachableError):
            continue
    rows = [equations_or_none(stretches_of(rival.logs), _geometry(rival)) for rival in rivals]
    return max((own.explained() for own in rows if own is not None), default=0.0)


def rewired(log: Log, wiring: Wiring) -> Log:
    """Return the log with each reading at its joint and with its sign."""
    q = np.asarray(wiring.positions.signs) * log.q[:, list(wiring.positions.order)]
    tau = np.asarray(wiring.torques.signs) * log.tau[:, list(wiring.torques.order)]
    doubtful = None if log.doubtful is None else np.repeat(
        log.doubtful.any(axis=1, keepdims=True), q.shape[1], axis=1)
    return replace(log, q=q, tau=tau, doubtful=doubtful)


def _past_singular_poses(check: SetupCheck) -> SetupCheck:
    """Return the check without singular poses if the rest is sound.

    Wrong zeros move the platform, and may move it into poses that it never saw; such data are
    looked at again when the zeros are right.
    """
    found = passing_singular_poses(check)
    if found is check:
        return check
    rows = equations_or_none(stretches_of(found.logs), _geometry(found))
    if rows is None or rows.fit().error > SOUND:
        return check
    with_zeros = _calibrated(check)
    elsewhere = with_zeros is not check and passing_singular_poses(with_zeros) is with_zeros
    return check if elsewhere else found


def _timed(check: SetupCheck) -> SetupCheck:
    """Return the check with every torque at the time of its positions."""
    unsought = []
    for number, log in enumerate(check.logs):
        stretches = stretches_of([log])
        rows = equations_or_none(stretches, _geometry(check))
        if rows is None:
            unsought.append(log.name)
            continue
        if rows.of_axis:
            timing = timing_of(rows, equations_of(stretches, None, columns_of=with_memory))
        else:
            timing = timing_of(equations_of(stretches, _geometry(check), columns_of=partial(
                with_warming, seconds=float(stretches[-1].t[-1]))))
        if timing is not None:
            logs = list(check.logs)
            logs[number] = on_time(log, timing)
            check = check.after(timing_findings(timing, log, log.q.shape[1]), logs)
    return check if not unsought else check.remarking(
        not_sought(f'delays in {shortened(unsought)}', TOO_LITTLE))


def _calibrated(check: SetupCheck) -> SetupCheck:
    """Return the check with large errors of zeros and dimensions mended."""
    if not isinstance(check.machine, Robot):
        return check
    stretches = stretches_of(check.logs)
    calibration = calibration_of(stretches, check.machine.geometry) if stretches else None
    if calibration is None:
        return check
    return check.after(calibration_findings(calibration, check.machine),
                       [calibration.mended(log) for log in check.logs],
                       calibration.right_robot(check.machine))
