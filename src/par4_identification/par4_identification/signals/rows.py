"""Observation rows: a measured log, filtered in parallel with every regressor column.

Positions are low-passed and differentiated; for accelerations they are first freed from the noise
of encoder counts. Torque and every column then pass the same zero-phase low-pass, so that neither
sign(qd) nor a delay of the filter can look like a cause. Rows are taken at a low rate. Rows near
standstill are marked invalid, wider than the filter reaches, because a resting joint does not say
what its friction torque is. A joint that accelerates hard turns back between two samples; its
friction counts as its mean there (`State.direction`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from par4_dynamics.state import State, state_of_joints
from par4_identification.logs.jumps import count_of
from par4_identification.logs.log import Log
from par4_identification.logs.masks import near
from par4_identification.logs.stamps import SHORTEST_PERIOD
from par4_identification.logs.stretches import SHORTEST
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import (
    central_difference,
    fewest_samples,
    low_pass,
    passed,
    second_difference,
)
from par4_identification.signals.plateaus import plateaus_of
from par4_identification.signals.position_noise import position_noise
from par4_identification.signals.smoothing import UNCHANGED, Smoother, smoother_of, speed_noise
from par4_identification.signals.timing import ROUNDED, TICK, timing_error, turning_error
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

SLOWEST_AXIS_HZ = 4.0
"""Rate of a log below which splines between the samples of an axis tell nothing."""
SLOWEST_HZ = 50.0
"""Rate below which a motion that goes faster and slower cannot be filtered."""
QUIET_BANDS = 4
"""In which the noise of an axis's torque is looked at."""
BAND_ORDER = 8
"""Of the filters that part these bands."""
FINE_HZ = 1000.0
"""Rate of the samples of an axis from which columns are computed, at the least."""

WHOLE = 0.01
"""Part of a step by which readings of torques may miss a multiple of it."""
AT_FIRST = 0.05
"""s in which a log that begins at rest stays there."""


@dataclass(frozen=True)
class Run:
    """Rows of one uninterrupted stretch of a log.

    Attributes:
        name: of the log.
        state: filtered motion at the rate of the log, (n, J); of plateaus a sample each.
        t: of the rows, s since the start of the log, (m,); of plateaus their numbers.
        speed: joint speed at the rows, (m, J).
        tau: filtered torque, (m, J), N m.
        valid: rows that say something, (m, J).
        standstill: rows at which the joint rests well within a dwell, (m, J).
        noise_floor: standard deviation of the rows that white torque noise of the level measured
            above the torque's pass band would cause, (J,), N m; of plateaus that of their means.
        period: of the samples of the log, s; zero of plateaus.
        smoother: filter of the positions before the low-pass.
        likely: positions of a motion as lively as the true one, (n, J), rad; empty of plateaus.
        coarse: whether speeds, too, are those of the filtered positions.
        counts: of the encoders a turn, 0 where they are not known.
        position_noise: standard deviation of the white noise of the positions where counts are not
            known, (J,), rad, or of the speeds that they are the integral of, rad/s; zero of
            plateaus.
        integrated: whether it is that of speeds.
        timing_error: standard deviation of the rows that instants of reading up to `READ_WITHIN`
            beside their stamps would cause, and of a Par4 ticks between samples, (m, J), N m; zero
            of plateaus.
        turning_error: the same of times of turning that are wrong by `TURNED_WITHIN`, over the
            Coulomb friction of the joint, (m, J).
        torque_step: of which all torque readings are multiples, (J,) N m; zero where there is none.
        apart: what base parameters (J,) this log has beyond others, by name. Its torque is taken
            out of `tau`; joints carry its bodies all the same.
    """

    name: str
    state: State
    t: np.ndarray
    speed: np.ndarray
    tau: np.ndarray
    valid: np.ndarray
    standstill: np.ndarray
    noise_floor: np.ndarray
    conditioning: Conditioning
    _first: int
    _every: int
    period: float = 0.0
    smoother: Smoother = UNCHANGED
    likely: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    coarse: bool = False
    counts: int = 0
    position_noise: np.ndarray = field(default_factory=lambda: np.zeros(1))
    integrated: bool = False
    timing_error: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))
    turning_error: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))
    torque_step: np.ndarray = field(default_factory=lambda: np.zeros(1))
    apart: Mapping[str, np.ndarray] = field(default_factory=dict)

    def rows(self, columns: np.ndarray) -> np.ndarray:
        """Return columns (n, J, ...) of `state` filtered like the torque, at the rows (m, ...)."""
        if self.conditioning.steady:
            return columns
        period = float(self.state.t[1] - self.state.t[0])
        return low_pass(columns, self.conditioning.torque_cutoff_hz, period,
                        rows=slice(self._first, len(columns) - self._first, self._every))

    def adjoint(self, rows: np.ndarray) -> np.ndarray:
        """Return values z (n, J) at the samples of rows r (m, J).

        The sum of z c is that of r `rows(c)` for any columns c (n, J), as the filter has no phase,
        but for what it reflects through the ends: some thousandths where a run takes 12 s.
        """
        if self.conditioning.steady:
            return rows
        placed = np.zeros_like(self.state.q)
        placed[self._first:len(placed) - self._first:self._every] = rows
        return low_pass(placed, self.conditioning.torque_cutoff_hz,
                        float(self.state.t[1] - self.state.t[0]))

    @property
    def row_time(self) -> float:
        """Time that a row stands for, s; zero of plateaus, which have times of their own."""
        return 0.0 if self.conditioning.steady else float(
            self._every * (self.state.t[1] - self.state.t[0]))

    def at_rows(self, values: np.ndarray) -> np.ndarray:
        """Return values (n, ...) at the samples as they are at the rows, (m, ...), unfiltered."""
        return values[self._first:len(self.state.t) - self._first:self._every]

    @property
    def q(self) -> np.ndarray:
        """Joint positions at the rows, (m, J)."""
        return self.at_rows(self.state.q)

    def with_friction(self, coulomb: np.ndarray, inertia: np.ndarray) -> Run:
        """Return the same run with joints that turn back when such friction lets them.

        What is left of the error of these times counts as the times of readings do.

        Args:
            coulomb: friction of each joint, (J,) N m.
            inertia: that each joint moves, (J,) kg m2.
        """
        bend = ROUNDED / self.conditioning.position_cutoff_hz * 2.0 * coulomb / inertia
        return replace(self, state=replace(self.state, bend=bend), timing_error=np.hypot(
            self.timing_error, coulomb * self.turning_error))

    def remembered(self, memory: float) -> Run:
        """Return the same run without rows that follow from what was before it, s before them.

        Before one that begins at rest nothing was. Of a short one at least half stays.
        """
        state = self.state
        if state.measured is None:
            return self
        memory = min(memory, 0.5 * float(state.t[-1] - state.t[0]))
        return self.part(self.t >= state.t[0] + memory)

    def without(self, samples: np.ndarray) -> Run:
        """Return the same run without the rows that filters let some samples (n,) into."""
        if not samples.any():
            return self
        reach = int(np.ceil(self.conditioning.reach / self.row_time * self._every))
        taken = ~near(samples[:, None], reach)[:, 0]
        kept = taken[self._first:len(taken) - self._first:self._every]
        return self if kept[self.valid.any(axis=1)].all() else self.part(kept)

    def part(self, rows: slice | np.ndarray) -> Run:
        """Return the same run with only `rows` of it, or those where they are true, valid."""
        inside = np.zeros(len(self.t), dtype=bool)
        inside[rows] = True
        return replace(self, valid=self.valid & inside[:, None],
                       standstill=self.standstill & inside[:, None])


def longest_motion(runs: Sequence[Run]) -> Run:
    """Return the run with the most rows at which a joint says something; of equals the first.

    The run that lasts longest may be one in which the machine rests.
    """
    return max(runs, key=lambda run: int(run.valid.any(axis=1).sum()))


def runs_of_logs(logs: Sequence[Log], machine: Robot | Axis,
                 conditioning: Conditioning | None = None) -> list[Run]:
    """Return the rows of logs; the plateaus of steady speeds are one run.

    Raises:
        InputError, UnreachableError: as `runs_of_log`.
    """
    if conditioning is not None and conditioning.steady:
        return [_run_of_plateaus(logs, machine, conditioning)]
    return [run for log in logs for run in runs_of_log(log, machine, conditioning)]


def runs_of_log(log: Log, machine: Robot | Axis, conditioning: Conditioning | None = None
                ) -> list[Run]:
    """Return the rows of every uninterrupted stretch of `log` that is long enough for the filters.

    Raises:
        InputError: a log too slow for the filters, or with no stretch of at least a second.
        UnreachableError: joint positions with which the mechanism does not close.
    """
    conditioning = conditioning or Conditioning()
    if conditioning.steady:
        return [_run_of_plateaus([log], machine, conditioning)]
    rate = 1.0 / log.period
    if isinstance(machine, Axis) and rate < SLOWEST_AXIS_HZ:
        raise InputError(f'{log.name}: recorded at {rate:.3g} Hz by its stamps; at least '
                         f'{SLOWEST_AXIS_HZ:g} Hz are needed, 1000 Hz are better; where stamps '
                         f'count milliseconds, write seconds')
    if rate < 2.5 * conditioning.position_cutoff_hz:
        scale = rate / (2.5 * conditioning.position_cutoff_hz)
        if rate < SLOWEST_HZ:
            raise InputError(f'{log.name}: recorded at {rate:.1f} Hz; at least {SLOWEST_HZ:g} Hz '
                             f'are needed, 1000 Hz are better; an axis that holds each speed for '
                             f'2 s may be slower')
        conditioning = replace(
            conditioning, position_cutoff_hz=scale * conditioning.position_cutoff_hz,
            torque_cutoff_hz=scale * conditioning.torque_cutoff_hz,
            row_rate_hz=scale * conditioning.row_rate_hz)
    samples = (fewest_samples(BAND_ORDER)
               if len(_noise_edges(conditioning, log.period, machine)) else 0)
    long = [segment for segment in log.segments
            if (segment.stop - segment.start) * log.period >= SHORTEST
            and segment.stop - segment.start >= samples]
    runs = _runs(replace(log, segments=tuple(long)), machine, conditioning) if long else []
    if not runs:
        least = max(SHORTEST, 4.0 * conditioning.reach, samples * log.period)
        raise InputError(f'{log.name}: no uninterrupted stretch of at least {least:.1f} s, which '
                         f'the filters need; record longer or without gaps'
                         + ('' if log.period > SHORTEST_PERIOD else
                            f' (its stamps say {rate:.3g} Hz: are they in seconds?)'))
    return runs


def _runs(log: Log, machine: Robot | Axis, conditioning: Conditioning) -> list[Run]:
    """Return the rows of the stretches of a log, all long enough for the filters."""
    fine = finer(log, machine)
    # white noise of samples between which others are put has its power in fewer frequencies
    noise = np.zeros(log.q.shape[1]) if isinstance(machine, Robot) else np.sqrt(
        log.period / fine.period) * position_noise([log.q[part] for part in log.segments],
                                                   log.period, log.integrated)
    counts = machine.drives.encoder_counts if isinstance(machine, Robot) else 0
    smoother = smoother_of([fine.q[part] for part in fine.segments], counts, fine.period)
    runs = [_run(fine, segment, machine, conditioning, smoother, counts,
                 _white_floor(log.tau[measured], conditioning, log.period, machine),
                 log.period, noise)
            for measured, segment in zip(log.segments, fine.segments)]
    return [run for run in runs if len(run.t) > 1]


def are_coarse(counts: int, conditioning: Conditioning, period: float) -> bool:
    """Return whether encoders blur speeds beyond that from which on friction is known.

    Filtered positions then tell speeds better. They round off the turn of a joint, where friction
    changes its sign; coarse counts blur it more.
    """
    cutoff = min(conditioning.position_cutoff_hz, 0.4 / period)
    return speed_noise(counts, cutoff, period) > conditioning.low_speed


def _run_of_plateaus(logs: Sequence[Log], machine: Robot | Axis, conditioning: Conditioning
                     ) -> Run:
    """Return the plateaus of logs of an axis as rows, from the fastest one way to the other."""
    if not isinstance(machine, Axis):
        raise InputError(f'{logs[0].name}: steady speeds asked of a robot; they are read of single '
                         f'axes')
    plateaus = sorted((item for log in logs for item in plateaus_of(log)),
                      key=lambda item: item.speed)
    if not plateaus:
        raise InputError(f'{logs[0].name}: holds no speed for 2 s, as the other logs do; leave it '
                         f'out')
    number = np.arange(float(len(plateaus)))
    q, speed, torque, deviation = (np.array([getattr(item, name) for item in plateaus])[:, None]
                                   for name in ('q', 'speed', 'torque', 'deviation'))
    moving = np.abs(speed) >= conditioning.low_speed
    return Run(
        name=logs[0].name, state=State(number, q, speed, np.zeros_like(q),
                                          hanging=machine.hanging, slides=machine.kind == 'linear'),
        t=number, speed=speed, tau=torque, valid=moving, standstill=np.zeros_like(moving),
        noise_floor=np.sqrt(np.mean(deviation ** 2, axis=0)), conditioning=conditioning,
        _first=0, _every=1, timing_error=np.zeros_like(torque),
        turning_error=np.zeros_like(torque))


def parts_of_sample(log: Log, machine: Robot | Axis) -> int:
    """Return how many samples `finer` makes of one of a log."""
    return 1 if isinstance(machine, Robot) else max(1, int(np.ceil(FINE_HZ * log.period - 1e-6)))


def finer(log: Log, machine: Robot | Axis) -> Log:
    """Return the log of an axis with samples between those of a slow one, by cubic splines.

    Positions and torques are smooth, as far as filters let them through. Friction is not: it
    changes its sign between two samples, and a column that changes it at a sample is wrong by half
    a sample at every reversal, which looks like a delay or like presliding.
    """
    parts = parts_of_sample(log, machine)
    if parts <= 1:
        return log
    period, pieces, end = log.period / parts, [], 0
    segments = []
    for segment in log.segments:
        t = log.t[segment]
        if len(t) < 2:
            continue
        times = t[0] + period * np.arange(parts * (len(t) - 1) + 1)
        doubtful = None if log.doubtful is None else log.doubtful[segment][
            np.round(np.arange(len(times)) / parts).astype(int)]
        pieces.append((times, *(scipy.interpolate.CubicSpline(t, values[segment])(times)
                                for values in (log.q, log.tau)), doubtful))
        segments.append(slice(end, end + len(times)))
        end += len(times)
    t, q, tau = (np.concatenate([piece[index] for piece in pieces]) for index in range(3))
    return replace(log, period=period, t=t, q=q, tau=tau, segments=tuple(segments), reference=None,
                   doubtful=None if log.doubtful is None else np.concatenate(
                       [piece[3] for piece in pieces]))


def _run(log: Log, segment: slice, machine: Robot | Axis, conditioning: Conditioning,
         smoother: Smoother, counts: int, noise_floor: np.ndarray, sampled: float,
         noise: np.ndarray) -> Run:
    period = log.period
    q, smooth = (low_pass(told, conditioning.position_cutoff_hz, period)
                 for told in (log.q[segment], smoother(log.q[segment])))
    coarse = are_coarse(counts, conditioning, period)
    q = smooth if coarse else q
    qd, qdd = central_difference(q, period), second_difference(smooth, period)
    tau = low_pass(log.tau[segment], conditioning.torque_cutoff_hz, period)

    geometry = machine.geometry if isinstance(machine, Robot) else None
    state = state_of_joints(geometry, log.t[segment], q, qd, qdd, period)
    at_first = state.t < state.t[0] + AT_FIRST
    rests = np.all(np.abs(state.qd[at_first]) < conditioning.low_speed)
    state = replace(state, measured=None if rests else log.tau[segment], told_hz=smoother.told_hz(
        period, conditioning.position_cutoff_hz))
    if isinstance(machine, Axis):
        state = replace(state, hanging=machine.hanging, slides=machine.kind == 'linear')
    every = max(1, round(1.0 / (conditioning.row_rate_hz * period)))

    reach = int(np.ceil(conditioning.reach / period))
    slow = np.abs(state.qd) < conditioning.low_speed
    valid = ~near(slow, reach)
    moving = np.abs(state.qd) >= conditioning.low_speed / 4
    resting = ~near(moving, 2 * reach)
    if log.doubtful is not None:
        trusted = ~near(log.doubtful[segment], 2 * reach)
        valid, resting = valid & trusted, resting & trusted
    first = 2 * reach
    window = slice(first, len(state.t) - first, every)
    return Run(
        name=log.name, state=state, t=state.t[window], speed=state.qd[window],
        tau=tau[window], valid=valid[window], standstill=resting[window],
        noise_floor=noise_floor, conditioning=conditioning,
        _first=first, _every=every, period=sampled, smoother=smoother,
        likely=low_pass(smoother.likely(log.q[segment]), conditioning.position_cutoff_hz, period),
        coarse=coarse, counts=counts, position_noise=noise, integrated=log.integrated,
        torque_step=_torque_step(log.tau[segment]),
        timing_error=timing_error(log.tau[segment], conditioning, period, round(
            sampled / period), TICK if geometry is not None else np.inf)[window],
        turning_error=turning_error(qd, conditioning, period)[window])


def _torque_step(torque: np.ndarray) -> np.ndarray:
    """Return the step (J,), N m, of which all readings (n, J) are multiples, zero without one."""
    steps = np.abs(np.diff(torque, axis=0))
    return np.array([count_of(own[own > 0.0], WHOLE) if np.any(own > 0.0) else 0.0
                     for own in steps.T])


def _noise_edges(conditioning: Conditioning, period: float, machine: Robot | Axis) -> np.ndarray:
    """Return the edges, Hz, of the bands above the pass band; none where there is no room."""
    nyquist = 0.5 / period
    above, bands = (2.0, QUIET_BANDS) if isinstance(machine, Axis) else (4.0, 1)
    lowest = above * conditioning.torque_cutoff_hz
    return np.linspace(lowest, nyquist, bands + 1) if lowest <= 0.9 * nyquist else np.empty(0)


def _white_floor(torque: np.ndarray, conditioning: Conditioning, period: float,
                 machine: Robot | Axis) -> np.ndarray:
    """Return the in-band standard deviation (J,) that the level above the pass band implies.

    The median size of the torque in a band above the cut-off is taken as that of white noise. The
    median over time leaves out the bursts with which the drives answer reversals. Noise that is
    stronger below the pass band is underrated; torque with which the drives follow encoder counts
    is counted though it moves the arms, so that a residual may lie some 10 % below. White noise is
    as loud in any band, the chatter of a drive or the ripple of a gear in some. So the quietest of
    several bands counts on an axis, which may be any machine.
    """
    frequency, edges = np.fft.rfftfreq(len(torque), period), _noise_edges(
        conditioning, period, machine)
    if not len(edges):
        return np.zeros(torque.shape[1])
    below = [*(low_pass(torque, edge, period, order=BAND_ORDER) for edge in edges[:-1]), torque]
    shares = [*(passed(frequency, edge, period, order=BAND_ORDER) for edge in edges[:-1]),
              np.ones_like(frequency)]
    levels = [np.median(np.abs(below[band + 1] - below[band]), axis=0) / np.sqrt(np.mean(
        (shares[band + 1] - shares[band]) ** 2)) for band in range(len(edges) - 1)]
    in_band = np.sqrt(np.mean(passed(frequency, conditioning.torque_cutoff_hz, period) ** 2))
    return np.asarray(np.min(levels, axis=0) / 0.6745 * in_band)
