"""Nameless blocks: smooth functions of the motion that may explain what no named effect does."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander
from scipy.interpolate import BSpline

from par4_dynamics.effects.cogging import HIGHEST_PERIODS, LEAST_TURNS, LOWEST_PERIODS
from par4_dynamics.effects.shifted import shift_columns
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence import (
    Evidence,
    Hypothesis,
    fit_of,
    residuals,
    spread,
)
from par4_identification.diagnosis.observations import Observations

RIDGE = 3.0
"""Prior weight of a standardised nameless coefficient, in rows."""
PERIODS = np.arange(LOWEST_PERIODS, HIGHEST_PERIODS + 1)
READING_DEGREE = 3
"""Of the polynomial of a joint's position by which its reading may be wrong."""


@dataclass(frozen=True)
class Ranges:
    """Scales of the fit data that make the blocks the same functions on other data."""

    q: tuple[np.ndarray, np.ndarray]
    qd: np.ndarray
    qdd: np.ndarray
    end: float
    x: tuple[np.ndarray, np.ndarray] | None
    xd: np.ndarray | None
    xdd: np.ndarray | None
    periods: tuple[tuple[int, ...], ...]
    torque_periods: tuple[tuple[int, ...], ...]


def splines(values: np.ndarray, low: np.ndarray, high: np.ndarray, count: int) -> np.ndarray:
    """Return cubic B-splines (n, J, count) of values (n, J) over low .. high (J,)."""
    unit = np.clip((values - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
    knots = np.concatenate(([0.0] * 3, np.linspace(0.0, 1.0, count - 2), [1.0] * 3))
    flat = BSpline.design_matrix(np.minimum(unit.ravel(), 1.0 - 1e-12), knots, 3).toarray()
    return flat.reshape(*values.shape, count)


def _position(state: State, ranges: Ranges) -> np.ndarray:
    return splines(state.q, *ranges.q, 10)


def _speed(state: State, ranges: Ranges) -> np.ndarray:
    sign = np.sign(state.qd)
    slow = [np.exp(-(state.qd / speed) ** 2) * sign for speed in (0.05, 0.15, 0.5)]
    smooth = splines(np.abs(state.qd), np.zeros_like(ranges.qd), ranges.qd, 6)
    return np.concatenate((np.stack([*slow, np.ones_like(sign), np.abs(state.qd)], axis=-1),
                           smooth * sign[..., None]), axis=-1)


def _time(state: State, ranges: Ranges) -> np.ndarray:
    time = np.broadcast_to(state.t[:, None], state.q.shape)
    return splines(time, np.zeros(state.joints), np.full(state.joints, ranges.end), 6)


def _acceleration(state: State, ranges: Ranges) -> np.ndarray:
    scaled = state.qdd / ranges.qdd
    bent = [np.sin(state.q) * scaled, np.cos(state.q) * scaled, np.sign(state.qd) * np.abs(scaled),
            (state.qd / ranges.qd) ** 2 * np.cos(state.q)]
    return np.stack([scaled, np.abs(scaled), *bent], axis=-1)


def _platform(state: State, ranges: Ranges) -> np.ndarray:
    low, high = ranges.x
    place = 2.0 * (state.x - low) / np.maximum(high - low, 1e-12) - 1.0
    speed, acceleration = state.xd / ranges.xd, state.xdd / ranges.xdd
    parts = [place, speed, acceleration]
    parts += [acceleration * place[:, [axis]] for axis in range(4)]
    parts += [speed * speed[:, [axis]] for axis in range(4)]
    features = np.concatenate(parts, axis=1)
    return np.broadcast_to(features[:, None, :], (*state.q.shape, features.shape[1]))


def _waves(state: State, periods: tuple[tuple[int, ...], ...]) -> np.ndarray:
    angle = np.array(periods, dtype=float) * state.q[..., None]  # (n, J, k)
    return np.concatenate((np.sin(angle), np.cos(angle)), axis=-1)


def _periodic(state: State, ranges: Ranges) -> np.ndarray:
    return _waves(state, ranges.periods)


def _torque(state: State, ranges: Ranges) -> np.ndarray:
    return state.nominal.delivered[..., None] * _waves(state, ranges.torque_periods)


def _rate(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    # The second rate would do, too, but the noise of encoder counts in it is that of the torque.
    return time_rate(state, state.nominal.delivered)[..., None]


def _reading(state: State, ranges: Ranges) -> np.ndarray:
    low, high = ranges.q
    unit = 2.0 * (state.q - low) / np.maximum(high - low, 1e-12) - 1.0
    errors = legvander(unit, READING_DEGREE)  # (n, J, k) of each joint's own position
    return np.concatenate([shift_columns(state, errors[..., degree])
                           for degree in range(READING_DEGREE + 1)], axis=-1)


def _load(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    delivered = state.nominal.delivered
    return np.stack((delivered, np.abs(delivered) * np.sign(state.qd)), axis=-1)


def _wrench(state: State, ranges: Ranges) -> np.ndarray:
    low, high = ranges.x
    place = 2.0 * (state.x - low) / np.maximum(high - low, 1e-12) - 1.0
    speed = state.xd / ranges.xd
    forces = np.stack((np.ones_like(place), place, np.sign(speed), speed, np.abs(speed) * speed))
    return np.stack([state.torque_of_force(axis * force)
                     for axis in np.eye(4) for force in forces], axis=-1)


def _drift(state: State, ranges: Ranges) -> np.ndarray:
    return _time(state, ranges) * np.sign(state.qd)[..., None]


@dataclass(frozen=True)
class Block:
    """A nameless function: a sum of columns with free coefficients.

    Attributes:
        phrase: what it is, in words.
        columns: of a motion, (n, J, k).
        shared: whether a column has one coefficient on all joints.
        needs_platform: whether it is of machines with a platform only.
        like_filters: whether sampling and filters leave some of it, so that it counts only where it
            explains most of what is left.
    """

    phrase: str
    columns: Callable[[State, Ranges], np.ndarray]
    shared: bool = False
    needs_platform: bool = False
    like_filters: bool = False


BLOCKS = {
    'position': Block('a smooth function of joint position', _position),
    'speed': Block('a function of joint speed', _speed),
    'time': Block('a drift over time', _time),
    'acceleration': Block('a function of joint acceleration', _acceleration),
    'platform': Block('a function of the pose and motion of the platform', _platform,
                      needs_platform=True),
    'periodic': Block('a periodic function of joint position', _periodic),
    'torque': Block('the torque itself times a periodic function of joint position', _torque),
    'rate': Block('the rate of the torque, as of one read at another time', _rate,
                  like_filters=True),
    'reading': Block('an error of the joint positions as they are read', _reading, shared=True,
                     needs_platform=True),
    'load': Block('a share of the torque itself', _load),
    'wrench': Block('a force on the platform that follows its position and speed', _wrench,
                    shared=True, needs_platform=True),
    'drift': Block('friction that changes with time', _drift)}


def ranges_of(observations: Observations, left: Sequence[np.ndarray]) -> Ranges:
    """Return the scales of fit data and the periods that residuals `left` (m, J) show most."""
    states = [run.state for run in observations.runs]

    def largest(name):
        return np.maximum(np.max([np.abs(getattr(state, name)).max(axis=0) for state in states],
                                 axis=0), 1e-9)

    def span(name):
        return (np.min([getattr(state, name).min(axis=0) for state in states], axis=0),
                np.max([getattr(state, name).max(axis=0) for state in states], axis=0))

    platform = states[0].x is not None
    low, high = span('q')
    return Ranges(
        span('q'), largest('qd'), largest('qdd'), float(max(state.t[-1] for state in states)),
        span('x') if platform else None, largest('xd') if platform else None,
        largest('xdd') if platform else None,
        _strongest_periods(observations, left, high - low),
        _strongest_periods(observations, [
            run.rows(run.state.nominal.delivered) * residual
            for run, residual in zip(observations.runs, left)], high - low))


def _strongest_periods(observations: Observations, left: Sequence[np.ndarray], span: np.ndarray
                       ) -> tuple[tuple[int, ...], ...]:
    chosen = []
    for joint in range(observations.joints):
        q = np.concatenate([run.q[:, joint] for run in observations.runs])
        residual = np.concatenate([np.where(run.valid[:, joint], part[:, joint], 0.0)
                                   for run, part in zip(observations.runs, left)])
        power = np.array([abs(residual @ np.exp(1j * period * q)) for period in PERIODS])
        power[PERIODS * span[joint] < LEAST_TURNS * 2.0 * np.pi] = 0.0
        chosen.append(tuple(int(period) for period in PERIODS[np.argsort(-power)[:4]]))
    return tuple(chosen)


@dataclass(frozen=True)
class NamelessFit:
    """Residuals (m, J) on held-out runs after one nameless block and base terms.

    Attributes:
        beside: with the hypotheses, too.
        instead: without them.
    """

    beside: tuple[np.ndarray, ...]
    instead: tuple[np.ndarray, ...]


def fit_block(block: Block, evidence: Evidence, heldout: Observations,
              hypotheses: Sequence[Hypothesis], ranges: Ranges) -> NamelessFit:
    """Return what a nameless block leaves of held-out rows, beside hypotheses and instead."""
    joints = tuple(range(heldout.joints))
    fit_rows, heldout_rows = (
        tuple(run.rows(np.ascontiguousarray(block.columns(run.state, ranges)))
              for run in part.runs)
        for part in (evidence.observations, heldout))
    design = evidence.design(hypotheses)
    known, base = design.shape[1], evidence.base.shape[1]
    stacked = np.hstack([design, spread(evidence.whitener.whiten(fit_rows), joints, block.shared)])
    scale = np.maximum(np.linalg.norm(stacked, axis=0), 1e-30) / np.sqrt(len(stacked))
    stacked /= scale
    gram, moment = stacked.T @ stacked, stacked.T @ evidence.target
    index = np.arange(len(gram))
    gram[index, index] += np.where(index < known, 1e-9 * len(stacked), RIDGE)

    def left(kept: np.ndarray, beside: Sequence[Hypothesis]) -> tuple[np.ndarray, ...]:
        """Return what the kept columns leave: base terms, those of hypotheses and of the block."""
        values = np.linalg.solve(gram[np.ix_(kept, kept)], moment[kept]) / scale[kept]
        first = int(np.sum(kept < known))
        fit = fit_of(evidence, beside, values[:first], np.zeros((first, first)))
        nameless = np.broadcast_to(values[first:].reshape(1 if block.shared else len(joints), -1),
                                   (len(joints), fit_rows[0].shape[2]))
        return tuple(part - np.einsum('mjk,jk->mj', rows, nameless) for part, rows in zip(
            residuals(heldout, beside, fit), heldout_rows))

    beside = left(index, hypotheses)
    instead = left(index[(index < base) | (index >= known)], ()) if hypotheses else beside
    return NamelessFit(beside, instead)


def available_blocks(observations: Observations, hypotheses: Sequence[Hypothesis]
                     ) -> tuple[str, ...]:
    """Return the blocks that apply to this machine beside hypotheses.

    Beside an effect that reads the torque at another time its rate would be a second rate.
    """
    platform = observations.runs[0].state.x is not None
    retimed = any(item.effect.retimes for item in hypotheses)
    return tuple(name for name, block in BLOCKS.items() if (platform or not block.needs_platform)
                 and not (retimed and name == 'rate'))
