"""What each tool could do with a log: a verdict in one sentence, by the tool's own criteria."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.diagnosis.evidence.observations import observe
from par4_identification.diagnosis.nominal.start import start_of
from par4_identification.diagnosis.search.rules import rules_for
from par4_identification.fitting.identification import (
    Identification,
    identify,
    singular_refused,
)
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.identification import (
    LARGEST_CONDITION,
    LARGEST_STD,
    WORST_CONDITION,
    relative_deviations,
)
from par4_identification.setup_check.finding import SetupCheck
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.plateaus import LEAST_PLATEAUS
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.run import Run
from par4_identification.signals.scales import conditioning_for
from par4_identification.trend.bag_values import EARLIEST, without_date
from par4_identification.trend.drift import MOVING
from par4_identification.trend.windows import LEARNING, WINDOW
from par4_kinematics.errors import Par4Error
from par4_kinematics.robot import Axis
from par4_sim.report.words import in_words, percent

Use = Literal['yes', 'weakly', 'no']
TOOLS = ('identify', 'validate', 'diagnose', 'trend', 'monitor')


@dataclass(frozen=True)
class Fitness:
    """What a tool could do with a bag.

    Attributes:
        tool: one of `TOOLS`.
        use: whether it would do its work.
        reason: a sentence.
    """

    tool: str
    use: Use
    reason: str


@dataclass(frozen=True)
class JointTravel:
    """How a joint moves.

    Attributes:
        name: of the joint.
        travel: from its lowest to its highest position, rad, of a linear axis m.
        peak_speed: rad/s, m/s.
        seconds: for which it moves fast enough to tell its friction.
    """

    name: str
    travel: float
    peak_speed: float
    seconds: float


def joint_motions(runs: Sequence[Run], joints: Sequence[str]) -> tuple[JointTravel, ...]:
    """Return how each joint moves in the rows of a log."""
    q, speed = (np.concatenate([getattr(run, name) for run in runs]) for name in ('q', 'speed'))
    seconds = sum(run.valid.sum(axis=0) * run.row_time for run in runs)
    return tuple(JointTravel(*row) for row in zip(
        joints, np.ptp(q, axis=0).tolist(), np.abs(speed).max(axis=0).tolist(),
        np.asarray(seconds).tolist(), strict=True))


def unfit(reason: str) -> tuple[Fitness, ...]:
    """Return that no tool can use a bag, for one reason."""
    return tuple(Fitness(tool, 'no', reason) for tool in TOOLS)


def fitness_of(check: SetupCheck) -> tuple[tuple[Fitness, ...], tuple[Run, ...]]:
    """Return what each tool could do with the log of a setup check, and its rows."""
    if check.useless:
        return unfit(check.useless[0].sentence), ()
    log, machine = check.logs[0], check.machine
    try:
        runs = tuple(runs_of_log(log, machine, conditioning_for([log], machine, CONDITIONING)))
    except Par4Error as error:
        return unfit(str(error)), ()
    if runs[0].conditioning.steady:
        return _of_steady_speeds(runs[0]), runs
    try:
        identified = _identified(identify([log], machine, conditioning=conditioning_for(
            [log], machine, Conditioning())))
    except Par4Error as error:
        identified = Fitness('identify', 'no', str(error))
    return (identified, _validated(runs), _diagnosed(check, runs),
            _trended(log, identified), _monitored(check, runs)), runs


def _of_steady_speeds(run: Run) -> tuple[Fitness, ...]:
    """Return what the tools could do with a bag in which one speed after the other is held."""
    held = f'it holds {len(run.t)} steady speeds'
    enough = len(run.t) >= LEAST_PLATEAUS and len(set(np.sign(run.speed[:, 0]))) > 1
    use: Use = 'yes' if enough else 'no'
    reason = held if enough else (
        f'{held}, {LEAST_PLATEAUS} in both directions are needed; give all such bags together')
    return tuple(Fitness(tool, use, reason) if tool in ('identify', 'diagnose') else
                 Fitness(tool, 'no', f'{held}, which par4_identify and par4_diagnose read')
                 for tool in TOOLS)


def _identified(identification: Identification) -> Fitness:
    condition = identification.excitation
    relative = relative_deviations(identification.parameters)
    worst = max(relative, key=lambda name: relative[name])
    excited = (f'condition number {condition:.3g}; the least certain is {in_words(worst)}, to '
               f'{percent(relative[worst])}')
    if condition > WORST_CONDITION:
        return Fitness('identify', 'no', f'the motion excites the parameters too weakly: {excited}')
    if condition > LARGEST_CONDITION or relative[worst] > LARGEST_STD:
        return Fitness('identify', 'weakly', f'the motion excites the parameters weakly: {excited}')
    return Fitness('identify', 'yes', f'the motion excites all parameters: {excited}')


def _validated(runs: Sequence[Run]) -> Fitness:
    seconds = sum(run.valid.any(axis=1).sum() * run.row_time for run in runs)
    if seconds < 1.0:
        return Fitness('validate', 'no', 'the joints rest, so that only torques at rest could be '
                                         'compared; record a motion')
    return Fitness('validate', 'yes', f'{seconds:.3g} s in motion to compare a model with, if it '
                                      f'comes from another bag')


def _diagnosed(check: SetupCheck, runs: Sequence[Run]) -> Fitness:
    observations = observe(list(runs), check.machine, 'paper', None)
    try:
        with singular_refused():
            start = start_of(observations, check.machine, 'paper',
                             rules_for(isinstance(check.machine, Axis)))
        reasons = list(start.reasons or start.unless_mended)
    except Par4Error as error:
        reasons = [str(error)]
    if reasons:
        return Fitness('diagnose', 'no', reasons[0])
    return Fitness('diagnose', 'yes', 'all joints move enough; without a second bag (--holdout) '
                                      'the last third of this one judges the causes')


def _trended(log: Log, identified: Fitness) -> Fitness:
    if log.start_stamp < EARLIEST:
        return Fitness('trend', 'no', without_date(log.start_stamp))
    if identified.use != 'yes':
        return Fitness('trend', identified.use, 'it is dated, but its parameters are not certain')
    return Fitness('trend', 'yes', 'it is dated and tells all parameters; give further bags')


def _monitored(check: SetupCheck, runs: Sequence[Run]) -> Fitness:
    if isinstance(check.machine, Axis):
        return Fitness('monitor', 'no', 'it watches a Par4, not a single axis')
    windows = 0
    for run in runs:
        length = round(WINDOW / run.row_time)
        count = len(run.valid) // length
        parts = run.valid[:count * length].reshape(count, length, run.valid.shape[1])
        windows += int((parts.mean(axis=1) >= MOVING).all(axis=1).sum())
    told = (f'{windows} windows of {WINDOW:g} s in which all joints move; it learns a machine from '
            f'{LEARNING}')
    if windows == 0:
        return Fitness('monitor', 'no', f'work like this has {told}')
    return Fitness('monitor', 'yes' if windows >= LEARNING else 'weakly', told)
