"""The rigid bodies' equations of logs at a coarse rate: what every hypothesis is judged by.

A mistake of the setup is a hypothesis about the samples: other columns, other signs, another time,
other zeros. Each leads to other rows W chi = tau of (22), and the one that is true leaves far less
of the torque. Rows are coarse (20 Hz of 200), so that dozens of hypotheses take a second.

What slow functions of the pose explain, a quadratic polynomial of the joint positions, is taken out
of both sides: springs, tilts and weights that (20) lacks must not decide about a plug.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from par4_dynamics.base_terms import BASE_TERMS, base_columns
from par4_dynamics.state import State, state_of_joints
from par4_identification.estimators.quadratic import quadratic_columns
from par4_identification.logs.log import Log
from par4_identification.logs.masks import near
from par4_identification.logs.stretches import spread_over
from par4_identification.signals.filtering import (
    central_difference,
    low_pass,
    reach_of,
    second_difference,
)
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import Geometry
from par4_kinematics.position import closes

POSITION_HZ, TORQUE_HZ = 80.0, 20.0
"""Low-passes of positions and of torques and columns."""
RATE_HZ = 200.0
"""Rate of the samples from which columns are computed."""
SLOW = 0.05
"""Joint speed, rad/s, below which the sign of friction is not known."""
SLOW_SHARE = 0.01
"""The same of a single axis, whose speeds may be any, over its fast ones."""
SHORTEST = 1.0
"""s; shorter stretches are left out."""
LONGEST = 600.0
"""s of logs that are looked at."""
TINY = 1e-6
"""Speed of an axis that rests, rad/s or m/s."""
FEWEST_ROWS = 50
"""Valid rows of each joint, of which fewer say nothing."""
LEAST_RATE_HZ = 50.0
"""Rate of a log below which (20) cannot be compared with it."""


@dataclass(frozen=True)
class Stretch:
    """Filtered samples of an uninterrupted stretch of a log at the coarse rate.

    Attributes:
        log: number of the log.
        period: s.
        t: s since the start of the log, (n,).
        q, qd, qdd: joints, (n, J).
        tau: filtered torque, (n, J), N m.
        known: whether samples are no fault of the log, (n, J).
        cutoff_hz: of the torque.
    """

    log: int
    period: float
    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    tau: np.ndarray
    known: np.ndarray
    cutoff_hz: float

    def rewired(self, order: Sequence[int], signs: Sequence[float]) -> Stretch:
        """Return the stretch in which joint i is what was read as joint order[i], times a sign."""
        places, turns = list(order), np.asarray(signs)
        return replace(self, q=turns * self.q[:, places], qd=turns * self.qd[:, places],
                       qdd=turns * self.qdd[:, places])

    def thinned(self, every: int) -> Stretch:
        """Return every so manieth sample."""
        arrays = {name: getattr(self, name)[::every]
                  for name in ('t', 'q', 'qd', 'qdd', 'tau', 'known')}
        return replace(self, period=every * self.period, **arrays)


def stretches_of(logs: Sequence[Log]) -> list[Stretch]:
    """Return the stretches of logs that are long and fast enough; none is no error.

    Of logs longer than `LONGEST` in all, stretches are taken that are spread over them: a mistake
    of the setup is in all of them, and dozens of hypotheses about an hour need too much memory.
    """
    found = []
    for number, log in enumerate(spread_over(logs, LONGEST)):
        rate = 1.0 / log.period
        if rate < LEAST_RATE_HZ:
            continue
        scale = min(1.0, rate / (2.5 * POSITION_HZ))
        every = max(1, round(rate / RATE_HZ))
        for segment in log.segments:
            if (segment.stop - segment.start) * log.period < SHORTEST:
                continue
            q = low_pass(log.q[segment], scale * POSITION_HZ, log.period)
            reach = round(reach_of(scale * TORQUE_HZ * log.period))
            known = np.ones_like(q, dtype=bool)
            if log.doubtful is not None:
                known = ~near(log.doubtful[segment], reach)
            known[:reach] = known[len(known) - reach:] = False  # filters know nothing beyond
            tau = low_pass(log.tau[segment], 2.0 * scale * TORQUE_HZ, log.period)
            found.append(Stretch(
                number, log.period, log.t[segment], q, central_difference(q, log.period),
                second_difference(q, log.period), tau, known, scale * TORQUE_HZ).thinned(every))
    return found


def closing(stretch: Stretch, geometry: Geometry) -> Stretch:
    """Return the stretch in which samples that no pose closes stand where the last one before does.

    They are marked as unknown. Zeros that are far off open the mechanism at the ends of its reach;
    the rest of the samples tells them.
    """
    closed = closes(geometry, stretch.q)
    if closed.all() or not closed.any():
        return stretch
    rows = np.maximum.accumulate(np.where(closed, np.arange(len(closed)), 0))
    rows = np.where(closed[rows], rows, int(np.argmax(closed)))
    q = stretch.q[rows]
    reach = round(reach_of(stretch.cutoff_hz * stretch.period))
    open_too = near(np.repeat(~closed[:, None], q.shape[1], axis=1), reach)
    return replace(stretch, q=q, known=stretch.known & ~open_too)


@dataclass(frozen=True)
class Equations:
    """Rows of (22) of several stretches.

    Attributes:
        log: number of the log of each row, (m,).
        t: s, (m,).
        q: (m, J) rad.
        columns: W, (m, J, p).
        tau: (m, J) N m, filtered like the columns.
        valid: rows of a joint that count, (m, J).
    """

    log: np.ndarray
    t: np.ndarray
    q: np.ndarray
    columns: np.ndarray
    tau: np.ndarray
    valid: np.ndarray

    @property
    def of_axis(self) -> bool:
        """Whether they are those of a single axis, which has no platform."""
        return self.columns.shape[2] < len(BASE_TERMS)

    @cached_property
    def slack(self) -> tuple[np.ndarray, ...]:
        """Orthonormal functions of the pose over the valid rows of each joint, (m_i, k)."""
        shape = quadratic_columns(self.q)
        return tuple(np.linalg.qr(shape[rows])[0] for rows in self.valid.T)

    def without_slack(self, values: np.ndarray, joint: int) -> np.ndarray:
        """Return values (m, ...) at the valid rows of a joint, functions of the pose taken out."""
        rows = values[self.valid[:, joint]]
        basis = self.slack[joint]
        return rows - np.tensordot(basis, basis.T @ rows.reshape(len(rows), -1), 1).reshape(
            rows.shape)

    @cached_property
    def moving_columns(self) -> tuple[np.ndarray, ...]:
        """The columns (m_i, p) of each joint without functions of the pose."""
        return tuple(self.without_slack(self.columns[:, joint], joint)
                     for joint in range(self.tau.shape[1]))

    @cached_property
    def information(self) -> np.ndarray:
        """W^T W (p, p) of `moving_columns` over all joints."""
        return sum(columns.T @ columns for columns in self.moving_columns)

    def fit(self, tau: np.ndarray | None = None) -> BaseFit:
        """Return the fit to torques (m, J), those recorded by default, in motion."""
        tau = self.tau if tau is None else tau
        parts = [self.without_slack(tau[:, joint], joint) for joint in range(tau.shape[1])]
        moment = sum(columns.T @ part for columns, part in zip(self.moving_columns, parts))
        power = float(sum(part @ part for part in parts))
        return fit_of_moments(self.information, moment, power)

    def left(self, joint: int) -> np.ndarray:
        """Return what the fit leaves of the torque at the valid rows of a joint, (m_i,) N m."""
        return (self.without_slack(self.tau[:, joint], joint)
                - self.moving_columns[joint] @ self.fit().values)

    def explained(self, tau: np.ndarray | None = None) -> float:
        """Return the share of the torque's squares that (20) explains, nothing taken out."""
        tau = self.tau if tau is None else tau
        columns, target = self.columns[self.valid], tau[self.valid]
        left = target - columns @ np.linalg.lstsq(columns, target, rcond=None)[0]
        return 1.0 - float(left @ left) / max(float(target @ target), 1e-30)


@dataclass(frozen=True)
class BaseFit:
    """A fit of the base parameters.

    Attributes:
        values: chi, (p,).
        left: sum of squares that it leaves, N2 m2.
        power: sum of squares of the torque, N2 m2.
    """

    values: np.ndarray
    left: float
    power: float

    @property
    def error(self) -> float:
        """|residual| / |torque| in 2-norms."""
        return float(np.sqrt(self.left / max(self.power, 1e-30)))

    @property
    def physical(self) -> bool:
        """Whether bodies have mass and friction brakes, as far as these tell."""
        return is_physical(self.values)


def fit_of_moments(information: np.ndarray, moment: np.ndarray, power: float) -> BaseFit:
    """Return the fit of normal equations; directions that no row excites stay zero."""
    values = np.linalg.lstsq(information, moment, rcond=1e-10)[0]
    return BaseFit(values, max(power - float(moment @ values), 0.0), power)


def is_physical(values: np.ndarray) -> bool:
    """Return whether base parameters (p,) give a machine with inertia whose friction brakes.

    A lag of the drives can turn the slope of friction over; together with Coulomb's part it must
    brake at 1 rad/s.
    """
    brakes = values[-2] + values[-1] > 0.0
    if len(values) < len(BASE_TERMS):
        return bool(brakes and values[0] > 0.0)
    inertia, first, second = values[:3]
    return bool(brakes and first + second > 0.0 and inertia > -0.2 * abs(first + second))


def equations_of(stretches: Sequence[Stretch], geometry: Geometry | None, filtered: bool = True,
                 columns_of: Callable[[State], np.ndarray] = base_columns) -> Equations:
    """Return the rows of (22) for these dimensions.

    Args:
        stretches: of the logs.
        geometry: dimensions; None for a single axis.
        filtered: pass the columns through the torque's filter; without it, thinned samples do.
        columns_of: gives the columns (n, J, p) of a motion.

    Raises:
        UnreachableError: joint positions with which the mechanism does not close.
    """
    torques, valid = [], []
    for part in stretches:
        tau = part.tau
        moves = np.abs(part.qd) >= (SLOW if geometry is not None else slow_of_axis(part))
        if filtered and _is_long(part):
            tau = low_pass(tau, part.cutoff_hz, part.period)
            moves = ~near(~moves, round(reach_of(part.cutoff_hz * part.period)))
        torques.append(tau)
        valid.append(moves & part.known)
    return Equations(
        log=np.concatenate([np.full(len(part.t), part.log) for part in stretches]),
        t=np.concatenate([part.t for part in stretches]),
        q=np.concatenate([part.q for part in stretches]),
        columns=columns_at(stretches, geometry, filtered, columns_of),
        tau=np.concatenate(torques), valid=np.concatenate(valid))


def columns_at(stretches: Sequence[Stretch], geometry: Geometry | None, filtered: bool = True,
               columns_of: Callable[[State], np.ndarray] = base_columns) -> np.ndarray:
    """Return the columns (m, J, p) of `equations_of` alone, which takes the same arguments."""
    found = []
    for part in stretches:
        columns = columns_of(state_of_joints(geometry, part.t, part.q, part.qd, part.qdd))
        found.append(low_pass(columns, part.cutoff_hz, part.period)
                     if filtered and _is_long(part) else columns)
    return np.concatenate(found)


def _is_long(part: Stretch) -> bool:
    """Return whether a filter has the samples that it needs."""
    return len(part.t) > 40


def equations_or_none(stretches: Sequence[Stretch], geometry: Geometry | None
                      ) -> Equations | None:
    """Return the rows of (22); None without any, or where the mechanism does not close."""
    if not stretches:
        return None
    try:
        rows = equations_of(stretches, geometry)
    except UnreachableError:
        return None
    return rows if (rows.valid.sum(axis=0) >= FEWEST_ROWS).all() else None


def slow_of_axis(part: Stretch) -> float:
    """Return the speed of an axis below which the sign of its friction is not known."""
    return max(SLOW_SHARE * float(np.quantile(np.abs(part.qd), 0.95)), TINY)
