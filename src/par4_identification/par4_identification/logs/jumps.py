"""Jumps of positions from one sample to the next: what no machine does.

One joint that jumps and stays is a slipped encoder. Several that jump together are two recordings
joined, or samples that are missing without a gap in the stamps: the log is cut there. So it is
where the only joint of an axis goes on at another speed: an encoder that slips does not change it.
"""

from __future__ import annotations

import numpy as np

AROUND = 5
"""Samples on either side from which the speed of a joint is taken."""
COUNTS = 6.0
"""Counts of an encoder above which a change is a jump."""
SMALLEST = 3e-3
"""rad; what is smaller belongs to the noise of a reading."""
BEYOND = 12.0
"""Ratio of a wrong sample to the scatter about the median of its neighbours."""
ALONE = 3.0
"""Least ratio of a jump to the deviations of the steps two samples before and after it. A quick
motion after a long rest exceeds the scatter, too, but there all of these steps are large."""
MOSTLY = 0.98
"""Quantile of the changes of the speed that stands for the usual change: the jumps themselves are
among the few above it."""
LONE = 0.8
"""Part of its size by which a jump near an end of the log must differ from the next step towards
the middle."""
WIDEST = 3
"""Most samples that a spike lasts."""
TURNS = 2.0 * np.pi, 360.0
"""rad, and degrees where these stand for radians by mistake."""
NEAR_TURN = 0.02
"""Largest deviation of a step from whole turns and what its neighbours move, in turns."""
LONGEST_STEP = 4.5
"""Periods; readings so far apart belong to stretches of their own."""
FEWEST_EVEN, SHORTEST_EVEN = 3, 50
"""Jumps that are evenly apart, at the least, and by how many rows; of three that are anywhere one
in some thousand triples is."""
FEWEST_HELD, STOPPED = 4, 3.0
"""A reading is held by the logger, not by a machine at rest, if it repeats for so many samples
after a step of more than so many encoder counts: no machine stops from that speed within a
sample."""


def resolution(q: np.ndarray) -> float:
    """Return the smallest usual step of a reading (n,), rad; one count of an encoder."""
    steps = np.abs(np.diff(q))
    steps = steps[steps > 0.0]
    return float(np.quantile(steps, 0.02)) if len(steps) else 0.0


def count_of(steps: np.ndarray, within: float = 0.1) -> float:
    """Return the step (> 0) of which all steps (n,) are multiples, 0 if there is none.

    Args:
        steps: of a reading, above 0, at least one.
        within: part of that step by which they may miss.
    """
    least = float(np.quantile(steps, 0.01))
    multiples = steps / max(least, 1e-15)
    whole = np.abs(multiples - np.round(multiples)) < within
    return least if np.mean(whole) > 0.8 else 0.0


def jumps_of(q: np.ndarray, width: np.ndarray | float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much each step of a reading differs from those around it, and which jump.

    Args:
        q: of one joint, (n,) rad.
        width: of the steps, in periods, (n - 1,) or one for all.

    Returns:
        (n - 1,) rad, and a mask.
    """
    rate = np.diff(q) / width
    off = (rate - median_of_others(rate)) * width
    least = max(SMALLEST, BEYOND * float(np.quantile(np.abs(off), 0.995)), COUNTS * resolution(q))
    size = np.pad(np.abs(off), 2)
    beside = np.maximum(size[:-4], size[4:])
    return off, (np.abs(off) > least) & (np.abs(off) > ALONE * beside)


def without_turns(q: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return readings (n, J) that wrap round by whole turns put together, and how often each does.

    They come back within half a turn of zero, in the middle, as those of an arm are.

    Args:
        q: rad, or degrees by mistake.
        width: of the steps, in periods, (n - 1,); what happens in longer gaps stays.
    """
    step, often = np.diff(q, axis=0), np.zeros(q.shape[1], dtype=int)
    width = np.reshape(width, (-1, 1))
    for turn in TURNS:
        moved = width * np.stack([median_of_others(own) for own in (step / width).T], axis=1)
        turns = np.round((step - moved) / turn)
        wraps = (np.abs(step - moved - turn * turns) < NEAR_TURN * turn) & (turns != 0.0)
        wraps &= width < LONGEST_STEP
        joints = wraps.any(axis=0)
        if joints.any():
            q = q.copy()
            q[1:] -= turn * np.cumsum(np.where(wraps, turns, 0.0), axis=0)
            q[:, joints] -= turn * np.round(np.median(q[:, joints], axis=0) / turn)
            often += np.count_nonzero(wraps, axis=0)
            step = np.diff(q, axis=0)
    return q, often


def joints_of_recordings(q: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Return the rows before which several positions jump and stay, or any beside an end.

    The only joint of an axis must also go on at another speed, or its encoder may have slipped,
    but where it jumps after every so many rows.

    A jump so near an end cannot be told from a wrong reading; what lies beyond is too short to
    be used.

    Args:
        q: (n, J) rad.
        width: of the steps, in periods, (n - 1,).
    """
    if len(q) < 4 * AROUND:
        return np.zeros(0, dtype=int)
    found = [jumps_of(own, width) for own in q.T]
    off, large = (np.stack(part, axis=1) for part in zip(*found, strict=True))
    width = np.reshape(width, (-1, 1))
    rows = np.arange(len(off))
    beside = (rows < AROUND) | (rows >= len(off) - AROUND)
    rate = np.diff(q, axis=0) / width
    least = min(2, q.shape[1])
    jumping = rows[large.any(axis=1)]
    ends = [row for row in jumping if beside[row] and _is_alone(rate, off / width, large, row)]
    inside = jumping[~beside[jumping]]
    stay = np.array([row for row in inside if _stays(off, large, row) >= least
                     and not _held(q, row)], dtype=int)
    if least == 1:
        every = _length_of_recordings(stay)
        stay = inside[(inside - stay[0]) % every == 0] if every else np.array(
            [row for row in stay if _goes_on_otherwise(rate[:, 0], row)], dtype=int)
    return np.sort(np.array([*stay, *ends], dtype=int)) + 1


def _length_of_recordings(rows: np.ndarray) -> int:
    """Return how many rows a recording has of many that were joined at some rows, 0 for others.

    An encoder does not know in which rows it slips.
    """
    every = int(np.gcd.reduce(np.diff(rows))) if len(rows) >= FEWEST_EVEN else 0
    return every if every >= SHORTEST_EVEN else 0


def _goes_on_otherwise(rate: np.ndarray, row: int) -> bool:
    """Return whether a joint has another speed after a jump than before.

    Its speed changes by far more than it does in as many samples elsewhere.

    Args:
        rate: its steps, (n - 1,) rad a period.
        row: the step that jumps.
    """
    means = np.convolve(rate, np.full(AROUND, 1.0 / AROUND), 'valid')
    changes = np.abs(means[AROUND + 1:] - means[:-AROUND - 1])  # across the step AROUND rows on
    return bool(changes[row - AROUND] > ALONE * float(np.quantile(changes, MOSTLY)))


def _is_alone(rate: np.ndarray, off: np.ndarray, large: np.ndarray, row: int) -> bool:
    """Return whether a step beside an end differs from the next one inside as much as it jumps.

    Where a log begins or ends in a quick start or stop, no step is like those around it, but each
    is like the next.
    """
    inner = row + 1 if row < AROUND else row - 1
    return bool((large[row] & (np.abs(rate[row] - rate[inner]) > LONE * np.abs(off[row]))).any())


def _stays(off: np.ndarray, large: np.ndarray, row: int) -> int:
    """Return how many joints jump in a row and are not back a few samples later."""
    near = off[max(row - WIDEST, 0):row + WIDEST + 1].sum(axis=0)
    return int(np.count_nonzero(large[row] & (np.abs(near) > 0.5 * np.abs(off[row]))))


def _held(q: np.ndarray, row: int) -> bool:
    """Return whether all readings repeat up to a row though the machine moved."""
    first = row
    while first > 0 and (q[first - 1] == q[row]).all():
        first -= 1
    last_step = np.abs(q[first] - q[first - 1]) if first else np.zeros(q.shape[1])
    counts = np.array([resolution(own) for own in q.T])
    return row - first + 1 >= FEWEST_HELD and bool((last_step > STOPPED * counts).any())


def median_of_others(values: np.ndarray) -> np.ndarray:
    """Return the median of the neighbours of each value (n,), itself left out."""
    from scipy.ndimage import rank_filter  # slow to load, and not always needed

    below, middle, above = (rank_filter(values, rank, 2 * AROUND + 1, mode='mirror')
                            for rank in (AROUND - 1, AROUND, AROUND + 1))
    # of the others, without a value above, below or at the median of all
    return np.asarray(0.5 * (np.where(values < middle, above, below)
                             + np.where(values == middle, above, middle)))
