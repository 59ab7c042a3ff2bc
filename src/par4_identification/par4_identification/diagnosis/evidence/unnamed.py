"""Unnamed causes: functions of the motion with free coefficients, sorted into kinds.

A torque that no effect of the library explains still acts like something: a force on the platform,
a function of speed, friction that changes with time. A kind is such a family of functions. It is
searched, accepted and tested like an effect; its coefficients have no meaning but a weak prior.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numba
import numpy as np
import scipy
from numpy.polynomial.legendre import legvander

from par4_dynamics.effects.cogging import HIGHEST_PERIODS, lowest_order
from par4_dynamics.effects.effect import Shape
from par4_dynamics.effects.position_torque import WIDEST
from par4_dynamics.effects.rest import fading_sign
from par4_dynamics.effects.shifted import shift_columns
from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.observations import Observations

PRIOR_ROWS = 3.0
"""Weight of the prior, zero, of a coefficient whose column has the size 1: as that many rows."""
PERIODS = np.arange(1, HIGHEST_PERIODS + 1)
SLIPS = np.geomspace(1e-3, 0.5, 9)
"""rad: deflections at which the springs of friction with a memory slip."""
RELAXATIONS = (0.1, 0.4, 1.6, 6.4)
"""s: times in which the force of a spring that creeps dies away."""
READING_DEGREE = 3
"""Of the polynomial of a joint's position by which its reading may be wrong."""
Periods = tuple[tuple[int, ...], ...]
"""Periods a turn, of each joint."""


@dataclass(frozen=True)
class PlatformRanges:
    """Scales of the platform's motion in the fitted data, (4,) each.

    Attributes:
        x: lowest and highest pose.
        xd, xdd: largest speed and acceleration.
        force: forces, N, and moment, N m, each of which takes joint torques of 1 N m (rms).
    """

    x: tuple[np.ndarray, np.ndarray]
    xd: np.ndarray
    xdd: np.ndarray
    force: np.ndarray

    def place(self, x: np.ndarray) -> np.ndarray:
        """Return poses (n, 4) in -1 .. 1 of the fitted ones."""
        low, high = self.x
        return 2.0 * (x - low) / np.maximum(high - low, 1e-12) - 1.0


@dataclass(frozen=True)
class Ranges:
    """Scales and periods of the fitted data, which make a kind the same function on others."""

    q: tuple[np.ndarray, np.ndarray]
    qd: np.ndarray
    qdd: np.ndarray
    end: float
    platform: PlatformRanges | None
    periods: Periods = ()

    @property
    def of_platform(self) -> PlatformRanges:
        """The scales of the platform.

        Raises:
            TypeError: the machine has none.
        """
        if self.platform is None:
            raise TypeError('an axis has no platform')
        return self.platform


def splines(values: np.ndarray, low: np.ndarray, high: np.ndarray, count: int) -> np.ndarray:
    """Return cubic B-splines (n, J, count) of values (n, J) over low .. high (J,)."""
    unit = np.clip((values - low) / np.maximum(high - low, 1e-12), 0.0, 1.0)
    knots = np.concatenate(([0.0] * 3, np.linspace(0.0, 1.0, count - 2), [1.0] * 3))
    flat = scipy.interpolate.BSpline.design_matrix(
        np.minimum(unit.ravel(), 1.0 - 1e-12), knots, 3).toarray()
    return flat.reshape(*values.shape, count)


def _position(state: State, ranges: Ranges) -> np.ndarray:
    return splines(state.q, *ranges.q, 10)


def _speed(state: State, ranges: Ranges) -> np.ndarray:
    sign = np.sign(state.qd)
    if state.geometry is None:  # of an axis, whose speeds may be any, and whose ways may differ
        decays = [np.exp(-(state.qd / (share * ranges.qd)) ** 2) for share in (0.01, 0.03, 0.1)]
        slow = [decay * part for decay in decays for part in (sign, np.ones_like(sign))]
    else:
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
    motion, scales = state.platform, ranges.of_platform
    place, speed, acceleration = (
        scales.place(motion.x), motion.xd / scales.xd, motion.xdd / scales.xdd)
    parts = [place, speed, acceleration]
    parts += [acceleration * place[:, [axis]] for axis in range(4)]
    parts += [speed * speed[:, [axis]] for axis in range(4)]
    features = np.concatenate(parts, axis=1)
    return np.broadcast_to(features[:, None, :], (*state.q.shape, features.shape[1]))


def _waves(state: State, periods: Periods) -> np.ndarray:
    angle = np.array(periods, dtype=float) * state.q[..., None]  # (n, J, k)
    return np.concatenate((np.sin(angle), np.cos(angle)), axis=-1)


def _periodic(state: State, ranges: Ranges) -> np.ndarray:
    return _waves(state, ranges.periods)


def _torque(state: State, ranges: Ranges) -> np.ndarray:
    return state.known.delivered[..., None] * _waves(state, ranges.periods)


def _rate(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    # The second rate would do, too, but the noise of encoder counts in it is that of the torque.
    return time_rate(state, state.known.delivered)[..., None]


def _reading(state: State, ranges: Ranges) -> np.ndarray:
    low, high = ranges.q
    unit = 2.0 * (state.q - low) / np.maximum(high - low, 1e-12) - 1.0
    errors = legvander(unit, READING_DEGREE)  # (n, J, k) of each joint's own position
    return np.concatenate([shift_columns(state, errors[..., degree])
                           for degree in range(READING_DEGREE + 1)], axis=-1)


def _load(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    delivered = state.known.delivered
    return np.stack((delivered, np.abs(delivered) * np.sign(state.qd)), axis=-1)


def _wrench(state: State, ranges: Ranges) -> np.ndarray:
    motion, scales = state.platform, ranges.of_platform
    place, speed = scales.place(motion.x), motion.xd / scales.xd
    side = np.concatenate((np.sign(speed[:, :3]), fading_sign(motion.xd[:, 3:])), axis=1)
    forces = scales.force * np.stack(
        (np.ones_like(place), place, side, speed, np.abs(speed) * speed))
    return np.stack([state.torque_of_force(axis * force)
                     for axis in np.eye(4) for force in forces], axis=-1)


def _place(state: State, ranges: Ranges) -> np.ndarray:
    return splines(state.q, *ranges.q, 20) * np.sign(state.qd)[..., None]


def _memory(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    return elastic_slip(np.ascontiguousarray(state.q), SLIPS)


@numba.njit(cache=True, error_model='numpy')
def elastic_slip(q, slips):
    """Return springs that follow q (n, J) and slip at a deflection, (n, J, k), over that.

    Prandtl's stop operators: their sums make any friction with a memory of the way it came
    (Maxwell slip, Dahl, Bouc and Wen).
    """
    share = np.zeros((*q.shape, len(slips)))
    for row in range(1, q.shape[0]):
        for joint in range(q.shape[1]):
            step = q[row, joint] - q[row - 1, joint]
            for k in range(len(slips)):
                moved = share[row - 1, joint, k] + step / slips[k]
                share[row, joint, k] = min(max(moved, -1.0), 1.0)
    return share


def _pose(state: State, ranges: Ranges) -> np.ndarray:
    place = ranges.of_platform.place(state.platform.x)
    features = np.concatenate((np.ones_like(place[:, :1]), place, place ** 2), axis=1)
    return features[:, None, :] * np.sign(state.qd)[..., None]


def _creep(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    """A spring at rest anywhere, and others whose forces die away with `RELAXATIONS`."""
    start = state.q[0]
    period = (state.t[-1] - state.t[0]) / max(len(state.t) - 1, 1)
    columns = [np.ones_like(state.q), state.q - start]
    for time in RELAXATIONS:
        moved = state.q - start
        columns.append(moved - _crept(moved, np.exp(-period / time)))
    return np.stack(columns, axis=-1)


@numba.njit(cache=True, error_model='numpy')
def _crept(moved, kept):
    """Return where the dampers of springs in series come that are moved (n, J).

    From sample to sample they keep this share of their distance. `scipy.signal` has this filter,
    too, but takes a second to load.
    """
    crept = np.empty_like(moved)
    crept[0] = (1.0 - kept) * moved[0]
    for row in range(1, len(moved)):
        crept[row] = (1.0 - kept) * moved[row] + kept * crept[row - 1]
    return crept


def _gain(state: State, ranges: Ranges) -> np.ndarray:
    torque = state.known.delivered
    level = np.sqrt(np.mean(torque ** 2, axis=0)) + 1e-9
    drifts = _time(state, ranges) * torque[..., None]
    bent = [np.tanh(torque / (share * level)) for share in (0.03, 0.1, 0.3)]
    bent += [torque * np.abs(torque) / level, torque * np.abs(state.qd) / ranges.qd]
    return np.concatenate((drifts, np.stack(bent, axis=-1)), axis=-1)


def _coupling(state: State, ranges: Ranges) -> np.ndarray:  # noqa: ARG001
    torque = state.known.delivered
    return np.stack([np.delete(torque, joint, axis=1) for joint in range(state.joints)], axis=1)


def _drift(state: State, ranges: Ranges) -> np.ndarray:
    return _time(state, ranges) * np.sign(state.qd)[..., None]


Function = Callable[[State, Ranges], np.ndarray]
"""Columns (n, J, k) of a motion at these scales."""


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of unnamed cause: a sum of columns with free coefficients.

    It stands where an effect stands in a hypothesis, with an empty shape.

    Attributes:
        name: of the kind, as `diagnosis.json` and tests know it.
        phrase: what it acts like, in words.
        function: its columns (n, J, k) of a motion, N m per unit coefficient.
        ranges: scales that make it the same function on other data.
        shared: whether a column has one coefficient on all joints.
        needs_platform: whether only machines with a platform can have it.
        needs_nominal: whether its columns need the nominal torque.
        told_by_speeds: whether it is a function of the joint's speed alone, so that mean torques at
            steady speeds can tell it.
        left_by_filters: whether sampling and filters leave some of it in every record, so that it
            counts only where it explains most of what is left.
    """

    name: str
    phrase: str
    function: Function
    ranges: Ranges | None = None
    shared: bool = False
    separable: ClassVar[Periods] = ()
    needs_platform: bool = False
    needs_nominal: bool = False
    left_by_filters: bool = False
    told_by_speeds: bool = False

    def parts(self, shape: Shape) -> tuple[Shape, ...]:
        """Return the shape as the only part: a kind has no others."""
        return (shape,)

    def prior(self, squares: np.ndarray, rows: float) -> np.ndarray:
        """Return the weight of the prior, zero, of each coefficient: squares of a row of its own.

        It is that of `PRIOR_ROWS` rows in which a column has its usual size, or that of the
        columns on the average where it is larger: a column that the motion hardly visits must not
        be free to be anything where other motions go.

        Args:
            squares: of the whitened columns, (k,), (g, k) where g joints have their own.
            rows: on which they are.
        """
        return PRIOR_ROWS / max(rows, 1.0) * np.maximum(squares, squares.mean())

    def columns(self, state: State, shape: Shape) -> np.ndarray:  # noqa: ARG002
        """Return its columns (n, J, k).

        Raises:
            TypeError: it has not been scaled to a motion.
        """
        if self.ranges is None:
            raise TypeError(f'the kind {self.name} has not been scaled to a motion')
        return np.ascontiguousarray(self.function(state, self.ranges))


KINDS = (
    Kind('position', 'a smooth function of joint position', _position),
    Kind('speed', 'a function of joint speed', _speed, told_by_speeds=True),
    Kind('time', 'a drift over time', _time),
    Kind('acceleration', 'a function of joint acceleration', _acceleration),
    Kind('platform', 'a function of the pose and motion of the platform', _platform,
         needs_platform=True),
    Kind('periodic', 'a periodic function of joint position', _periodic),
    Kind('torque', 'the torque itself times a periodic function of joint position', _torque,
         needs_nominal=True),
    Kind('rate', 'the rate of the torque, as of one read at another time', _rate,
         needs_nominal=True, left_by_filters=True),
    Kind('reading', 'an error of the joint positions as they are read', _reading, shared=True,
         needs_platform=True, needs_nominal=True),
    Kind('load', 'a share of the torque itself', _load, needs_nominal=True),
    Kind('wrench', 'a force on the platform that follows its position and speed', _wrench,
         shared=True, needs_platform=True),
    Kind('gain', 'a share of the torque itself that changes with time, speed or torque', _gain,
         needs_nominal=True),
    Kind('coupling', 'a share of the torque of other joints', _coupling, needs_platform=True,
         needs_nominal=True),
    Kind('pose', 'friction that changes with the pose of the platform', _pose,
         needs_platform=True),
    Kind('creep', 'a spring that creeps', _creep),
    Kind('drift', 'friction that changes with time', _drift),
    Kind('place', 'friction that changes with joint position', _place),
    Kind('memory', 'friction that remembers the way the joint came', _memory))


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
        self._made: dict[tuple[str, Periods], Kind] = {}

    def beside(self, observations: Observations, left: Sequence[np.ndarray]) -> tuple[Kind, ...]:
        """Return the kinds beside causes that are known.

        Args:
            observations: the rows to fit.
            left: what the known causes leave of them, (m, J) of each run, N m; its strongest
                periods are those of the periodic kinds.
        """
        low, high = self.ranges.q
        load = [run.rows(run.state.known.delivered) * part
                for run, part in zip(observations.runs, left)]
        periods: dict[Function, Periods] = {
            _periodic: _strongest_periods(observations, left, high - low),
            _torque: _strongest_periods(observations, load, high - low)}
        wound = np.max(high - low) <= WIDEST  # no spring goes on turning
        return tuple(self._kind(kind, periods.get(kind.function, ())) for kind in KINDS
                     if (self.ranges.platform is not None or not kind.needs_platform)
                     and (kind.told_by_speeds or not observations.steady)
                     and (wound or kind.function is not _creep))

    def _kind(self, kind: Kind, periods: Periods) -> Kind:
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
    return Ranges(
        span('q'), largest('qd'), largest('qdd'), float(max(state.t[-1] for state in states)),
        PlatformRanges(span('x'), largest('xd'), largest('xdd'), _equal_forces(states))
        if platform else None)


def _equal_forces(states: Sequence[State]) -> np.ndarray:
    """Return the size (4,) of forces and of a moment that take joint torques of 1 N m (rms)."""
    torques = np.concatenate([np.stack([state.torque_of_force(axis) for axis in np.eye(4)])
                              for state in states], axis=1)
    return 1.0 / np.maximum(np.sqrt(np.mean(torques ** 2, axis=(1, 2))), 1e-9)


def _strongest_periods(observations: Observations, left: Sequence[np.ndarray], span: np.ndarray
                       ) -> Periods:
    chosen = []
    for joint in range(observations.joints):
        q = np.concatenate([run.q[:, joint] for run in observations.runs])
        residual = np.concatenate([np.where(run.valid[:, joint], part[:, joint], 0.0)
                                   for run, part in zip(observations.runs, left)])
        power = _powers(np.exp(1j * q), residual, PERIODS[0], len(PERIODS))
        lowest = lowest_order(observations.runs[0].state, float(span[joint]))
        power[lowest > PERIODS] = 0.0
        chosen.append(tuple(int(period) for period in PERIODS[np.argsort(-power)[:4]]))
    return tuple(chosen)


@numba.njit(cache=True, error_model='numpy')
def _powers(phasor, values, first, count):
    """Return |sum_n values_n phasor_n^k| for k = first, first + 1, ... (count,)."""
    total = np.zeros(count, np.complex128)
    for row in range(len(values)):
        power = values[row] * phasor[row] ** first
        for k in range(count):
            total[k] += power
            power *= phasor[row]
    return np.abs(total)
