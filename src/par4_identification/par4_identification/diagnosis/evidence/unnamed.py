"""Unnamed causes: functions of the motion with free coefficients, sorted into kinds.

A torque that no effect of the library explains still acts like something: a force on the platform,
a function of speed, friction that changes with time. A kind is such a family of functions. It is
searched, accepted and tested like an effect; its coefficients have no meaning but a weak prior.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from par4_dynamics.effects.cogging import highest_order, lowest_order, order_step
from par4_dynamics.effects.position_torque import goes_on_turning
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence import kind_functions as functions
from par4_identification.diagnosis.evidence.kind import FunctionKind
from par4_identification.diagnosis.evidence.kind_functions import (
    Function,
    Periods,
    PlatformRanges,
    Ranges,
)
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.signals.run import Run

CELLS = 32
"""Of the shortest period, into which positions are sorted: their waves are right to 0.2 %."""


KINDS = (
    FunctionKind('position', 'a smooth function of joint position', functions.position),
    FunctionKind('speed', 'a function of joint speed', functions.speed, told_by_speeds=True),
    FunctionKind('time', 'a drift over time', functions.time),
    FunctionKind('acceleration', 'a function of joint acceleration', functions.acceleration),
    FunctionKind('platform', 'a function of the pose and motion of the platform',
                 functions.platform, needs_platform=True),
    FunctionKind('periodic', 'a periodic function of joint position', functions.periodic),
    FunctionKind('torque', 'the torque itself times a periodic function of joint position',
                 functions.torque, needs_nominal=True),
    FunctionKind('rate',
                 'the rate of the torque, as of one read at another time or through a low pass',
                 functions.rate, needs_nominal=True, left_by_filters=True),
    FunctionKind('reading', 'an error of the joint positions as they are read', functions.reading,
                 shared=True, needs_platform=True, needs_nominal=True),
    FunctionKind('load', 'a share of the torque itself', functions.load, needs_nominal=True),
    FunctionKind('wrench', 'a force on the platform that follows its position and speed',
                 functions.wrench, shared=True, needs_platform=True),
    FunctionKind('imbalance', 'a mass of the tool beside its axis', functions.imbalance,
                 shared=True, needs_platform=True),
    FunctionKind('gain', 'a share of the torque itself that changes with time, speed or torque',
                 functions.gain, needs_nominal=True),
    FunctionKind('coupling', 'a share of the torque of other joints', functions.coupling,
                 needs_platform=True, needs_nominal=True),
    FunctionKind('pose', 'friction that changes with the pose of the platform', functions.pose,
                 needs_platform=True),
    FunctionKind('creep', 'a spring that creeps', functions.creep),
    FunctionKind('drift', 'friction that changes with time', functions.drift),
    FunctionKind('place', 'friction that changes with joint position', functions.place),
    FunctionKind('uneven', 'friction that is periodic in joint position', functions.uneven),
    FunctionKind('memory', 'friction that remembers the way the joint came', functions.memory))


class Kinds:
    """The kinds that a machine can have, scaled to its motion.

    A kind is the same object as long as its periods are, so that its columns are made once.

    Args:
        observations: the rows to fit.

    Attributes:
        ranges: scales of the motion, without periods.
    """

    def __init__(self, observations: Observations) -> None:
        self.ranges = ranges_of(observations)
        self._made: dict[tuple[str, Periods], FunctionKind] = {}

    def beside(self, observations: Observations, left: Sequence[np.ndarray],
               highest: int | None = None) -> tuple[FunctionKind, ...]:
        """Return the kinds beside causes that are known.

        Args:
            observations: the rows to fit.
            left: what the known causes leave of them, (m, J) of each run, N m; its strongest
                periods are those of the periodic kinds.
            highest: order up to which periods are looked for; None for the highest that a periodic
                torque of the machine may have.
        """
        low, high = self.ranges.q
        highest = highest or highest_order(observations.runs[0].state, self.ranges.step)
        weights: dict[Function, Callable[[Run], np.ndarray]] = {
            functions.periodic: lambda run: np.ones_like(run.q),
            functions.torque: lambda run: run.rows(run.state.delivered),
            functions.uneven: lambda run: np.sign(run.speed)}
        periods = {function: _strongest_periods(observations, [
            weight(run) * part for run, part in zip(observations.runs, left)], high - low,
            highest, self.ranges.step) for function, weight in weights.items()}
        wound = not any(goes_on_turning(run.state) for run in observations.runs)
        return tuple(self._kind(kind, periods.get(kind.function, ())) for kind in KINDS
                     if (self.ranges.platform is not None or not kind.needs_platform)
                     and (kind.told_by_speeds or not observations.steady)
                     and (wound or kind.function is not functions.creep))

    def _kind(self, kind: FunctionKind, periods: Periods) -> FunctionKind:
        key = kind.name, periods
        if key not in self._made:
            self._made[key] = replace(kind, ranges=replace(self.ranges, periods=periods))
        return self._made[key]


def ranges_of(observations: Observations) -> Ranges:
    """Return the scales of fit data, without periods."""
    states = [run.state for run in observations.runs]

    def largest(name: str) -> np.ndarray:
        return np.maximum(np.max([np.abs(getattr(state, name)).max(axis=0) for state in states],
                                 axis=0), 1e-9)

    def span(name: str) -> tuple[np.ndarray, np.ndarray]:
        return (np.min([getattr(state, name).min(axis=0) for state in states], axis=0),
                np.max([getattr(state, name).max(axis=0) for state in states], axis=0))

    platform = states[0].x is not None
    low, high = span('q')
    squares = np.concatenate([state.delivered ** 2 for state in states])
    return Ranges(
        (low, high), largest('qd'), largest('qdd'), np.sqrt(squares.mean(axis=0)) + 1e-9,
        float(max(state.t[-1] for state in states)),
        PlatformRanges(span('x'), largest('xd'), largest('xdd'), _equal_forces(states))
        if platform else None, step=order_step(states[0].slides, float(np.max(high - low))))


def _equal_forces(states: Sequence[State]) -> np.ndarray:
    """Return the size (4,) of forces and of a moment that take joint torques of 1 N m (rms)."""
    torques = np.concatenate([np.stack([state.torque_of_force(axis) for axis in np.eye(4)])
                              for state in states], axis=1)
    return 1.0 / np.maximum(np.sqrt(np.mean(torques ** 2, axis=(1, 2))), 1e-9)


def _strongest_periods(observations: Observations, left: Sequence[np.ndarray], span: np.ndarray,
                       highest: int, step: float) -> Periods:
    state = observations.runs[0].state
    chosen = []
    for joint in range(observations.joints):
        q = np.concatenate([run.q[:, joint] for run in observations.runs])
        residual = np.concatenate([np.where(run.valid[:, joint], part[:, joint], 0.0)
                                   for run, part in zip(observations.runs, left)])
        power = _powers(step * q, residual, highest)
        power[:lowest_order(state, float(span[joint]))] = 0.0
        chosen.append(tuple(int(period) for period in np.argsort(-power)[:4]))
    return tuple(chosen)


def _powers(q: np.ndarray, values: np.ndarray, highest: int) -> np.ndarray:
    """Return |sum_n values_n exp(i k q_n)|, nearly, for k = 0 .. `highest`, of (n,) each."""
    count = scipy.fft.next_fast_len(CELLS * highest, real=True)
    cells = np.floor(q * (count / (2.0 * np.pi))).astype(int) % count
    return np.asarray(np.abs(np.fft.rfft(np.bincount(cells, values, count))[:highest + 1]))
