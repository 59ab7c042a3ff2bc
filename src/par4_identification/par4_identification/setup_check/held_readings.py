"""Readings that repeat though the machine moves: encoders that freeze, loggers that hold.

They repeat a reading exactly and jump when they go on. Encoder counts repeat readings, too, but
then the next one is a count away: a jump must be many counts and many times what the joint travels
in a sample.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_identification.logs.jumps import AROUND, COUNTS, count_of, resolution
from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches
from par4_identification.setup_check.flat_tops import flat_tops

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
AT_ONCE = 100.0
"""Ratio of a jump of a torque to what it usually goes in the time for which it stood, from which it
was switched: by random steps, or as a controller that turns round at a limit does."""
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
    keeps its acceleration, as at a steady speed, and jumps where that ends. One that is switched
    stands in between, and changes by no more than what put it on other stamps did.
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
        if (AT_ONCE * (end - start) * usual > jump > FASTER * usual
                and (jumps > COUNTS * steps).any() and (moved > COUNTS * counts).any()):
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
