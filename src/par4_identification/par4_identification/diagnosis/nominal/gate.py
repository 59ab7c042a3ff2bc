"""The data gate: decides whether data can carry a diagnosis, before any model is blamed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from par4_dynamics.base_terms import FRICTION, INERTIA
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.estimators.quadratic import quadratic_columns
from par4_identification.fitting.identification import OTHER_JOINTS, Identification
from par4_identification.signals.plateaus import LEAST_PLATEAUS
from par4_identification.signals.run import Run
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot

LEAST_ROWS = 200
"""Rows in motion, of each joint of a Par4, below which there are too few."""
LEAST_ROWS_OF_AXIS = 60
"""The same of an axis: it has fewer base parameters."""
SPEED = 0.5
"""rad/s at which the friction of a Par4 must brake."""
TORN = 10
"""Stretches of the logs from which on gaps are named as a reason for too few rows."""
SLOW = 0.004
"""s from sample to sample from which filters are so slow that this may be the reason."""
STANDS, AT_MOST = 0.5, 0.05
"""Share of the samples in which a joint is slower than this part of its fastest, from which on it
is said to stand still."""
SIGNS = f'the sign of torque and position, and {OTHER_JOINTS}'
"""What to check about an axis."""
FAST_SHARE, CERTAIN = 0.95, 5.0
"""Share of the motion that is slower than the speed at which friction must brake, too, and standard
deviations below zero from which a value is negative."""
WORST_ERROR = 0.6
"""Share of the torque (rms) that the rigid bodies leave, beyond which something basic is wrong."""
WORST_STD = 0.3
"""Deviation of a value, over the value, beyond which a motion does not tell it."""


class Reason(NamedTuple):
    """Why data cannot carry a diagnosis.

    Attributes:
        text: with what to do.
        is_of_cause: whether a strong cause may be the reason, to be found beside the bodies.
    """

    text: str
    is_of_cause: bool = False


def is_vague(value: float, std: float) -> bool:
    """Return whether a motion does not tell a value with this standard deviation."""
    return std > WORST_STD * abs(value)


def unusable(observations: Observations, identification: Identification, machine: Robot | Axis,
             target: Sequence[np.ndarray] | None = None) -> list[Reason]:
    """Return why the data cannot carry a diagnosis; empty if they can.

    Args:
        observations: rows to fit.
        identification: their base parameters.
        machine: that was recorded.
        target: what these were fitted to, (m, J) of each run, where that is less than the torque
            because the rest is known to be bound to the position.
    """
    reasons = [Reason(text) for text in too_few(observations)]
    alone = isinstance(machine, Axis)
    estimate = identification.estimate
    values = {term.name: (value, std) for term, value, std in
              zip(identification.terms, estimate.values, estimate.std)}
    friction = values['coulomb_friction'][0] + _usual_speed(observations) * values[
        'viscous_friction'][0]
    if friction < 0:
        reasons.append(Reason(
            f'friction comes out driving the joint instead of braking it; check {SIGNS}' if alone
            else 'friction comes out driving the joints instead of braking them; check the sign of '
                 'torque and position', is_of_cause=True))
    bound = target is not None
    error = _error_beside(observations, identification) if bound else estimate.relative_error
    if error > WORST_ERROR and (bound or _error_in_motion(observations) > WORST_ERROR):
        share = f'explain only {1 - error:.0%} of the torque'
        reasons.append(Reason(
            f'inertia, friction and weight {share}; check gravity in the robot file, {SIGNS}, and '
            f'whether a soft belt or a loose coupling lets the load move by itself' if alone else
            f'the rigid bodies {share}; check order, sign and zero of the joints, the gains and '
            f'the robot file'))
    for term in identification.terms:
        # a lag of the drives can turn the slope of friction over; together it must brake, see above
        friction_term = term.name in FRICTION
        value, std = values[term.name]
        if term.nonnegative and not friction_term and value < -CERTAIN * std:
            reasons.append(Reason(
                f'{term.name} comes out as {value:.3g} {unit_on(machine, term.unit)}; check '
                f'{SIGNS if alone else "order and sign of the joints"}'))
        if term.name == INERTIA and is_vague(value, std):
            reasons.append(Reason(f'the motion does not excite {term.name} (standard deviation '
                                  f'{std / max(abs(value), 1e-12):.0%}); record faster motions',
                                  is_of_cause=True))
    return reasons


def driving_when_fast(base: Mapping[str, Parameter], runs: Sequence[Run]) -> str | None:
    """Return why data of an axis are no use if its friction drives at its higher speeds, else None.

    A controller of the speed raises the torque where the joint slows down. Where little else moves
    it, as at a steady speed with cogging, torque and speed tell the controller and not the machine.

    Args:
        base: base parameters beside the causes found, of which none is a law of the speed.
        runs: that were fitted.
    """
    speeds = np.concatenate([np.abs(run.speed[run.valid]) for run in runs])
    fast = float(np.quantile(speeds, FAST_SHARE)) if len(speeds) else 0.0
    level, std = 0.0, 0.0
    for name, by in zip(FRICTION, (1.0, fast)):
        level += by * float(np.max(np.asarray(base[name].value, dtype=float)))
        std = float(np.hypot(std, by * np.max(np.asarray(base[name].std or 0.0, dtype=float))))
    if level >= -CERTAIN * std:
        return None
    return (f'friction comes out driving the joint at its higher speeds, as where a controller '
            f'answers a speed that something else disturbs; record a motion that goes faster and '
            f'slower, and check {SIGNS}')


def _usual_speed(observations: Observations) -> float:
    """Return the speed at which friction must brake, rad/s or m/s: of an axis that of its motion.

    At speeds that it does not have, Coulomb and viscous friction may stand for each other.
    """
    if not observations.of_axis:
        return SPEED
    return float(np.median(np.concatenate(
        [np.abs(run.speed[run.valid]) for run in observations.runs]))) if any(
            run.valid.any() for run in observations.runs) else SPEED


def too_few(observations: Observations) -> list[str]:
    """Return for which joints there are fewer rows than any fit needs, and what to do."""
    rows = sum(run.valid.sum(axis=0) for run in observations.runs)
    if observations.steady:
        return [f'{count} steady speeds are fitted, {LEAST_PLATEAUS} are needed; record more '
                f'speeds, in both directions' for count in rows if count < LEAST_PLATEAUS]
    least = LEAST_ROWS_OF_AXIS if observations.of_axis else LEAST_ROWS
    stretches = len(observations.runs)
    torn = f', without the gaps that part it into {stretches} stretches' if stretches > TORN else ''
    run = observations.runs[0]
    slow = '' if run.period < SLOW else (
        f', or faster: in a log of {1.0 / run.period:.3g} Hz rows within '
        f'{run.conditioning.reach:.2g} s of a reversal do not count')
    whose = '' if observations.of_axis else ' of all joints'
    return [f'joint {joint} moves in only {rows[joint]} rows, {least} are needed'
            f'{_standing(observations, joint)}; record a longer motion{whose}{torn}{slow}'
            for joint in np.flatnonzero(rows < least).tolist()]


def _standing(observations: Observations, joint: int) -> str:
    """Return the words on a joint that stands still most of the time, as one that sticks does."""
    speed = np.concatenate([np.abs(run.state.qd[:, joint]) for run in observations.runs])
    share = float(np.mean(speed <= AT_MOST * speed.max()))
    return '' if share < STANDS else (
        f' (it stands still in {share:.0%} of the time: a pause, or does it stick?)')


def _error_beside(observations: Observations, identification: Identification) -> float:
    """Return what base terms and a torque bound to the position leave, over all torque."""
    rows = sum(int(run.valid.sum()) for run in observations.runs)
    power = sum(float(np.sum(np.where(run.valid, target, 0.0) ** 2))
                for run, target in zip(observations.runs, observations.target))
    left = float(np.sqrt(np.mean(identification.estimate.rms ** 2)))
    return left / max(np.sqrt(power / max(rows, 1)), 1e-30)


def _error_in_motion(observations: Observations) -> float:
    """Return the relative error of the base terms where no load of the pose alone counts.

    What a quadratic function of the joint positions explains is taken out of torque and columns: a
    strong spring is a cause to be named, not a reason to doubt the bodies.
    """
    target, base = [], []
    for joint in range(observations.joints):
        valid = [run.valid[:, joint] for run in observations.runs]
        static = np.concatenate([quadratic_columns(run.q)[rows]
                                 for run, rows in zip(observations.runs, valid)])
        both = np.concatenate([
            np.column_stack((tau[rows, joint], columns[rows, joint]))
            for tau, columns, rows in zip(observations.target, observations.base, valid)])
        basis = np.linalg.qr(static)[0]
        both = both - basis @ (basis.T @ both)
        target.append(both[:, 0])
        base.append(both[:, 1:])
    tau, columns = np.concatenate(target), np.concatenate(base)
    size = max(float(np.linalg.norm(tau)), 1e-30)
    left = tau - columns @ np.linalg.lstsq(columns, tau, rcond=None)[0]
    return float(np.linalg.norm(left)) / size
