"""Samples of one topic in order on the time axis of a bag, and their values between them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from par4_identification.logs.accounts import SampleCounts
from par4_identification.logs.clock import Clock
from par4_identification.logs.masks import count, stretches, taken
from par4_identification.logs.sources import FOLLOWED, to_and_fro
from par4_identification.logs.stamped_rows import StampedRows
from par4_identification.logs.stamps import CROWDED, GAP, nearest_stamp, spacing_counts
from par4_kinematics.errors import InputError

FILLED = 3
"""Most missing samples in a row that interpolation fills; more cut the log."""
FEWEST_SAMPLES = 20
"""Samples below which a log is refused: a steady speed at a few hertz has no more."""
LARGEST = 1e30
"""rad or N m; no sensor measures more. The squares of larger numbers, which are damaged ones, may
overflow."""
MOST_CONFLICTS = 0.05
"""Fraction of samples with the stamp but not the values of another above which a log is refused."""
MOST_TO_AND_FRO, MOST_UNFOLLOWED = 0.05, 0.6
"""Shares of samples that jump to and fro from which two sources talk in one topic: the second where
samples do not follow the motion, so that up to a third of those of one machine do."""


@dataclass(frozen=True)
class Signal:
    """Finite samples of one topic, in order.

    Attributes:
        stamp: on the time axis of the bag, (n,) ns.
        values: (n, J), as the topic has them.
        period: usual spacing of the stamps, ns.
        counts: what was read, and what of it was left out.
    """

    stamp: np.ndarray
    values: np.ndarray
    period: float
    counts: SampleCounts


def signal_of(path: str | Path, rows: StampedRows, clock: Clock) -> Signal:
    """Return the rows sorted, without repeats and NaN, on the time axis of the bag.

    Raises:
        InputError: too many samples contradict each other, or too few are left.
    """
    stamp = clock.time(rows.received, rows.stamp)
    # rows without a number may be those of another signal, at any time beside those of this one
    whole = (np.abs(rows.values) < LARGEST).all(axis=1)
    order = np.lexsort((~whole, stamp))
    again = np.flatnonzero(np.diff(stamp[order]) == 0) + 1
    beside = ~whole[order[again]] & whole[order[again - 1]]
    order, again = np.delete(order, again[beside]), again[~beside] - np.cumsum(beside)[~beside]
    one, other = rows.values[order[again - 1]], rows.values[order[again]]
    repeated = count(((one == other) | np.isnan(one) & np.isnan(other)).all(axis=1))
    conflicting = len(again) - repeated
    if conflicting > MOST_CONFLICTS * len(stamp):
        raise InputError(
            f'{path}: {conflicting} of {len(stamp)} samples on {rows.topic} have the stamp of '
            'another but other values (two machines or simulations on one topic, or a clock set '
            'back that also told when messages were received); record one at a time, on the clock '
            'of the system')
    order = np.delete(order, again)
    crowded = np.zeros(len(order), dtype=bool)
    own = np.flatnonzero(whole[order])
    if len(own) > 2:
        spacing = np.diff(stamp[order[own]])
        crowded[own[1:]] = spacing < CROWDED * np.median(spacing)
        order = order[~crowded]
    received_order = stamp[np.sort(order)]
    out_of_order = count(received_order < np.maximum.accumulate(received_order))
    even = spacing_counts(stamp[order], clock.run(stamp[order]))
    finite = whole[order]
    counts = SampleCounts(
        topic=rows.topic, **rows.dropped, repeated=repeated, conflicting=conflicting,
        crowded=count(crowded), not_finite=count(~finite) + count(beside),
        out_of_order=out_of_order, **vars(even))
    order = order[finite]
    if len(order) < 2 or not counts.period:
        lost = f' of {counts.read} ({counts.not_finite} not finite)' if counts.not_finite else ''
        advice = ('record every joint as a number' if counts.not_finite > FEWEST_SAMPLES else
                  'record a longer bag')
        raise InputError(f'{path}: {len(order)} usable samples{lost} on {rows.topic}, at least '
                         f'{FEWEST_SAMPLES} are needed; {advice}')
    stamp = taken(stamp, order)
    # a logger that merges signals of several rates leaves the cells of the slower ones empty
    apart = float(np.median(np.diff(stamp)))
    period = 1e9 * counts.period
    return Signal(stamp, taken(rows.values, order), apart if apart > GAP * period else period,
                  counts)


def refuse_two_sources(path: str | Path, position: Signal) -> None:
    """Refuse positions that jump to and fro between two machines.

    Raises:
        InputError: they do.
    """
    jumps = count(to_and_fro(position.values))
    steps = len(position.values) - 1
    most = MOST_TO_AND_FRO if position.period <= FOLLOWED else MOST_UNFOLLOWED
    if jumps > most * steps:
        raise InputError(
            f'{path}: positions on {position.counts.topic} jump to and fro in {jumps} '
            f'of {steps} samples (two machines or simulations on one topic); record one source '
            'at a time, in a namespace or ROS_DOMAIN_ID of its own')


def interpolated(signal: Signal, time: np.ndarray, clock: Clock, tolerance: float) -> np.ndarray:
    """Return values (n, J) at times (n,) ns; NaN outside the samples and in their long gaps.

    A sample within `tolerance`, ns, of a time is taken as it is. Between samples values follow
    cubic splines: straight lines are a low-pass, which took 1.4 % off the torque of a fast motion
    that was read at 100 Hz beside positions at 1 kHz.
    """
    stamp = signal.stamp
    nearest = nearest_stamp(stamp, time)
    values = signal.values[nearest]
    between = np.flatnonzero(np.abs(stamp[nearest] - time) > tolerance)
    if not len(between):
        return values
    far = np.round(np.diff(stamp) / signal.period) - 1 > FILLED
    broken = far | (clock.run(stamp[:-1]) != clock.run(stamp[1:]))
    values[between] = np.nan
    for start, end in stretches(~broken):
        inside = between[(time[between] > stamp[start]) & (time[between] < stamp[end])]
        if len(inside):
            values[inside] = _curve(stamp[start:end + 1], signal.values[start:end + 1],
                                    time[inside], signal.period)
    return values


def _curve(stamp: np.ndarray, values: np.ndarray, time: np.ndarray, period: float) -> np.ndarray:
    """Return cubic splines through values (n, J) at times (m,), joint by joint, for the memory."""
    from scipy.interpolate import CubicSpline  # slow to load, and not always needed

    x, at = (stamp - stamp[0]) / period, (time - stamp[0]) / period
    return np.stack([CubicSpline(x, own)(at) for own in values.T], axis=1)
