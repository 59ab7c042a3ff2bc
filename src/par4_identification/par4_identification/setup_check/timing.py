"""Torque recorded at another time than the positions: by a delay, or by a clock that drifts.

Torque is taken from times t + d and compared with (20), whose parameters are refitted at every d:
with the columns fixed, a delay only changes the moments W^T tau. A grid over +-250 ms finds the
valley, Gauss and Newton find its bottom: tau(t + d + r (t - t_c)) is linear in small changes of d
and r.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from par4_dynamics.base_terms import base_columns
from par4_dynamics.effects.presliding import built_up
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import State
from par4_identification.logs.log import Log
from par4_identification.setup_check.clustered import basis_of, clustered_std, clusters_of
from par4_identification.setup_check.equations import BaseFit, Equations
from par4_identification.setup_check.finding import Amount, Finding
from par4_sim.report.words import number, percent

LONGEST = 0.25
"""s; delays are looked for up to here."""
GRID = 0.01
"""s between the delays that are tried."""
SMALLEST_DELAY = 0.01
"""s; smaller ones are left to the diagnosis, which tells delays from lags."""
SMALLEST_DELAY_OF_AXIS = 0.03
"""s; the same of a single axis. Its loop gives way to torques that are bound to the position, such
as cogging, and then its torque seems to be early by about the response of the loop. Only beside
these, in the diagnosis, can a delay of that size be told."""
SMALLEST_DRIFT = 0.007
"""s by which a drifting clock must err over the log."""
SMALLEST_RATE = 2.5e-4
"""Relative error of a clock below which a quartz may be as it is."""
LARGEST_RATE = 0.02
"""Relative error of a clock beyond which it is no clock."""
FEWER = 0.6
"""Most of the squared error in motion that a delay may leave."""
FEWER_ON_AXIS = 0.2
"""The same on a single axis, which may have any other fault that a delay resembles a little."""
FEWER_BY_DRIFT = 0.9
"""Most of what a constant delay leaves that a drift may leave."""
SHOWN, GONE = 4.0, 1.5
"""Squared error of an axis without inertia over that with it, from which on the inertia shows and
up to which it does not. Moved by a quarter of the period of a motion, the torque that accelerates
looks like friction: a time at which the inertia is gone is no time of the torque."""
UNEXPLAINED = 0.6
"""Most of the torque in motion that the bodies may leave at the right time: of a torque that they
do not explain at any time, no time is right."""
BETTER = 0.95
"""Most of the error of all rows, over that at the recorded time, that the right time may leave."""
DRIFT_DEVIATIONS = 15.0
"""Standard deviations that a drift must be from zero. They are so many because residuals are not
white, and the stated deviation takes them for white."""
PARTS, GOES_ON = 3, 0.25
"""Parts of the moving rows, and least share of the rate of a clock that is found without any one of
them. A clock drifts all the time. What is late in one part alone is something that acts there."""
BUILDING_UP = 0.003, 0.01, 0.03, 0.1
"""Shares of the range of an axis over which friction may build up after a reversal."""
STEPS = 6
"""Of Gauss and Newton."""


@dataclass(frozen=True)
class Timing:
    """When the torque of one log was recorded.

    What belongs to t stands at t + delay + rate (t - t0).

    Attributes:
        delay: at t0, s; positive where torque is late.
        rate: by which the torque's clock runs fast.
        start: t0, the first row, s.
        end: the last row, s.
        std: of delay and rate.
        before, after: fits without and with it.
    """

    delay: float
    rate: float
    start: float
    end: float
    std: tuple[float, float]
    before: BaseFit
    after: BaseFit

    def late(self, t: np.ndarray) -> np.ndarray:
        """Return by how much the torque of times t (n,) is recorded late, s."""
        return self.delay + self.rate * (t - self.start)


def timing_of(rows: Equations, rival: Equations | None = None) -> Timing | None:
    """Return delay and drift of the torque of one log; None where it is on time.

    Args:
        rows: of one log; those of a robot `with_warming`.
        rival: the same rows of a machine that could make its torque look late though it is not.
            If it leaves less than another time of the torque, nothing is wrong with the time.
    """
    before = rows.fit()
    torque = _Torque(rows)
    inside = torque.inside(LONGEST)
    if inside.sum() < 200:
        return None
    rows = replace(rows, valid=rows.valid & inside[:, None])
    if (rows.valid.sum(axis=0) < 50).any():
        return None
    other = np.inf if rival is None else replace(rival, valid=rows.valid).fit().left
    grid = GRID * np.arange(-round(LONGEST / GRID), round(LONGEST / GRID) + 1)
    left = [rows.fit(torque.at(np.full(len(rows.t), delay))).error for delay in grid]
    start, end = float(rows.t[0]), float(rows.t[-1])
    middle = 0.5 * (start + end)
    now = rows.fit()
    late = _refined(rows, torque, float(grid[np.argmin(left)]), middle, drifts=False)
    drifting = _refined(rows, torque, late.delay, middle, drifts=True)
    delay, fit = late.delay, late.fit
    rate, own = drifting.rate, drifting.fit
    smallest, fewer, by_drift = (
        (SMALLEST_DELAY_OF_AXIS, FEWER_ON_AXIS, FEWER_ON_AXIS) if rows.of_axis
        else (SMALLEST_DELAY, FEWER, FEWER_BY_DRIFT))
    drifts = (abs(rate) * (end - start) > SMALLEST_DRIFT
              and abs(rate) > max(SMALLEST_RATE, DRIFT_DEVIATIONS * drifting.rate_std)
              and abs(rate) < LARGEST_RATE
              and own.left < min(by_drift * fit.left, other) and own.physical
              and own.error < min(UNEXPLAINED, BETTER * before.error)
              and _goes_on(rows, torque, late.delay, middle, rate))
    if drifts:
        return Timing(drifting.delay - rate * (middle - start), rate, start, end,
                      (drifting.delay_std, drifting.rate_std), before, own)
    told = abs(delay) > smallest and np.isfinite(late.delay_std)  # a constant torque has no time
    told = told and not (rows.of_axis and _loses_inertia(
        rows, torque.at(np.full(len(rows.t), delay))))
    if told and fit.left < min(fewer * now.left, other) and fit.physical and (
            abs(delay) < LONGEST and fit.error < min(
                UNEXPLAINED, BETTER * before.error)):
        return Timing(delay, 0.0, start, end, (late.delay_std, 0.0), before, fit)
    return None


def _loses_inertia(rows: Equations, moved: np.ndarray) -> bool:
    """Return whether the inertia of an axis shows in the recorded torque, not in the moved one."""
    rest = replace(rows, columns=rows.columns[..., 1:])
    now, then = (rest.fit(tau).left / max(rows.fit(tau).left, 1e-30) for tau in (rows.tau, moved))
    return now > SHOWN and then < GONE


def _goes_on(rows: Equations, torque: _Torque, delay: float, middle: float, rate: float) -> bool:
    """Return whether a clock drifts without each of the parts of the moving rows, too."""
    moving = np.flatnonzero(rows.valid.any(axis=1))
    for part in np.array_split(moving, PARTS):
        others = rows.valid.copy()
        others[part] = False
        without = _refined(replace(rows, valid=others), torque, delay, middle, drifts=True)
        if without.rate / rate < GOES_ON:
            return False
    return True


def with_warming(state: State, seconds: float) -> np.ndarray:
    """Return the base columns of a robot, and friction that changes with time, (n, J, p).

    It changes over the log, which takes so many `seconds`, not over each stretch of it anew.
    At another time, the torque that accelerates has more or less of viscous friction in it. Without
    these columns friction that falls by a half looked like a clock that is off by half a
    thousandth, and made the rate of one that was wrong by 1.2 thousandths 0.9.
    """
    columns = base_columns(state)
    changing = [columns[..., -2:] * ((state.t / seconds) ** power)[:, None, None]
                for power in (1, 2, 3)]
    return np.concatenate((columns[..., :-2], *changing, columns[..., -2:]), axis=-1)


def with_memory(state: State) -> np.ndarray:
    """Return the base columns of an axis, and friction that builds up after reversals, (n, J, p).

    Like a torque that is read late, such friction lags behind the motion: after each reversal it
    rises only as the joint goes on (Dahl, A solid friction model, 1968). The torque of the
    bodies does not lag with it, and that tells the two apart.
    """
    span = max(float(np.max(np.ptp(state.q, axis=0))), 1e-12)
    building = [built_up(state.q, share * span) for share in BUILDING_UP]
    return np.concatenate((np.stack(building, axis=-1), base_columns(state)), axis=-1)


class _Torque:
    """The torque of a log at other times than those of its rows."""

    def __init__(self, rows: Equations) -> None:
        # one spline a stretch: nothing is interpolated across a gap
        step = np.diff(rows.t)
        cuts = np.flatnonzero(step > 1.5 * np.median(step)) + 1
        self._parts = np.split(np.arange(len(rows.t)), cuts)
        self._t = rows.t
        self._splines = [scipy.interpolate.CubicSpline(rows.t[part], rows.tau[part])
                         for part in self._parts if len(part) > 3]
        self._parts = [part for part in self._parts if len(part) > 3]
        self._shape = rows.tau.shape

    def inside(self, margin: float) -> np.ndarray:
        """Return the rows (m,) that are so far from the ends of their stretch, s."""
        kept = np.zeros(self._shape[0], dtype=bool)
        for part in self._parts:
            time = self._t[part]
            kept[part] = (time >= time[0] + margin) & (time <= time[-1] - margin)
        return kept

    def at(self, late: np.ndarray, order: int = 0) -> np.ndarray:
        """Return the torque (m, J) or its rate at t + late (m,); ends are held."""
        values = np.zeros(self._shape)
        for part, spline in zip(self._parts, self._splines):
            time = np.clip(self._t[part] + late[part], self._t[part[0]], self._t[part[-1]])
            values[part] = spline(time, order)
        return values


@dataclass(frozen=True)
class _Refined:
    """The bottom of the valley.

    Attributes:
        delay: at the middle of the log, s.
        rate: by which the torque's clock runs fast.
        delay_std, rate_std: standard deviations; that of a rate of zero is zero.
        fit: with the torque at its time.
    """

    delay: float
    rate: float
    delay_std: float
    rate_std: float
    fit: BaseFit


def _refined(rows: Equations, torque: _Torque, delay: float, middle: float, drifts: bool
             ) -> _Refined:
    """Return the bottom of the valley near a delay at `middle` (Gauss, Newton)."""
    values = np.array((delay, 0.0))
    free = 2 if drifts else 1
    covariance = np.full((2, 2), np.inf)
    for _ in range(STEPS):
        late = values[0] + values[1] * (rows.t - middle)
        slope = torque.at(late, 1)
        columns = np.stack((slope, slope * (rows.t - middle)[:, None]), axis=-1)[..., :free]
        target = torque.at(late)
        # tau(t + late) + columns @ step = W chi
        parts = [np.column_stack((rows.moving_columns[joint], -rows.without_slack(
            columns[:, joint], joint))) for joint in range(target.shape[1])]
        wanted = np.concatenate([rows.without_slack(target[:, joint], joint)
                                 for joint in range(target.shape[1])])
        system = np.concatenate(parts)
        solution, _, rank, _ = np.linalg.lstsq(system, wanted, rcond=1e-10)
        step = solution[-free:]
        left = wanted - system @ solution
        information = np.linalg.pinv(system.T @ system, rcond=1e-12, hermitian=True)
        covariance = information[-free:, -free:] * float(left @ left) / max(
            len(left) - rank, 1)
        values[:free] += np.clip(step, -0.5 * GRID, 0.5 * GRID)
    late = values[0] + values[1] * (rows.t - middle)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    std[0] = clustered_std(system[:, -free:], left, clusters_of(rows.t, rows.log, rows.valid),
                           basis_of(system[:, :-free]))[0]
    return _Refined(float(values[0]), float(values[1]), float(std[0]),
                    float(std[1]) if drifts else 0.0, rows.fit(torque.at(late)))


def on_time(log: Log, timing: Timing) -> Log:
    """Return the log with its torque moved to the time of the positions; ends without it are cut.

    Where torque would come from beyond a stretch, the samples are cut off.
    """
    kept, tau, segments, end = [], [], [], 0
    for segment in log.segments:
        time = log.t[segment]
        wanted = time + timing.late(time)
        rows = np.flatnonzero((wanted >= time[0]) & (wanted <= time[-1]))
        if len(rows) < 4:
            continue
        kept.append(segment.start + rows)
        tau.append(scipy.interpolate.CubicSpline(time, log.tau[segment])(wanted[rows]))
        segments.append(slice(end, end + len(rows)))
        end += len(rows)
    rows = np.concatenate(kept)
    doubtful = log.doubtful
    if doubtful is not None:  # of the time of the torque as well as of that of the positions
        moved = np.searchsorted(log.t, log.t[rows] + timing.late(log.t[rows])).clip(
            0, len(log.t) - 1)
        doubtful = doubtful[rows] | doubtful[moved]
    return replace(log, t=log.t[rows], q=log.q[rows], tau=np.concatenate(tau),
                   segments=tuple(segments), doubtful=doubtful)


def timing_findings(timing: Timing, log: Log, joints: int) -> list[Finding]:
    """Return what the time of a log's torque says, as findings."""
    everywhere = tuple(range(joints))
    gain = (f'so moved, the rigid bodies leave {percent(timing.after.error)} of the torque in '
            f'motion instead of {percent(timing.before.error)}')
    found = []
    if timing.rate:
        fast = timing.rate > 0.0
        over = 1e3 * abs(timing.rate) * (timing.end - timing.start)
        found.append(Finding(
            'clock_drift', everywhere, None,
            f'the clock of the torque runs {percent(abs(timing.rate))} '
            f'{"fast" if fast else "slow"} against that of the positions '
            f'(+- {percent(timing.std[1])}), {number(over, 2)} ms over {log.name}; {gain}',
            'Stamp torques and positions by one clock, or synchronise the two computers.', True))
    if abs(timing.delay) > SMALLEST_DELAY:
        late = timing.delay > 0.0
        found.append(Finding(
            'delay', everywhere, None,
            f'the torque of {log.name} is recorded {number(1e3 * abs(timing.delay), 3)} ms '
            f'{"after" if late else "before"} the positions it belongs to '
            f'(+- {number(1e3 * timing.std[0], 2)} ms); {gain}',
            f'Stamp both when they are measured, or take {number(abs(timing.delay), 3)} s '
            f'{"off" if late else "on top of"} the stamps of the torque.', True,
            amount=Amount('time_offset', (), {'delay': Parameter(
                value=timing.delay, std=timing.std[0], unit='s')})))
    return found
