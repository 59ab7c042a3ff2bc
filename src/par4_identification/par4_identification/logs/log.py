"""What a bag measured, put in order: joint positions and torques on an even grid.

Real bags have jitter, gaps, repeated and disordered samples, several rates, NaN. Each is repaired
and counted in `Accounts`, or refused in one line. Header stamps rule; the time at which a message
was received only orders the messages and tells where the clock was set back.

The order of the repairs, for positions and torque alike: joints by name; samples without stamp;
a clock set back (the part behind it becomes a segment of its own, its time continued); sorting;
repeated stamps; gaps counted; NaN. Positions then give the grid: their own stamps if these are
even, else as many evenly spaced ones. Short gaps are filled, long ones cut the log into segments,
which are never joined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    FEEDFORWARD_TORQUE,
    JOINT_STATES,
    REFERENCE,
    START_DELAY,
)
from par4_kinematics.robot import Axis, Robot
from par4_sim.bag import JointSamples, RawBag, TrajectoryPoints, read_bag
from par4_sim.reference import MATCH

GAP = 1.5
"""Spacing in periods above which samples are missing."""
FILLED = 3
"""Most missing samples in a row that interpolation fills; more cut the log."""
EVEN = 1e-3
"""Largest deviation from an even grid, in periods, at which samples are taken as they are."""
CROWDED = 0.25
"""Spacing in periods below which the later of two samples is dropped: splines would swing."""
SHORTEST_SEGMENT = 20
"""Samples; shorter segments are dropped."""
FEWEST_SAMPLES = 100
"""Samples below which a log is refused."""
SET_BACK = 1_000_000_000
"""No transport holds a message back for so long (ns): the clock was set back."""
MOST_CONFLICTS = 0.05
"""Fraction of samples with the stamp but not the values of another above which a log is refused."""
DISAGREEMENT = 0.01
"""Relative difference of effort and G V above which it is reported."""
APART = 0.25
"""s by which the clocks of two topics must differ, as their receipt tells, to be two clocks."""
JUMP, MOST_TO_AND_FRO = 1e-2, 0.05
"""rad of a jump to and fro from sample to sample, and share of such samples, that two sources in
one topic make."""


@dataclass(frozen=True)
class SampleCounts:
    """What one topic's samples needed.

    Attributes:
        topic: name with its namespace.
        read: samples.
        other_joints: without any of the machine's joints, ignored.
        incomplete: with some of the joints only, dropped.
        not_stamped: stamp zero while the clock runs elsewhere, dropped.
        repeated: sent again with the same stamp and values, dropped.
        conflicting: with the stamp of another sample but other values, dropped.
        crowded: closer than a quarter of a period behind another, dropped.
        not_finite: NaN or infinite, dropped.
        out_of_order: received after a later one, sorted in.
        gaps: spacings of more than 1.5 periods.
        longest_gap: s.
        lost: samples that the gaps would have held.
        period: median spacing, s.
        jitter_rms: of the spacing about the period, gaps left out, s.
    """

    topic: str
    read: int
    other_joints: int
    incomplete: int
    not_stamped: int
    repeated: int
    conflicting: int
    crowded: int
    not_finite: int
    out_of_order: int
    gaps: int
    longest_gap: float
    lost: int
    period: float
    jitter_rms: float


@dataclass(frozen=True)
class Accounts:
    """What was read, repaired and dropped on the way from a bag to a `Log`.

    Attributes:
        bag: path.
        namespace: under which the topics were found.
        duration: from the first sample to the last, segments and the gaps between, s.
        samples, segments: of the log.
        period: of its grid, s.
        resampled: whether the stamps were uneven, so that every value is interpolated.
        filled: samples interpolated in short gaps.
        clock_resets: times the clock was set back.
        short_segments: samples dropped with segments of fewer than 20.
        without_torque: samples dropped because no torque was measured there.
        torque_source: 'amplifier_voltage' or 'effort'.
        torque_disagreement: |G V - effort| / |G V| of each joint where both are there, else None.
        position, torque: what the samples needed.
        reordered: messages with the joints in another order than the machine's.
        ignored_joints: names.
        ignored_topics: type by name.
        unreadable: messages that could not be decoded, by topic.
        reference: 'absent', 'read', or why it was ignored.
        clock_offset: by which the stamps of the torque were moved because its topic has another
            clock, s.
    """

    bag: str
    namespace: str
    duration: float
    samples: int
    segments: int
    period: float
    resampled: bool
    filled: int
    clock_resets: int
    short_segments: int
    without_torque: int
    torque_source: str
    torque_disagreement: tuple[float, ...] | None
    position: SampleCounts
    torque: SampleCounts
    reordered: int
    ignored_joints: tuple[str, ...]
    ignored_topics: dict[str, str]
    unreadable: dict[str, int]
    reference: str
    clock_offset: float = 0.0

    def to_json(self) -> dict[str, Any]:
        """Return the accounts as plain dicts, lists, numbers and strings."""
        return asdict(self)

    def findings(self) -> tuple[str, ...]:
        """Return what was repaired, dropped or suspicious, in words; nothing for a good bag."""
        found = []
        for samples in (self.position, self.torque):
            found += [f'{samples.topic}: {count} of {samples.read} samples {words}'
                      for count, words in (
                (samples.incomplete, 'lack some of the joints, dropped'),
                (samples.not_stamped, 'without stamp, dropped'),
                (samples.repeated, 'repeated, dropped'),
                (samples.conflicting, 'with the stamp of another but other values, dropped'),
                (samples.crowded, 'closer than a quarter of a period to another, dropped'),
                (samples.not_finite, 'not finite, dropped'),
                (samples.out_of_order, 'out of order, sorted in')) if count]
            if samples.gaps:
                found.append(f'{samples.topic}: {samples.gaps} gaps, the longest '
                             f'{samples.longest_gap:.4g} s, about {samples.lost} samples lost')
        found += [f'{topic}: {count} messages cannot be decoded, ignored'
                  for topic, count in self.unreadable.items()]
        # at either end one topic may begin or end a sample before the other: nothing is missing
        unmeasured = (self.without_torque
                      if self.without_torque * self.period > 2.0 * self.torque.period else 0)
        found += [f'{count} {words}' for count, words in (
            (self.clock_resets, 'times the clock was set back; the log is cut there'),
            (self.filled, 'samples filled by interpolation'),
            (self.short_segments, f'samples dropped in segments shorter than {SHORTEST_SEGMENT}'),
            (unmeasured, 'samples dropped where no torque was measured')) if count]
        if self.segments > 1:
            found.append(f'gaps cut the log into {self.segments} segments')
        if self.clock_offset:
            found.append(f'{self.torque.topic} has another clock than {self.position.topic}; moved '
                         f'by {self.clock_offset:.6g} s, as its receipt tells')
        if self.resampled:
            found.append(f'uneven stamps (spacing +- {self.position.jitter_rms:.3g} s rms), '
                         f'resampled every {self.period:.6g} s')
        if self.torque_disagreement and max(self.torque_disagreement) > DISAGREEMENT:
            found.append('effort and gain x amplifier voltage disagree by '
                         + ', '.join(f'{100 * part:.2g} %' for part in self.torque_disagreement)
                         + '; the voltage rules; check drives.gain of the robot file')
        if self.reference not in ('absent', 'read'):
            found.append(f'{REFERENCE.name} ignored: {self.reference}')
        return tuple(dict.fromkeys(found))  # position and effort of one topic say the same


@dataclass(frozen=True)
class Reference:
    """The motion that was asked for; SI, radians.

    Attributes:
        t: on the clock of the log, increasing, (m,) s.
        q, qd, qdd: (m, J); NaN where the messages carried none.
        effort: feedforward torque, (m, J) N m, NaN where none came; None without any.
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    effort: np.ndarray | None = None


@dataclass(frozen=True)
class Log:
    """Measured positions and torques of J joints on an even grid; SI, radians.

    Attributes:
        name: path of the bag.
        joint_names: of the columns.
        start_stamp: of the first sample of the bag, ns; t = 0.
        period: of the grid within a segment, s.
        t: (n,) s.
        q: (n, J) rad.
        tau: (n, J) N m.
        segments: contiguous stretches, in order, covering all n samples; filter none across them.
        reference: the motion asked for, if the bag holds one.
        accounts: what was read, repaired and dropped.
        doubtful: samples at which the torque of a joint must not be compared with a model, because
            position or torque there are filled in or wrong, (n, J); None where there is none.
    """

    name: str
    joint_names: tuple[str, ...]
    start_stamp: int
    period: float
    t: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    segments: tuple[slice, ...]
    reference: Reference | None
    accounts: Accounts
    doubtful: np.ndarray | None = None


def read_log(path: str | Path, machine: Robot | Axis, namespace: str | None = None) -> Log:
    """Return what a bag measured of a machine, repaired, counted and on an even grid.

    Torque is gain x `amplifier_voltage` (24) where that topic has messages, else the effort of
    `joint_states`. Evenly stamped samples pass unchanged; otherwise positions are interpolated
    cubically and torques linearly, once, from their own stamps.

    Args:
        path: of the bag.
        machine: names the joints and, for voltages, the gains.
        namespace: that the topics sit under; see `read_bag`.

    Raises:
        InputError: the bag cannot be read, lacks joints, positions, torques or stamps, mixes
            several sources in one topic, or leaves fewer than 100 samples.
    """
    bag = read_bag(path, namespace)
    joints = machine.joint_names
    states = bag.joints[JOINT_STATES.name]
    rows = _rows(path, states, states.position, joints, 'position')
    if rows is None:
        raise InputError(f'{path}: {states.topic} carries no position of {", ".join(joints)}; '
                         'record a topic with positions')
    clock = _Clock(rows.received, rows.stamp, rows.values)
    position = _series(path, rows, clock)
    _refuse_two_sources(path, position)
    torque, source, disagreement, offset = _torque(path, bag, machine, clock)
    grid = _grid(position)

    parts, short, without_torque = [], grid.short, 0
    for time, q in grid.pieces:
        tau = _interpolate(torque, time, clock, EVEN * grid.period)
        measured = np.isfinite(tau).all(axis=1)
        without_torque += _count(~measured)
        for start, end in _stretches(measured):
            if end - start < SHORTEST_SEGMENT:
                short += end - start
            else:
                parts.append((time[start:end], q[start:end], tau[start:end]))
    ends = np.cumsum([0] + [len(time) for time, _, _ in parts]).tolist()
    samples = ends[-1]
    if samples < FEWEST_SAMPLES:
        raise InputError(
            f'{path}: {samples} usable samples of {position.counts.read} on {states.topic} '
            f'({position.counts.not_finite} not finite, {without_torque} without torque, {short} '
            f'in segments shorter than {SHORTEST_SEGMENT}), at least {FEWEST_SAMPLES} are needed; '
            'record a longer bag')
    time, q, tau = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    reference, reference_note = _reference(bag, joints, clock)
    accounts = Accounts(
        bag=str(path), namespace=bag.namespace, duration=1e-9 * float(time[-1] - time[0]),
        samples=samples, segments=len(parts), period=1e-9 * grid.period, resampled=grid.resampled,
        filled=grid.filled, clock_resets=len(clock.joins), short_segments=short,
        without_torque=without_torque, torque_source=source, torque_disagreement=disagreement,
        position=position.counts, torque=torque.counts, reordered=_reordered(states, joints),
        ignored_joints=tuple(sorted({name for names in states.layouts for name in names}
                                    - set(joints))),
        ignored_topics=bag.ignored, unreadable=bag.unreadable, reference=reference_note,
        clock_offset=offset)
    return Log(str(path), joints, clock.origin, accounts.period, 1e-9 * time, q, tau,
               tuple(slice(start, end) for start, end in pairwise(ends)), reference, accounts)


@dataclass(frozen=True)
class _Rows:
    """Stamped samples (n,) ns, (n, J) of one topic as they were received, and what was dropped."""

    topic: str
    received: np.ndarray
    stamp: np.ndarray
    values: np.ndarray
    dropped: dict[str, int]


@dataclass(frozen=True)
class _Series:
    """Finite samples in order: stamp on the axis (n,) ns, values (n, J), period ns, counts."""

    stamp: np.ndarray
    values: np.ndarray
    period: float
    counts: SampleCounts


class _Clock:
    """One time axis for all topics of a bag, also when the clock was set back in between.

    Its zero is the first position; its unit ns, so that times are small and exact as floats. Every
    run between two resets is shifted so that it follows on its predecessor. Which run a message of
    another topic belongs to follows from when it was received.

    Attributes:
        origin: stamp of time zero, ns.
        joins: times between the runs.
    """

    def __init__(self, received: np.ndarray, stamp: np.ndarray, values: np.ndarray) -> None:
        """Find the runs of positions (n, J) in the order in which they were received, (n,) ns."""
        spacing = np.diff(stamp)
        period = float(np.median(spacing[spacing > 0])) if (spacing > 0).any() else 1.0
        starts = [0]
        while (reset := _first_reset(stamp[starts[-1]:], values[starts[-1]:], period)) is not None:
            starts.append(starts[-1] + reset)
        ends = [*starts[1:], len(stamp)]
        self.origin = int(stamp[:ends[0]].min())
        shifts, joins = [-self.origin], []
        for run, start in enumerate(starts[1:]):
            last = int(stamp[starts[run]:start].max()) + shifts[run]
            # Wide enough to cut the log, and narrower than a set-back that matters.
            joins.append(last + round(5 * period))
            shifts.append(last + round(10 * period) - int(stamp[start]))
        self.joins = np.array(joins, dtype=np.int64)
        self._shifts = np.array(shifts, dtype=np.int64)
        self._received = np.maximum.accumulate(received)
        self._time = stamp + np.repeat(self._shifts, np.subtract(ends, starts))

    def at_receipt(self, received: np.ndarray) -> np.ndarray:
        """Return the time at which something was received, (n,) ns."""
        first = self._received[0]
        return np.rint(np.interp(received - first, self._received - first, self._time)).astype(
            np.int64)

    def time(self, received: np.ndarray, stamp: np.ndarray) -> np.ndarray:
        """Return the time of stamps, (n,) ns."""
        if not len(self.joins):
            return stamp + self._shifts[0]
        candidates = stamp[:, None] + self._shifts
        distance = np.abs(candidates - self.at_receipt(received)[:, None])
        return candidates[np.arange(len(stamp)), np.argmin(distance, axis=1)]

    def offset(self, rows: _Rows) -> int:
        """Return by how much, ns, stamps of another clock must be moved to be on this one.

        Both clocks are compared with the one that told when messages were received; zero where
        they agree to `APART`, or where a clock was set back as well.
        """
        if len(self.joins):
            return 0
        own = float(np.median(self._received - (self._time - self._shifts[0])))
        other = float(np.median(rows.received - rows.stamp))
        return 0 if abs(other - own) < 1e9 * APART else round(other - own)

    def run(self, time: np.ndarray) -> np.ndarray:
        """Return the number of the run that each time belongs to."""
        return np.searchsorted(self.joins, time, side='right')


def _first_reset(stamp: np.ndarray, values: np.ndarray, period: float) -> int | None:
    """Return the index of the first sample after the clock was set back.

    A late sample fills a hole. After a reset, samples in a row go once more over time that is
    covered already, with other values; or they are too late for any transport.
    """
    newest = np.maximum.accumulate(stamp)
    for first, end in _stretches(stamp < newest):
        if end - first < 3:
            continue
        if newest[first] - stamp[first] > SET_BACK:
            return first
        again, order = stamp[first:end], np.argsort(stamp[:first], kind='stable')
        if len(order) < 3:
            continue
        nearest = order[_nearest(stamp[order], again)]
        covered = np.abs(stamp[nearest] - again) < CROWDED * period
        differs = (np.nan_to_num(values[nearest]) != np.nan_to_num(values[first:end])).any(axis=1)
        if _count(covered & differs) >= 3:
            return first
    return None


def _count(mask: np.ndarray) -> int:
    return int(np.count_nonzero(mask))  # numpy's own integers are no JSON


def _stretches(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return start and end (excluded) of every run of true values."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(np.int8)))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]


def _nearest(stamp: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of the stamp, of at least two in order, that is nearest to each time."""
    right = np.searchsorted(stamp, times).clip(1, len(stamp) - 1)
    return right - (times - stamp[right - 1] < stamp[right] - times)


def _rows(path: str | Path, samples: JointSamples, values: np.ndarray, joints: Sequence[str],
          quantity: str) -> _Rows | None:
    """Return the stamped rows with all joints, or None if none carries the quantity.

    Raises:
        InputError: a joint is nowhere, or no message is stamped.
    """
    known = {name for names in samples.layouts for name in names}
    missing = [joint for joint in joints if joint not in known]
    if missing:
        raise InputError(f'{path}: {samples.topic} lacks {", ".join(missing)} ({quantity} wanted); '
                         f'it holds {", ".join(sorted(known)) or "no joint"}; name the joints as '
                         'the robot file does')
    named = samples.names_count(joints)
    complete = named == len(joints)
    selected = samples.select(values, joints)
    if not np.isfinite(selected[complete]).any():
        return None
    stamped = samples.stamp > 0
    if not stamped[complete].any():
        raise InputError(f'{path}: no message on {samples.topic} has a header stamp; set it to the '
                         'time of the measurement')
    # A simulated clock starts at zero; there, zero is a time.
    if samples.stamp[stamped & complete].min() < SET_BACK:
        stamped = samples.stamp >= 0
    kept = complete & stamped
    return _Rows(samples.topic, samples.received[kept], samples.stamp[kept], selected[kept], {
        'read': len(named), 'other_joints': _count(named == 0),
        'incomplete': _count((named > 0) & ~complete),
        'not_stamped': _count(complete & ~stamped)})


def _series(path: str | Path, rows: _Rows, clock: _Clock) -> _Series:
    """Return the rows sorted, without repeats and NaN, on the time axis of the bag.

    Raises:
        InputError: too many samples contradict each other, or too few are left.
    """
    stamp = clock.time(rows.received, rows.stamp)
    order = np.argsort(stamp, kind='stable')
    again = np.flatnonzero(np.diff(stamp[order]) == 0) + 1
    one, other = rows.values[order[again - 1]], rows.values[order[again]]
    repeated = _count(((one == other) | np.isnan(one) & np.isnan(other)).all(axis=1))
    conflicting = len(again) - repeated
    if conflicting > MOST_CONFLICTS * len(stamp):
        raise InputError(
            f'{path}: {conflicting} of {len(stamp)} samples on {rows.topic} have the stamp of '
            'another but other values (two publishers, or a clock set back while its time ordered '
            'the bag); record one source at a time, on the clock of the system')
    order = np.delete(order, again)
    crowded = np.zeros(len(order), dtype=bool)
    if len(order) > 2:
        crowded[1:] = np.diff(stamp[order]) < CROWDED * np.median(np.diff(stamp[order]))
        order = order[~crowded]
    received_order = stamp[np.sort(order)]
    out_of_order = _count(received_order < np.maximum.accumulate(received_order))
    spacing = spacing_counts(stamp[order], clock.run(stamp[order]))
    finite = np.isfinite(rows.values[order]).all(axis=1)
    counts = SampleCounts(
        topic=rows.topic, **rows.dropped, repeated=repeated, conflicting=conflicting,
        crowded=_count(crowded), not_finite=_count(~finite),
        out_of_order=out_of_order, **spacing)
    order = order[finite]
    if len(order) < 2 or not counts.period:
        raise InputError(f'{path}: {len(order)} usable samples on {rows.topic}, at least '
                         f'{FEWEST_SAMPLES} are needed; record a longer bag')
    return _Series(stamp[order], rows.values[order], 1e9 * counts.period, counts)


def _refuse_two_sources(path: str | Path, position: _Series) -> None:
    """Refuse positions that jump to and fro between two machines.

    Raises:
        InputError: they do.
    """
    step = np.diff(position.values, axis=0)
    there, back = np.abs(step[:-1]), np.abs(step[1:])
    returned = np.abs(step[:-1] + step[1:]) < 0.3 * np.minimum(there, back)
    to_and_fro = (returned & (np.minimum(there, back) > JUMP)).any(axis=1)
    if to_and_fro.sum() > MOST_TO_AND_FRO * len(step):
        raise InputError(
            f'{path}: positions on {position.counts.topic} jump to and fro in {to_and_fro.sum()} '
            f'of {len(step)} samples (two machines or simulations on one topic); record one source '
            'at a time, in a namespace or ROS_DOMAIN_ID of its own')


def spacing_counts(stamp: np.ndarray, run: np.ndarray | None = None) -> dict[str, float]:
    """Return `gaps`, `longest_gap` (s), `lost`, `period` (s) and `jitter_rms` (s) of stamps.

    Args:
        stamp: (n,) ns, increasing.
        run: (n,); the spacing between samples of different runs means nothing.
    """
    spacing = np.diff(stamp)
    if run is not None:
        spacing = spacing[np.diff(run) == 0]
    if not len(spacing):
        return {'gaps': 0, 'longest_gap': 0.0, 'lost': 0, 'period': 0.0, 'jitter_rms': 0.0}
    period = float(np.median(spacing))
    gaps = spacing[spacing > GAP * period]
    others = spacing[spacing <= GAP * period]
    return {
        'gaps': len(gaps), 'longest_gap': 1e-9 * float(gaps.max(initial=0)),
        'lost': int(np.sum(np.round(gaps / period) - 1)), 'period': 1e-9 * period,
        'jitter_rms': 1e-9 * float(np.sqrt(np.mean((others - period) ** 2))),
    }


@dataclass(frozen=True)
class _Grid:
    """Segments of (time (n,) ns, q (n, J)) every `period` ns, and what making them took."""

    pieces: list[tuple[np.ndarray, np.ndarray]]
    period: float
    resampled: bool
    filled: int
    short: int


def _grid(position: _Series) -> _Grid:
    """Return the positions on an even grid, cut at long gaps.

    The period is the slope of a line through all stamps: with jitter, the median spacing is off by
    its chance. Evenly stamped samples stand as they are, with holes filled; otherwise a new grid
    starts at each segment's first sample.
    """
    stamp, values = position.stamp.astype(float), position.values
    missing = np.round(np.diff(stamp) / position.period) - 1
    cuts = np.flatnonzero(missing > FILLED) + 1
    parts = [part for part in np.split(np.arange(len(stamp)), cuts)
             if len(part) >= SHORTEST_SEGMENT]
    short = len(stamp) - sum(map(len, parts))
    if not parts:
        return _Grid([], position.period, False, 0, short)

    # Number of each sample on the grid.
    numbers = [np.r_[0, np.cumsum(missing[part[:-1]] + 1)] for part in parts]
    centred = [(number - number.mean(), stamp[part] - stamp[part].mean())
               for number, part in zip(numbers, parts, strict=True)]
    period = float(sum(number @ time for number, time in centred)
                   / sum(number @ number for number, _ in centred))
    uneven = any((np.abs(time - period * number) > EVEN * period).any()
                 for number, time in centred)
    pieces, filled = [], 0
    for number, part in zip(numbers, parts, strict=True):
        filled += int(missing[part[:-1]].clip(0).sum())
        if uneven:
            steps = np.arange(np.floor((stamp[part[-1]] - stamp[part[0]]) / period + EVEN) + 1)
            time = stamp[part[0]] + period * steps
        else:
            time = (stamp[part] - period * number).mean() + period * np.arange(number[-1] + 1)
        if not uneven and len(time) == len(part):
            q = values[part]
        else:
            from scipy.interpolate import CubicSpline  # slow to load, and not always needed
            q = CubicSpline(stamp[part] / period, values[part])(time / period)
            if not uneven:
                q[number.astype(int)] = values[part]
        pieces.append((time, q))
    return _Grid(pieces, period, uneven, filled, short)


def _torque(path: str | Path, bag: RawBag, machine: Robot | Axis, clock: _Clock
            ) -> tuple[_Series, str, tuple[float, ...] | None, float]:
    """Return the torques, their source, how far the other source disagrees, and by how many
    seconds the stamps of the torques were moved to the clock of the positions.

    Raises:
        InputError: there is none.
    """
    states = bag.joints[JOINT_STATES.name]
    rows = _rows(path, states, states.effort, machine.joint_names, 'effort')
    effort = None if rows is None else _series(path, rows, clock)
    voltages = bag.joints.get(AMPLIFIER_VOLTAGE.name)
    rows = None if voltages is None else _rows(path, voltages, voltages.effort,
                                               machine.joint_names, 'voltage')
    if rows is None and effort is None:
        raise InputError(f'{path}: no torque, neither {AMPLIFIER_VOLTAGE.name} nor effort in '
                         f'{states.topic}; record one of them')
    if rows is None:
        return effort, 'effort', None, 0.0
    offset = clock.offset(rows)
    voltage = _series(path, replace(rows, stamp=rows.stamp + offset), clock)
    torque = replace(voltage, values=voltage.values * machine.drive_gain)
    disagreement = None if effort is None else _disagreement(torque, effort, clock)
    return torque, AMPLIFIER_VOLTAGE.name, disagreement, 1e-9 * offset


def _disagreement(torque: _Series, effort: _Series, clock: _Clock) -> tuple[float, ...] | None:
    other = _interpolate(effort, torque.stamp, clock, EVEN * torque.period)
    common = np.isfinite(other).all(axis=1)
    if not common.any():
        return None
    values, other = torque.values[common], other[common]
    size = np.maximum(np.linalg.norm(values, axis=0), np.linalg.norm(other, axis=0))
    difference = np.linalg.norm(values - other, axis=0)
    return tuple(np.divide(difference, size, out=np.zeros_like(size), where=size > 0).tolist())


def _interpolate(series: _Series, time: np.ndarray, clock: _Clock, tolerance: float) -> np.ndarray:
    """Return values (n, J) at times (n,) ns; NaN outside the samples and in their long gaps.

    A sample within `tolerance`, ns, of a time is taken as it is.
    """
    stamp = series.stamp
    nearest = _nearest(stamp, time)
    values = series.values[nearest]
    between = np.flatnonzero(np.abs(stamp[nearest] - time) > tolerance)
    time = time[between]
    right = np.searchsorted(stamp, time).clip(1, len(stamp) - 1)
    left = right - 1
    width = stamp[right] - stamp[left]
    fraction = ((time - stamp[left]) / width)[:, None]
    interpolated = (1 - fraction) * series.values[left] + fraction * series.values[right]
    outside = (time < stamp[0]) | (time > stamp[-1])
    far = np.round(width / series.period) - 1 > FILLED
    interpolated[outside | far | (clock.run(stamp[left]) != clock.run(stamp[right]))] = np.nan
    values[between] = interpolated
    return values


def _reordered(samples: JointSamples, joints: Sequence[str]) -> int:
    """Return how many messages name these joints in another order."""
    differs = np.array([[name for name in names if name in joints] != list(joints)
                        for names in samples.layouts])
    return _count(differs[samples.layout])


def _reference(bag: RawBag, joints: Sequence[str], clock: _Clock) -> tuple[Reference | None, str]:
    """Return the motion asked for, and whether it was read, absent or why it is ignored.

    A message replaces every earlier point from its own first time on. A stamp of zero starts
    START_DELAY after receipt, which is placed by the positions received around it.
    """
    points = bag.trajectories.get(REFERENCE.name)
    if points is None or not len(points.stamp):
        return None, 'absent'
    missing = sorted(set(joints) - {name for names in points.layouts for name in names})
    if missing:
        return None, f'{points.topic} lacks {", ".join(missing)}'
    time = _point_times(points, clock)
    first = np.full(points.message[-1] + 1, np.iinfo(np.int64).max)
    np.minimum.at(first, points.message, time)
    replaced_from = np.append(np.minimum.accumulate(first[::-1])[::-1][1:],
                              np.iinfo(np.int64).max)
    q = points.select(points.position, joints)
    kept = np.flatnonzero((time < replaced_from[points.message]) & np.isfinite(q).all(axis=1))
    if not len(kept) or (np.diff(time[kept]) <= 0).any():
        return None, f'{points.topic} has no points with increasing times'
    return Reference(1e-9 * time[kept], q[kept], *(
        points.select(part, joints)[kept] for part in (points.velocity, points.acceleration)),
        _feedforward(bag, joints, clock, time[kept])), 'read'


def _point_times(points: TrajectoryPoints, clock: _Clock) -> np.ndarray:
    """Return the time of each point, (n,) ns."""
    start = np.where(points.stamp > 0, clock.time(points.received, points.stamp),
                     clock.at_receipt(points.received) + round(1e9 * START_DELAY))
    return start + points.time_from_start


def _feedforward(bag: RawBag, joints: Sequence[str], clock: _Clock, time: np.ndarray
                 ) -> np.ndarray | None:
    """Return the torque that came for reference points at `time` (m,) ns, (m, J), or None."""
    points = bag.trajectories.get(FEEDFORWARD_TORQUE.name)
    if points is None or len(points.stamp) < 2:
        return None
    # reversed, so that the newest of one time is the one that `unique` keeps
    own, newest = np.unique(_point_times(points, clock)[::-1], return_index=True)
    if len(own) < 2:
        return None
    effort = points.select(points.effort, joints)[::-1][newest]
    nearest = _nearest(own, time)
    matched = np.abs(own[nearest] - time) <= 1e9 * MATCH
    effort = np.where(matched[:, None], effort[nearest], np.nan)
    return effort if np.isfinite(effort).any() else None
