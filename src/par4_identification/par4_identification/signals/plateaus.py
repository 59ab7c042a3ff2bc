"""Stretches in which an axis holds its speed: each says one thing, its mean torque.

Friction is often measured so: one speed after the other is held for seconds and the drive averages
its torque. Such logs may be slow. Within a plateau the samples repeat one another, so that each
plateau is one row, however many samples it has.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.logs.log import Log

LEAST_TIME = 2.0
"""s that a speed must be held."""
LEAST_SAMPLES = 16
EVEN = 0.1
"""Share of the speed by which that of a part of a plateau may differ from the whole."""
STRAIGHT = 0.02
"""Share of its way by which the position may leave a straight line."""
PARTS = 5
"""Parts of a plateau whose speeds are compared."""
ENDS = 0.1
"""Share of a plateau left out at either end, where the speed may still change."""
COVERED = 0.8
"""Share of its time in motion that the plateaus of a log must fill, on average over the logs."""
LEAST_PLATEAUS = 10
"""Steady speeds that a fit needs."""
SPEEDS = 6
"""Different speeds from which on logs of any rate are taken for a measurement of steady speeds."""
SPEEDS_APART = 0.05
"""Share by which speeds differ that count as different."""
BATCHES = 10
"""Parts of a plateau whose means tell how well the mean torque of all is known."""
PLACES = 360
"""Places of a turn, or of the way of a slide, at which torques of plateaus are compared."""
IN_COMMON = 0.5
"""Share of the squares of what a torque does within plateaus that it must do again at the same
places in other plateaus to be one that follows the position."""


@dataclass(frozen=True)
class Plateau:
    """A stretch of constant speed.

    Attributes:
        time: from its start to its end, s.
        q: mean position, rad or m.
        speed: mean, rad/s or m/s.
        torque: mean, N m or N.
        deviation: standard deviation of that mean, from the means of its parts.
    """

    time: float
    q: float
    speed: float
    torque: float
    deviation: float


def plateaus_of(log: Log) -> list[Plateau]:
    """Return the plateaus of the log of one joint, in the order of time."""
    found = []
    for time, t, q, torque in _samples_of_plateaus(log):
        slope, _ = np.polyfit(t - t[0], q, 1)
        means = [float(part.mean()) for part in np.array_split(torque, BATCHES)]
        found.append(Plateau(time, float(q.mean()), float(slope), float(np.mean(means)),
                             float(np.std(means, ddof=1) / np.sqrt(BATCHES))))
    return found


def follow_the_position(logs: Sequence[Log], turns: bool) -> bool:
    """Return whether torques within plateaus are the same again at the same places in others.

    Or friction is, which has the sign of the speed. Their means then leave out most of what they
    tell: cogging, the weight of an arm, a tight spot.

    Args:
        logs: of one joint.
        turns: whether it turns, so that a place may come again after a turn.
    """
    parts = [(q, torque) for log in logs
             for _, _, q, torque in _samples_of_plateaus(log)]
    if len(parts) < 2:
        return False
    everywhere = np.concatenate([q for q, _ in parts])
    whole = float(everywhere.min()), float(np.ptp(everywhere)) + 1e-12
    rubbing = [(q, torque * np.sign(q[-1] - q[0])) for q, torque in parts]
    return any(_follow_places(own, start, way) for own in (parts, rubbing)
               for start, way in ((whole, (0.0, 2.0 * np.pi)) if turns else (whole,)))


def _follow_places(parts: Sequence[tuple[np.ndarray, np.ndarray]], start: float, way: float
                   ) -> bool:
    """Return whether torques of plateaus are the same again at the same places of a way.

    Args:
        parts: positions and torques (n,) of each plateau.
        start, way: where the places begin, and after which way they come again.
    """
    count, total = np.zeros((2, len(parts), PLACES))
    for part, (q, torque) in enumerate(parts):
        place = ((q - start) / way % 1.0 * PLACES).astype(int)
        count[part] = np.bincount(place, minlength=PLACES)
        total[part] = np.bincount(place, torque, minlength=PLACES)
    there = count > 0.0
    mean = total / np.maximum(count, 1.0)
    squares = left = 0.0
    for own, others in ((slice(0, None, 2), slice(1, None, 2)),
                        (slice(1, None, 2), slice(0, None, 2))):
        common = there[own] & there[others].any(axis=0)
        told = _without_means(mean[own], common)
        again = _without_means(np.broadcast_to(
            _over_places(mean[others], there[others]), told.shape), common)
        squares += float(np.sum(told ** 2))
        left += float(np.sum((told - again) ** 2))
    return left < (1.0 - IN_COMMON) * squares


def _over_places(torque: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return the torque (places,) that plateaus (m, places) have in common.

    Each has a mean of its own besides, as each goes over other places at another speed.
    """
    weight = there / np.maximum(there.sum(axis=0), 1)
    rows = np.where(there, torque - np.sum(weight * torque, axis=0), 0.0).sum(axis=1)
    own = np.linalg.lstsq(np.diag(there.sum(axis=1)) - weight @ there.T.astype(float), rows,
                          rcond=None)[0]
    return np.asarray(np.sum(weight * (torque - own[:, None]), axis=0))


def _without_means(torque: np.ndarray, there: np.ndarray) -> np.ndarray:
    """Return torques (m, places) less the mean of each plateau where they are known, else 0."""
    mean = np.sum(torque * there, axis=1) / np.maximum(there.sum(axis=1), 1)
    return np.where(there, torque - mean[:, None], 0.0)


def _samples_of_plateaus(log: Log) -> Iterator[tuple[float, np.ndarray, np.ndarray, np.ndarray]]:
    """Yield how long each plateau lasts, s, with times, positions and torques (n,) of its inside.

    Samples in doubt are left out.
    """
    for segment in log.segments:
        t, q, torque = log.t[segment], log.q[segment, 0], log.tau[segment, 0]
        sound = (np.ones(len(t), dtype=bool) if log.doubtful is None
                 else ~log.doubtful[segment, 0])
        for first, last in _held(t, q):
            cut = round(ENDS * (last - first))
            inner = np.flatnonzero(sound[first + cut:last - cut]) + first + cut
            if len(inner) >= LEAST_SAMPLES:
                yield float(t[last - 1] - t[first]), t[inner], q[inner], torque[inner]


def hold_speeds(logs: Sequence[Log], slowest_hz: float) -> bool:
    """Return whether logs of an axis are measurements of steady speeds.

    They are where plateaus fill them, and either many speeds are held, enough to hold some out, or
    a log is slower than `slowest_hz`, so that nothing else could be made of it.
    """
    held = [plateaus_of(log) for log in logs]
    speeds = [item.speed for plateaus in held for item in plateaus]
    covered = [sum(item.time for item in plateaus) / max(_time_in_motion(log), log.period)
               for log, plateaus in zip(logs, held)]
    if not speeds or np.mean(np.minimum(covered, 1.0)) < COVERED:
        return False
    slow = any(1.0 / log.period < slowest_hz for log in logs)
    fitted = int(np.sum(~every_third_between(np.array(speeds))))
    return slow or bool(_different(speeds) >= SPEEDS and fitted >= LEAST_PLATEAUS)


def every_third_between(speeds: np.ndarray) -> np.ndarray:
    """Return which plateaus (m,) to hold out: every third either way, never the outermost."""
    kept = np.zeros(len(speeds), dtype=bool)
    for side in (speeds > 0.0, speeds < 0.0):
        own = np.flatnonzero(side)
        kept[own[np.argsort(np.abs(speeds[own]))][1:-1:3]] = True
    return kept


def scatter(speeds: np.ndarray, torques: np.ndarray) -> float:
    """Return the variance by which torques (m,) miss any smooth function of speeds (m,).

    Each is compared with the line through its neighbours of the same direction (Gasser, Sroka and
    Jennen-Steinmetz 1986). It holds what makes plateaus differ though the mean of each is known
    well, such as friction that depends on the place.
    """
    squares = []
    for side in (speeds > 0.0, speeds < 0.0):
        order = np.argsort(speeds[side])
        v, f = speeds[side][order], torques[side][order]
        for before, here, after in zip(range(len(v)), range(1, len(v)), range(2, len(v))):
            share = (v[here] - v[before]) / max(v[after] - v[before], 1e-30)
            miss = f[here] - (1.0 - share) * f[before] - share * f[after]
            squares.append(miss ** 2 / (1.0 + share ** 2 + (1.0 - share) ** 2))
    # the median: where the function bends sharply, a neighbour says little
    return float(np.median(squares) / 0.455) if squares else 0.0


def _held(t: np.ndarray, q: np.ndarray) -> list[tuple[int, int]]:
    """Return the first and last row (exclusive) of stretches of constant speed."""
    found, open_stretches = [], [(0, len(t))]
    while open_stretches:
        first, last = open_stretches.pop()
        if last - first < LEAST_SAMPLES or t[last - 1] - t[first] < LEAST_TIME:
            continue
        own_t, own_q = t[first:last], q[first:last]
        if _even(own_t, own_q):
            found.append((first, last))
            continue
        chord = own_q[0] + (own_q[-1] - own_q[0]) * (own_t - own_t[0]) / (own_t[-1] - own_t[0])
        corner = first + int(np.argmax(np.abs(own_q - chord)))
        if first < corner < last - 1:
            open_stretches += [(corner, last), (first, corner)]
    return sorted(found)


def _even(t: np.ndarray, q: np.ndarray) -> bool:
    """Return whether positions (n,) go on at one speed."""
    slope, start = np.polyfit(t - t[0], q, 1)
    way = abs(slope) * (t[-1] - t[0])
    if way <= 0.0 or np.max(np.abs(q - start - slope * (t - t[0]))) > STRAIGHT * way:
        return False
    bounds = np.linspace(0, len(t) - 1, PARTS + 1).astype(int)
    speeds = np.diff(q[bounds]) / np.diff(t[bounds])
    return bool(np.all(np.abs(speeds - slope) <= EVEN * abs(slope)))


def _time_in_motion(log: Log) -> float:
    """Return how long an axis moves, s: faster than a hundredth of its fastest."""
    total = 0.0
    for segment in log.segments:
        t, q = log.t[segment], log.q[segment, 0]
        step = max(1, round(0.5 / log.period))
        speed = np.abs(q[step:] - q[:-step])
        if len(speed):
            total += float(np.mean(speed > 0.01 * speed.max()) * (t[-1] - t[0]))
    return total


def _different(speeds: Sequence[float]) -> int:
    """Return how many different speeds there are."""
    known: list[float] = []
    for speed in sorted(speeds):
        if not known or abs(speed - known[-1]) > SPEEDS_APART * max(abs(speed), abs(known[-1])):
            known.append(speed)
    return len(known)
