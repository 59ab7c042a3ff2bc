"""Stretches of long logs, spread evenly over them, where all of it would be too much to hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from par4_identification.logs.log import Log

PIECE = 600.0
"""s that are filtered at a time; of four joints at 1 kHz the columns are 120 MB then."""
STRETCH = 10.0
"""s of a stretch: long against the memory of the filters and of presliding friction."""
SHORTEST = 1.0
"""s that a filter needs; of what is shorter nothing can be said."""


def seconds_of(logs: Sequence[Log]) -> float:
    """Return the duration of all sound stretches of logs, s."""
    return sum(log.period * (part.stop - part.start) for log in logs for part in log.segments)


def spread_over(logs: Sequence[Log], seconds: float) -> tuple[Log, ...]:
    """Return logs with about `seconds` of what they hold, in stretches of `STRETCH` s.

    Stretches are shorter only where the log has gaps. Times stay those of the log, so that what
    changes over it still shows. Logs that hold no more are returned as they are; one of which no
    stretch is taken is left out.
    """
    if seconds >= seconds_of(logs):
        return tuple(logs)
    stretches = [(number, part) for number, log in enumerate(logs)
                 for part in _cut(log, STRETCH) if _lasts(log, part)] or [
        (number, part) for number, log in enumerate(logs) for part in log.segments]
    held = sum(logs[number].period * (part.stop - part.start) for number, part in stretches)
    count = min(max(1, int(len(stretches) * seconds / held)), len(stretches))
    # the first begins where the first log does, the last ends with the last
    taken = [stretches[index] for index in np.linspace(
        0, len(stretches) - 1, count).round().astype(int)]
    parts = [[part for own, part in taken if own == number] for number in range(len(logs))]
    return tuple(_with_segments(log, own) for log, own in zip(logs, parts) if own)


def in_pieces(log: Log) -> Log:
    """Return the log with its sound stretches cut where they are longer than `PIECE`.

    Filters and columns then hold no more than a piece at a time. The samples stay; what a filter
    does not know at the ends of a piece, a tenth of a second, is not in the rows.
    """
    return replace(log, segments=tuple(_cut(log, PIECE)))


def _cut(log: Log, longest: float) -> list[slice]:
    """Return the sound stretches of a log, each in equal parts of `longest` s at the most."""
    samples = max(1, round(longest / log.period))
    parts = []
    for segment in log.segments:
        count = -(-(segment.stop - segment.start) // samples)
        ends = np.linspace(segment.start, segment.stop, count + 1).astype(int).tolist()
        parts += [slice(*pair) for pair in pairwise(ends)]
    return parts


def _lasts(log: Log, part: slice) -> bool:
    return log.period * (part.stop - part.start) >= SHORTEST


def parted(log: Log, share: float) -> tuple[Log, Log]:
    """Return the first share of a log's sound samples and the rest, as two logs."""
    lengths = np.array([part.stop - part.start for part in log.segments])
    number = int(np.searchsorted(np.cumsum(lengths), share * lengths.sum()))
    segment = log.segments[number]
    at = segment.start + round(share * lengths.sum() - lengths[:number].sum())
    return (_with_segments(log, [*log.segments[:number], slice(segment.start, at)]),
            _with_segments(log, [slice(at, segment.stop), *log.segments[number + 1:]]))


def _with_segments(log: Log, parts: Sequence[slice]) -> Log:
    """Return the samples of a log that lie in some of its stretches."""
    parts = [part for part in parts if part.stop > part.start]
    kept = np.concatenate([np.arange(part.start, part.stop) for part in parts])
    ends = np.cumsum([0, *(part.stop - part.start for part in parts)]).tolist()
    return replace(log, t=log.t[kept], q=log.q[kept], tau=log.tau[kept],
                   segments=tuple(slice(*pair) for pair in pairwise(ends)),
                   doubtful=None if log.doubtful is None else log.doubtful[kept])
