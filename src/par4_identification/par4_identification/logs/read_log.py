"""What a bag measured, put in order: joint positions and torques on an even grid.

Real bags have jitter, gaps, repeated and disordered samples, several rates, NaN. Each is repaired
and counted in `Accounts`, or refused in one line. Header stamps rule; the time at which a message
was received only orders the messages and tells where the clock was set back.

The order of the repairs, for positions and torque alike: joints by name; samples without stamp;
messages of a second source; a clock set back (the part behind it becomes a segment of its own, its
time continued); sorting; repeated stamps; gaps counted; NaN. Positions then give the grid: their
own stamps if these are even, else as many evenly spaced ones. Of a signal that is held between
refreshes only the refreshes count, and a log whose torque is held, or has most of its cells empty,
has a sample at each reading of it. Short gaps are filled; long ones, and jumps of several positions
at once, cut the log into segments, which are never joined.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from par4_identification.logs.accounts import SHORTEST_SEGMENT, Accounts
from par4_identification.logs.bag import read_bag
from par4_identification.logs.clips import without_clipped
from par4_identification.logs.clock import Clock
from par4_identification.logs.counters import going_on, restarts_of
from par4_identification.logs.even_stamps import evened
from par4_identification.logs.grid import Grid, grid_of
from par4_identification.logs.integrated import are_integrals
from par4_identification.logs.interpolated_rows import without_interpolated
from par4_identification.logs.jumps import without_turns
from par4_identification.logs.log import Log
from par4_identification.logs.masks import count, stretches
from par4_identification.logs.measured_torque import measured_torque
from par4_identification.logs.raw_bag import JointSamples
from par4_identification.logs.reference import reference_of
from par4_identification.logs.refresh import at_refreshes, fresh
from par4_identification.logs.sources import beside_mixed, source_of
from par4_identification.logs.stamped_rows import StampedRows, reordered, stamped_rows
from par4_identification.logs.stamps import EVEN, GAP
from par4_identification.logs.topic_signal import (
    FEWEST_SAMPLES,
    Signal,
    interpolated,
    refuse_two_sources,
    signal_of,
)
from par4_kinematics.errors import InputError
from par4_kinematics.interface import JOINT_STATES
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot


def read_log(path: str | Path, machine: Robot | Axis, namespace: str | None = None) -> Log:
    """Return the log of a bag: positions and torques, repaired and on an even grid.

    The torque is gain x `amplifier_voltage` (24) if that topic has messages, else the effort of
    `joint_states`, which goes first for an axis whose file has no gain. Evenly stamped samples are
    not changed; others are interpolated to the grid, positions and torques each by one cubic spline
    through their own stamps. Every repair is counted in `Log.accounts`.

    Args:
        path: of the bag.
        machine: has the names of the joints and, for voltages, the gains.
        namespace: of the topics; see `read_bag`.

    Raises:
        InputError: the bag cannot be read, lacks joints, positions, torques or stamps, mixes
            several sources nearly throughout, or leaves fewer than 20 samples.
    """
    bag = read_bag(path, namespace)
    joints = machine.joint_names
    states = bag.joints[JOINT_STATES.name]
    rows = stamped_rows(path, states, states.position, joints, 'position')
    if rows is None:
        raise InputError(f'{path}: {states.topic} carries no position of {", ".join(joints)}; '
                         'record a topic with positions')
    source = source_of(rows)
    own = source.of_its_clock(rows)
    clock = Clock(own.received, own.stamp, own.values)
    time = clock.time(own.received, own.stamp)
    source = beside_mixed(source, own, time)
    position = signal_of(path, source.unmixed(own, time), clock)
    refuse_two_sources(path, position)
    torque, torque_source, disagreement, offset = measured_torque(path, bag, machine, clock,
                                                                  source)
    position, torque, filled_in = without_interpolated(position, torque)
    (position, position_held), (torque, torque_held) = fresh(position), fresh(torque)
    position, clipped = without_clipped(position, torque, joints, unit_on(machine, 'rad'))
    if torque.period > max(position.period, GAP * 1e9 * torque.counts.period):
        position = at_refreshes(position, torque)
    together = _put_together(position, machine)
    position = together.position
    position, torque, jitter = evened(position, torque)
    grid = grid_of(position)
    cut = _with_torque(grid, torque, clock)
    ends = np.cumsum([0] + [len(time) for time, _, _ in cut.segments]).tolist()
    samples = ends[-1]
    _refuse_few(path, samples, position, cut)
    time, q, tau = (columns[0] if len(cut.segments) == 1 else np.concatenate(columns)
                    for columns in zip(*cut.segments, strict=True))
    reference, reference_note = reference_of(bag, joints, clock)
    accounts = Accounts(
        bag=str(path), namespace=bag.namespace, duration=1e-9 * float(time[-1] - time[0]),
        samples=samples, segments=len(cut.segments), period=1e-9 * grid.period,
        resampled=grid.resampled, filled=grid.filled, clock_resets=len(clock.joins),
        short_segments=cut.short, without_torque=cut.without_torque,
        torque_source=torque_source, torque_disagreement=disagreement,
        position=position.counts, torque=torque.counts, reordered=reordered(states, joints),
        ignored_joints=tuple(sorted({name for names in states.layouts for name in names}
                                    - set(joints))),
        ignored_topics=bag.ignored, unreadable=bag.unreadable, reference=reference_note,
        clock_offset=offset, other_source=len(rows.stamp) - len(own.stamp),
        mixed=tuple((1e-9 * first, 1e-9 * last) for first, last in source.mixed),
        wraps=together.wraps, restarts=together.restarts,
        jumps=tuple(1e-9 * time for time in grid.jumps), jitter=jitter,
        interpolated=filled_in, clipped=clipped,
        held={name: held for name, held in (('position', position_held), ('torque', torque_held))
              if held})
    return Log(str(path), joints, clock.origin, accounts.period, 1e-9 * time, q, tau,
               tuple(slice(start, end) for start, end in pairwise(ends)), reference, accounts,
               integrated=isinstance(machine, Axis) and _integrated(path, states, rows, joints))


def _refuse_few(path: str | Path, samples: int, position: Signal, cut: _Cut) -> None:
    """Refuse a bag of which so few samples are left that no tool can use them.

    Raises:
        InputError: says where the others went.
    """
    if samples < FEWEST_SAMPLES:
        raise InputError(
            f'{path}: {samples} usable samples of {position.counts.read} '
            f'({position.counts.not_finite} not finite, {cut.without_torque} without torque, '
            f'{cut.short} in segments shorter than {SHORTEST_SEGMENT}), at least {FEWEST_SAMPLES} '
            'are needed; record a longer bag')


def _integrated(path: str | Path, states: JointSamples, rows: StampedRows, joints: Sequence[str]
                ) -> bool:
    """Return whether the positions of rows are the integral of the speeds of the same messages."""
    speeds = stamped_rows(path, states, states.velocity, joints, 'velocity')
    return speeds is not None and are_integrals(rows.stamp, rows.values, speeds.values)


@dataclass(frozen=True)
class _Together:
    """Positions that were put together where readings jump though joints go on; see `Accounts`."""

    position: Signal
    wraps: dict[str, int]
    restarts: dict[str, tuple[int, float, str]]


def _put_together(position: Signal, machine: Robot | Axis) -> _Together:
    """Return positions without the jumps of readings that wrap round or count from new."""
    joints, width = machine.joint_names, np.diff(position.stamp) / position.period
    wraps: dict[str, int] = {}
    if isinstance(machine, Robot) or machine.kind == 'revolute':
        values, often = without_turns(position.values, width)
        position = replace(position, values=values)
        wraps = {joint: times for joint, times in zip(joints, often.tolist(), strict=True) if times}
    if isinstance(machine, Axis):
        q = position.values[:, 0]
        restarts = restarts_of(q, width)
        if restarts is not None:
            position = replace(position, values=going_on(q, restarts)[:, None])
            return _Together(position, wraps, {
                joints[0]: (len(restarts.steps), restarts.way, unit_on(machine, 'rad'))})
    return _Together(position, wraps, {})


@dataclass(frozen=True)
class _Cut:
    """Segments of (time (n,) ns, q (n, J), tau (n, J)), and what was left out to make them.

    `short` are samples of segments that are too short.
    """

    segments: list[tuple[np.ndarray, np.ndarray, np.ndarray]]
    short: int
    without_torque: int


def _with_torque(grid: Grid, torque: Signal, clock: Clock) -> _Cut:
    """Return the segments of a grid where the torque is known."""
    segments, short, without_torque = [], grid.short, 0
    for time, q in grid.pieces:
        tau = interpolated(torque, time, clock, EVEN * grid.period)
        measured = np.isfinite(tau).all(axis=1)
        without_torque += count(~measured)
        for start, end in stretches(measured):
            if end - start < SHORTEST_SEGMENT:
                short += end - start
            else:
                segments.append((time[start:end], q[start:end], tau[start:end]))
    return _Cut(segments, short, without_torque)
