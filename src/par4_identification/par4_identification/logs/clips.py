"""Positions and speeds that stand at the end of their range though the joint goes on.

A converter, a scaling or a message that is too narrow repeats its largest value until the reading
comes back. A joint that rests, that waits at a stop or that keeps a speed repeats its reading, too.
Two things tell them apart. A joint slows down before it rests or speeds up slowly after it, while a
reading that clips comes and goes with a slope. A speed that is kept does so as well, and a joint
whose encoder is coarse. But their torque changes at the ends of such a stretch, and that of a
joint that goes on does so meanwhile.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from par4_identification.logs.jumps import COUNTS, resolution
from par4_identification.logs.masks import stretches
from par4_identification.logs.topic_signal import LARGEST, Signal

FLAT, FLATS, FLAT_RUNS = 4, 20, 3
"""Readings are clipped if they stay at an end of the log for so many samples in a row, for so many
in all, and so often."""
SWITCHED = 0.4
"""Part of the range of a torque by which it usually comes to its end or leaves it where it is not
clipped but switched, as by a relay or by random steps; what is clipped comes near its end first."""
FINE = 300.0
"""Least range of readings over their count: a coarser encoder hides how a joint slows down."""
NEAREST = 3
"""Samples, at the least, from which the way of readings to their end is judged; they must make more
than `COUNTS` counts."""
SLOPE = 2.5
"""Way to the end over twice as many samples, over that way, at the most: two of a line, four of a
joint that slows down evenly. Readings that were clipped for 3 to 16 % of the time had 2.0 to 2.4 on
either side, those of joints that rested or turned round on counts 2.7 at the least."""
INSIDE = 0.25
"""Least part of the change of the torque, from before such a stretch to after it, that comes within
it: 0.4 to 1.3 where readings were clipped, up to 0.06 in speeds that were kept and 0.11 in rests
that came again."""


def clips_of(values: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return quantity -> which of its readings (n, J) are clipped, of 'position' and 'velocity'.

    Without a torque or voltage beside them nothing tells.
    """
    torque = values.get('torque', values.get('voltage'))
    if torque is None:
        return {}
    return {name: np.stack([clipped(*own) for own in zip(values[name].T, torque.T, strict=True)],
                           axis=1) for name in ('position', 'velocity') if name in values}


def without_clipped(position: Signal, torque: Signal, joints: Sequence[str], unit: str
                    ) -> tuple[Signal, dict[str, tuple[float, tuple[float, ...], str]]]:
    """Return the samples with no position clipped, and of which joints it is, see `Accounts`."""
    beside = np.stack([np.interp(position.stamp, torque.stamp, tau) for tau in torque.values.T],
                      axis=1)
    mask = clips_of({'position': position.values, 'torque': beside})['position']
    if not mask.any():
        return position, {}
    kept = ~mask.any(axis=1)
    return replace(position, stamp=position.stamp[kept], values=position.values[kept]), {
        joint: (float(own.mean()), levels_of(q, own), unit)
        for joint, q, own in zip(joints, position.values.T, mask.T, strict=True) if own.any()}


def levels_of(values: np.ndarray, mask: np.ndarray) -> tuple[float, ...]:
    """Return at which of their values (n,) readings stand where a mask (n,) is true."""
    return tuple(np.unique(values[mask]).tolist())


def clipped(values: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Return which readings (n,) of a joint are clipped, (n,).

    Args:
        values: positions, or speeds.
        torque: beside them, (n,); what has no number is taken from its neighbours.
    """
    found = np.zeros(len(values), dtype=bool)
    rows, known = (np.flatnonzero(np.abs(own) < LARGEST) for own in (values, torque))
    own = values[rows]
    if not len(own) or not len(known) or np.ptp(own) <= FINE * resolution(own):
        return found
    tau = np.interp(rows, known, torque[known])
    for end in (own.min(), own.max()):
        runs = [run for run in stretches(own == end) if run[1] - run[0] >= FLAT]
        if (len(runs) >= FLAT_RUNS and sum(last - first for first, last in runs) >= FLATS
                and _comes_and_goes(own, end, runs) and _goes_on(tau, runs)):
            found[rows[own == end]] = True
    return found


def _comes_and_goes(values: np.ndarray, end: float, runs: Sequence[tuple[int, int]]) -> bool:
    """Return whether readings mostly come to an end and leave it with a slope."""
    way, near = np.abs(values - end), COUNTS * resolution(values)
    for parts in ([way[:first][::-1] for first, _ in runs], [way[last:] for _, last in runs]):
        ratios = []
        for part in parts:
            beyond = np.flatnonzero(part[NEAREST - 1:] >= near)
            count = NEAREST + int(beyond[0]) if len(beyond) else len(part)
            if 0 < 2 * count <= len(part):
                ratios.append(part[2 * count - 1] / part[count - 1])
        if not ratios or np.median(ratios) > SLOPE:
            return False
    return True


def _goes_on(torque: np.ndarray, runs: Sequence[tuple[int, int]]) -> bool:
    """Return whether a torque mostly changes within runs, not at their ends."""
    inside = whole = 0.0
    for first, last in runs:
        some = (last - first) // 4
        before, begun, ended, after = (torque[max(start, 0):start + some] for start in (
            first - some, first, last - some, last))
        if len(before) and len(after):
            inside += begun.mean() - ended.mean()
            whole += before.mean() - after.mean()
    return inside * np.sign(whole) > INSIDE * abs(whole)
