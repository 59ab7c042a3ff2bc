"""Faults that the samples tell by themselves, without any model.

An encoder that freezes and a logger that holds repeat a reading exactly while the machine moves,
and jump when they go on; a slip jumps and stays; a spike jumps and comes back; a converter that
clips repeats its largest value; a torque without a sensor stands still while its joint turns
round, or is that of another. Encoder counts repeat readings too, but then the next one is a
count away: a jump must be many counts and many times what the joint travels in a sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from par4_identification.logs.jumps import (
    AROUND,
    BEYOND,
    COUNTS,
    SMALLEST,
    WIDEST,
    count_of,
    jumps_of,
    resolution,
)
from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches

FEWEST = 4
"""Samples in a row that a held reading repeats."""
BY_CHANCE = 0.05
"""Runs of a log as long as one that chance may make, at the most, for that one to be held."""
COARSE, COUNTED = 500.0, 3.0
"""Steps in the range of a torque up to which they are coarse, as those of a signed byte or of per
cent, and counts of an encoder that make a cubic along its readings at the most."""
APART = 0.05
"""s over which the acceleration of a joint is taken beside its torque."""
FASTER = 3.0
"""Ratio of a jump to what the joint travels in a sample, beside it."""
BRIEF, UNMOVED = 0.06, 4.0
"""s up to which a joint cannot have turned round unseen, and ratio of a jump to what the joint
travels in that time at the speed beside it, from which the jump is no end of a held reading."""
MADE_UP = 0.3
"""Of a joint beside which no other tells that the machine moved: least part of the way at the speed
beside a held reading that its jump makes up, and least ratio of the speeds before and after."""
BESIDE = 0.2
"""Most that other joints travel, in the jump, while a joint rested before it slipped."""
SLIGHT = 0.02
"""Least jump at the end of a held reading, over what the joint travels in a sample at full speed:
controllers that interpolate between encoder counts tell less of them."""
STOPPED = 3.0
"""Encoder counts a sample: from a higher speed no drive stops a joint within a sample."""
CHANGES = 6
"""Changes of a reading beside a run that tell how coarse it is there: a file with a fixed number of
digits writes large values in larger steps than small ones."""
SLOWLY = 400
"""Samples within which they must come."""
TRAVEL = 0.1
"""rad that other joints travel while a reading that stopped at once stands still."""
LONG_TRAVEL = 0.4
"""The same where a reading never changes."""
UNSLOWED = 0.5
"""Least part of the speed before it that the last step of a reading that stopped at once has."""
OFTEN = 0.01
"""Share of samples from which deviations are no spikes but noise."""
PART_OF_RANGE = 0.45
"""Least spike of a torque, of its largest usual size; drives that answer single encoder counts
give pulses of a tenth, loads that rattle of a third."""
RARE = 4.0
"""Ratio of a torque's spike to what two samples in a thousand exceed: gaps and springs ring."""
AGREE = 0.3
"""Most by which the neighbours of a spike may differ, of its size."""
FLAT, FLATS, FLAT_RUNS = 4, 20, 3
"""A torque is clipped if it stays at its largest value for so many samples in a row, for so many in
all, and so often."""
PILED = 4.0
"""Ratio of the samples at that value to those at the one next to it, at the least."""
SWITCHED = 0.4
"""Part of the range of a torque by which it usually comes to its end or leaves it where it is not
clipped but switched, as by a relay or by random steps; what is clipped comes near its end first."""
MUTE, OUT_AND_BACK = 0.1, 0.2
"""A torque that stays exactly the same for so many seconds is not measured if its joint meanwhile
goes out and back by so much of its range: turning round takes torque, for friction and inertia."""
LASTING = 0.9
"""Least speed at the end over that at the beginning, of a joint that something drives."""
COPIED, APART_WAY = 1.0, 0.2
"""Of two torques that are equal to the last bit for so many seconds one is a copy, if the two
joints meanwhile move apart by so much of the range of one."""


@dataclass(frozen=True)
class Held:
    """A stretch over which readings repeat.

    Attributes:
        start, end: rows; the reading of `start` is the last true one, `end` is the first new one.
        joints: whose positions repeat; empty where only torques do.
        torque: whether the torques of all joints repeat too.
    """

    start: int
    end: int
    joints: tuple[int, ...]
    torque: bool


def held_stretches(log: Log) -> list[Held]:
    """Return where readings repeat though the machine moves, in order.

    Torques that stand at their end are clipped, not held.
    """
    found, flat = [], flat_tops(log)
    finest = [resolution(own) for own in log.q.T]  # a short segment at rest does not tell it
    for segment in log.segments:
        q, tau = log.q[segment], log.tau[segment]
        if len(q) < 4 * AROUND:
            continue
        frozen = [_frozen_runs(q, joint, finest[joint], log.period)
                  for joint in range(q.shape[1])]
        stands = (np.diff(tau, axis=0) == 0.0).all(axis=1)
        still = np.diff(q, axis=0) == 0.0
        together: dict[int, list[tuple[int, int, bool]]] = {}  # what goes on at the same row
        for joint, runs in enumerate(frozen):
            for start, end, sudden in runs:
                together.setdefault(end, []).append((start, joint, sudden))
        repeats = {end + 1: start for start, end in stretches(stands) if end + 1 - start >= FEWEST}
        for end, starts in sorted(together.items()):
            # a torque that repeats up to the same row says that the logger held, and from when
            start = repeats.get(end, max(begun for begun, _, _ in starts))
            joints = {joint for _, joint, _ in starts}
            if len(joints) == 1 and starts[0][2] and end not in repeats:
                continue  # a slip after a rest
            joints |= set(np.flatnonzero(still[start:end - 1].all(axis=0)).tolist())
            found.append(Held(segment.start + start, segment.start + end, tuple(sorted(joints)),
                              bool(stands[start:end - 1].all())))
        at_end = np.asarray(flat[segment].all(axis=1))
        found += _held_torques(q, tau, stands & ~at_end[1:], segment.start, log.period)
    return _distinct(found)


def _held_torques(q: np.ndarray, tau: np.ndarray, stands: np.ndarray, offset: int, period: float
                  ) -> list[Held]:
    """Return where all torques repeat exactly while positions go on, and then jump.

    A torque in coarse steps repeats by chance, mostly once, and changes by a step or two then. How
    often it repeats once tells how seldom it repeats for longer. It also stands as long as a joint
    keeps its acceleration, as at a steady speed, and jumps where that ends.
    """
    found, runs = [], list(stretches(stands))
    inertia: np.ndarray | None = None
    once = sum(last - start == 1 for start, last in runs) / max(len(stands), 1)
    counts, steps = (np.array([resolution(own) for own in part.T]) for part in (q, tau))
    coarse = (steps * COARSE > np.ptp(tau, axis=0)).all()
    for start, last in runs:
        end = last + 1
        if end - start < FEWEST or end >= len(q) or (np.diff(q[start:end], axis=0) == 0.0).all():
            continue
        if len(stands) * once ** (end - start - 1) > BY_CHANCE:
            continue
        if coarse:
            inertia = _inertias(q, tau, period) if inertia is None else inertia
            if (inertia * _acceleration(q[start:end + 1], counts, period) < steps).all():
                continue
        jumps = np.abs(tau[end] - tau[end - 1])
        jump = jumps.max()
        usual = np.median(np.abs(np.diff(tau[max(start - 50, 0):start + 1], axis=0)).max(axis=1)) \
            if start > AROUND else 0.0
        moved = np.abs(q[end - 1] - q[start])
        if (jump > FASTER * usual > 0.0 and (jumps > COUNTS * steps).any()
                and (moved > COUNTS * counts).any()):
            found.append(Held(offset + start, offset + end, (), True))
    return found


def _inertias(q: np.ndarray, tau: np.ndarray, period: float) -> np.ndarray:
    """Return about the torque that an acceleration of each joint takes, (J,), beside friction."""
    apart = max(1, round(APART / period))
    before, here, after = q[:-2 * apart], q[apart:-apart], q[2 * apart:]
    speed, bent = (after - before) / (2.0 * apart * period), after - 2.0 * here + before
    return np.array([abs(np.linalg.lstsq(
        np.stack((a, v, np.sign(v), np.ones_like(v)), axis=1), own, rcond=None)[0][0])
        for a, v, own in zip((bent / (apart * period) ** 2).T, speed.T, tau[apart:-apart].T)])


def _acceleration(q: np.ndarray, counts: np.ndarray, period: float) -> np.ndarray:
    """Return by how much the acceleration of joints changes along readings (n, J), (J,).

    It is that of a cubic; none where counts (J,) may have made the cubic.
    """
    half = 0.5 * (len(q) - 1) * period
    cubic = np.abs(np.polynomial.polynomial.polyfit(np.linspace(-1.0, 1.0, len(q)), q, 3)[3])
    return np.where(cubic > COUNTED * counts, 12.0 * cubic / half ** 2, 0.0)


@dataclass(frozen=True)
class Mute:
    """A stretch over which the torque of a joint is not its own.

    Attributes:
        start, end: rows, the end excluded.
        joint: whose torque it is.
        copied_from: the joint whose torque is told again; None where the torque stands still.
    """

    start: int
    end: int
    joint: int
    copied_from: int | None


def mute_torques(log: Log, swings: bool = True) -> list[Mute]:
    """Return where a torque stands still while its joint turns round, or is that of another.

    A drive at its limit may turn a joint round, and one without power lets it swing. So a torque
    that moves elsewhere must stand below its largest, and beside torques that move unless nothing
    `swings` the joint but its drive. Without power a joint slows down, so that a torque of nothing
    at a lasting speed is none that moves the joint.
    """
    way, top = np.ptp(log.q, axis=0), np.abs(log.tau).max(axis=0)
    dead = np.ptp(log.tau, axis=0) == 0.0
    found = []
    for segment in log.segments:
        q, tau = log.q[segment], log.tau[segment]
        for joint in range(q.shape[1]):
            for start, last in stretches(np.diff(tau[:, joint]) == 0.0):
                end = last + 1
                if end - start < max(FEWEST, MUTE / log.period):
                    continue
                own, beside = q[start:end, joint], np.delete(tau[start:end], joint, axis=1)
                silent = dead[joint] or (abs(tau[start, joint]) < top[joint] and (
                    not swings or bool(np.ptp(beside, axis=0).any())))
                turns = np.ptp(own) - abs(own[-1] - own[0]) > OUT_AND_BACK * way[joint] > 0.0
                carried = (tau[start, joint] == 0.0 and (end - start) * log.period >= COPIED
                           and np.ptp(own) > OUT_AND_BACK * way[joint] > 0.0 and _lasts(own))
                if (silent and turns) or carried:
                    found.append(Mute(segment.start + start, segment.start + end, joint, None))
            for other in range(joint):
                for start, end in stretches(tau[:, joint] == tau[:, other]):
                    apart = np.ptp(q[start:end, joint] - q[start:end, other])
                    if (end - start) * log.period >= COPIED and apart > APART_WAY * way[joint] and (
                            np.ptp(tau[start:end, joint]) > 0.0):
                        found.append(Mute(segment.start + start, segment.start + end, joint, other))
    return found


def _lasts(q: np.ndarray) -> bool:
    """Return whether a joint whose positions are (n,) ends no slower than it begins."""
    quarter = len(q) // 4
    before, after = q[quarter] - q[0], q[-1] - q[-1 - quarter]
    return bool(before * after > LASTING * before ** 2)


def _distinct(found: list[Held]) -> list[Held]:
    """Return the stretches of which none lies in another that holds as many joints."""
    kept: list[Held] = []
    for item in sorted(found, key=lambda held: (-len(held.joints), held.start, -held.end)):
        if not any(other.start <= item.start and item.end <= other.end
                   and set(item.joints) <= set(other.joints) for other in kept):
            kept.append(item)
    return sorted(kept, key=lambda held: held.start)


def _frozen_runs(q: np.ndarray, joint: int, finest: float, period: float
                 ) -> list[tuple[int, int, bool]]:
    """Return the runs over which a joint's reading repeats though the joint must move.

    With each goes whether its end is so sudden that the joint cannot have moved so far meanwhile.

    Args:
        q: readings of a segment, (n, J).
        joint: whose runs.
        finest: smallest usual step of its readings in the whole log.
        period: between samples, s.
    """
    own = q[:, joint]
    least = SLIGHT * float(np.quantile(np.abs(np.diff(own)), 0.95))
    found = []
    for start, last in stretches(np.diff(own) == 0.0):
        end = last + 1  # the first row with another reading
        if end - start < FEWEST:
            continue
        count = max(finest, _count_beside(own, start, end))
        before = abs(own[start] - own[max(start - AROUND, 0)]) / AROUND
        if end < len(own):
            jump = abs(own[end] - own[end - 1])
            after = abs(own[min(end + AROUND, len(own) - 1)] - own[end]) / AROUND
            speed = max(before, after)
            rested = q.shape[1] == 1 and (min(before, after) < MADE_UP * speed
                                          or jump < MADE_UP * speed * (end - start))
            if jump > max(COUNTS * count, FASTER * speed, least) and not rested:
                short = (end - start) * period < BRIEF
                alone = q.shape[1] > 1 and _travel_beside(q[start:end + 1], joint) < BESIDE * jump
                found.append((start, end, alone or (
                    short and jump > UNMOVED * speed * (end - start))))
                continue
        # a joint that comes to rest slows down first; a reading that stops does not
        last_step = abs(own[start] - own[max(start - 1, 0)])
        stopped = last_step > max(STOPPED * count, UNSLOWED * before) > 0.0
        travel = _travel_beside(q[start:end], joint)
        if (stopped and travel > TRAVEL) or (
                end - start == len(own) and travel > LONG_TRAVEL):
            found.append((start, end, False))
    return found


def _count_beside(own: np.ndarray, start: int, end: int) -> float:
    """Return the count of a reading (n,) before or after rows, rad, where most samples repeat."""
    counts = [0.0]
    for beside in (own[start::-1], own[end:]):
        steps = np.abs(np.diff(beside[:SLOWLY]))
        moved = np.flatnonzero(steps)[:CHANGES]
        if len(moved) == CHANGES <= 0.5 * moved[-1]:
            counts.append(count_of(steps[moved]))
    return max(counts)


def _travel_beside(q: np.ndarray, joint: int) -> float:
    """Return the most that a joint other than this one travels in rows q (n, J), rad."""
    return float(np.ptp(np.delete(q, joint, axis=1), axis=0).max(initial=0.0))


def slips(log: Log) -> list[tuple[int, int, float]]:
    """Return row, joint and size, rad, of readings that jump and stay."""
    found = []
    for segment in log.segments:
        q = log.q[segment]
        if len(q) < 4 * AROUND:
            continue
        for joint in range(q.shape[1]):
            off, large = jumps_of(q[:, joint])
            found += [(segment.start + int(row) + 1, joint, float(off[row]))
                      for row in np.flatnonzero(large) if AROUND <= row < len(off) - AROUND]
    return found


def spikes(log: Log, column: str) -> np.ndarray:
    """Return which samples (n, J) of 'q' or 'tau' stand out of their neighbours and come back."""
    values = getattr(log, column)
    found = np.zeros(values.shape, dtype=bool)
    for segment in log.segments:
        part = values[segment]
        if len(part) < 4 * AROUND:
            continue
        for joint in range(part.shape[1]):
            size = np.ascontiguousarray(part[:, joint])
            own = np.abs(size - scipy.ndimage.median_filter(size, 2 * WIDEST + 1, mode='mirror'))
            scatter = max(1.4826 * float(np.median(own)), float(np.quantile(own, 0.99)) / 2.6)
            least = max(BEYOND * scatter, max(SMALLEST, COUNTS * resolution(size))
                        if column == 'q' else
                        max(PART_OF_RANGE * float(np.quantile(np.abs(size), 0.999)),
                            RARE * float(np.quantile(own, 0.998))))
            mask = own > least
            if np.count_nonzero(mask) > OFTEN * len(own):
                continue
            for first, last in stretches(mask):
                # beside a spike the medians are off by what the joint travels in a sample
                high = first + np.flatnonzero(own[first:last] > 0.5 * own[first:last].max())
                start, end = int(high[0]), int(high[-1]) + 1
                # drives answer encoder counts by pulses; a spike has neighbours that agree
                beside = size[max(start - 1, 0)], size[min(end, len(size) - 1)]
                peak = own[start:end].max()
                off = np.abs(size[start:end] - 0.5 * sum(beside)).min()
                if (end - start <= WIDEST and abs(beside[1] - beside[0]) < AGREE * peak
                        and off > 0.5 * peak and _off_the_curve(size, start, end) > 0.5 * peak):
                    found[segment.start + start:segment.start + end, joint] = True
    return found


def _off_the_curve(values: np.ndarray, start: int, end: int) -> float:
    """Return by how much values between two rows are off the cubic through two on either side.

    At a low rate the quick turn of a joint stands out of the median of its neighbours, too, but
    the curve through them goes round with it.
    """
    rows = np.array([start - 2, start - 1, end, end + 1])
    rows = rows[(rows >= 0) & (rows < len(values))]
    curve = np.polynomial.Polynomial.fit(rows, values[rows], len(rows) - 1)
    return float(np.abs(values[start:end] - curve(np.arange(start, end))).min())


def flat_tops(log: Log) -> np.ndarray:
    """Return which torques (n, J) stand at their end as those of a full converter do.

    Both ends are looked at, which need not be as far from zero. A torque in coarse steps stands at
    its largest value, too, but hardly more often than at the one beside it, and one that switches
    between levels comes from another level.
    """
    flat = np.zeros(log.tau.shape, dtype=bool)
    for joint, tau in enumerate(log.tau.T):
        least, most = tau.min(), tau.max()
        if least == most:
            continue
        often = np.unique(tau[(least < tau) & (tau < most)], return_counts=True)[1]
        ends = [end for end, outward, beside in ((least, least < 0.0, often[:1].sum()),
                                                 (most, most > 0.0, often[-1:].sum()))
                if outward and np.count_nonzero(tau == end) > PILED * beside]
        runs = [run for end in ends for run in stretches(tau == end) if run[1] - run[0] >= FLAT]
        steps = np.abs(np.diff(tau))[[row - 1 for run in runs for row in run if 0 < row < len(tau)]]
        switches = len(steps) > 0 and np.median(steps) > SWITCHED * (most - least)
        if (len(runs) >= FLAT_RUNS and not switches
                and sum(end - start for start, end in runs) >= FLATS):
            flat[:, joint] = np.isin(tau, ends)
    return flat
