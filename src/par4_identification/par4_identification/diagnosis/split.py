"""Which readings of which logs are fitted, and which are held out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.logs.log import Log
from par4_identification.logs.stretches import parted, seconds_of, spread_over
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.finer import parts_of_sample
from par4_identification.signals.plateaus import every_third_between
from par4_identification.signals.rows import runs_of_logs
from par4_identification.signals.run import Run
from par4_kinematics.robot import Axis, Robot

MOST = 480_000
"""Samples of torque that are fitted: two minutes of four joints at 1 kHz. Of more, stretches are
looked at, so that time and memory end; what the model gets wrong limits a long log anyway."""


def manageable(fit_logs: Sequence[Log], holdout_logs: Sequence[Log], machine: Robot | Axis,
               conditioning: Conditioning) -> tuple[Sequence[Log], Sequence[Log], float]:
    """Return the logs to fit and those held out, and the share of all readings that these have.

    Each of the two has some `MOST` samples at the most, those among them that are put between the
    samples of a slow axis: of longer logs only stretches are taken, spread over them. Of steady
    speeds all is taken, as it gives few rows.
    """
    def samples(part: Sequence[Log]) -> int:
        return sum(log.tau.size * parts_of_sample(log, machine) for log in part)

    logs = [*fit_logs, *holdout_logs]
    if conditioning.steady or samples(fit_logs) <= MOST >= samples(holdout_logs):
        return fit_logs, holdout_logs, 1.0
    if not holdout_logs:
        fit_logs, holdout_logs = ((fit_logs[:-1], fit_logs[-1:]) if len(fit_logs) > 1 else
                                  ([part] for part in parted(fit_logs[0], 2.0 / 3.0)))
    fitted, held = (
        spread_over(part, seconds_of(part) * MOST * share / samples(part))
        for part, share in ((fit_logs, 1.0), (holdout_logs, 0.5)))
    used = sum(log.tau.size for log in (*fitted, *held))
    return fitted, held, used / sum(log.tau.size for log in logs)


def split_runs(fit_logs: Sequence[Log], holdout_logs: Sequence[Log], machine: Robot | Axis,
               conditioning: Conditioning) -> tuple[list[Run], list[Run]]:
    """Return the rows to fit and those held out.

    Without held-out logs the last log is held out, of a single log the last third of the rows in
    which it moves. That is cut at the gap or standstill within a sixth of them that comes nearest,
    if there is one. Of steady speeds every third is held out.
    """
    fit_runs = runs_of_logs(fit_logs, machine, conditioning)
    if holdout_logs:
        return fit_runs, runs_of_logs(holdout_logs, machine, conditioning)
    if conditioning.steady:
        run, = fit_runs
        kept = every_third_between(run.speed[:, 0])
        return [run.part(~kept)], [run.part(kept)]
    if len(fit_logs) > 1:
        last = fit_logs[-1].name
        return ([run for run in fit_runs if run.name != last],
                [run for run in fit_runs if run.name == last])
    ends = np.cumsum([len(run.t) for run in fit_runs])
    moving = np.concatenate([run.valid.any(axis=1) for run in fit_runs])
    moved = np.concatenate(((0,), np.cumsum(moving if moving.any() else ~moving)))
    resting = np.flatnonzero(np.concatenate([run.standstill.all(axis=1) for run in fit_runs]))
    places = np.concatenate((ends[:-1], resting))
    share = moved[places] / moved[-1]
    places = places[(share > 1 / 2) & (share < 5 / 6)]
    wanted = 2 * moved[-1] // 3
    cut = int(np.searchsorted(moved, wanted))
    if len(places):
        cut = int(places[np.argmin(np.abs(moved[places] - wanted))])
    cuts = [min(max(cut - int(end) + len(run.t), 0), len(run.t))
            for end, run in zip(ends, fit_runs)]
    return ([run.part(slice(0, at)) for run, at in zip(fit_runs, cuts) if at],
            [run.part(slice(at, len(run.t))) for run, at in zip(fit_runs, cuts)
             if at < len(run.t)])
