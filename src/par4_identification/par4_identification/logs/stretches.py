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


def seconds_of(logs: Sequence[Log]) -> float:
    """Return the duration of all sound stretches of logs, s."""
    return sum(log.period * (part.stop - part.start) for log in logs for part in log.segments)


def spread_over(logs: Sequence[Log], seconds: float) -> tuple[Log, ...]:
    """Return logs with about `seconds` of what they hold, in stretches of `STRETCH` s.

    Times stay those of the log, so that what changes over it still shows. Logs that hold no more
    are returned as they are.
    """
    share = seconds / max(seconds_of(logs), 1e-9)
    if share >= 1.0:
        return tuple(logs)
    return tuple(_thinned(log, share) for log in logs)


def in_pieces(log: Log) -> Log:
    """Return the log with its sound stretches cut where they are longer than `PIECE`.

    Filters and columns then hold no more than a piece at a time. The samples stay; what a filter
    does not know at the ends of a piece, a tenth of a second, is not in the rows.
    """
    longest = round(PIECE / log.period)
    parts = []
    for segment in log.segments:
        count = -(-(segment.stop - segment.start) // longest)
        ends = np.linspace(segment.start, segment.stop, count + 1).astype(int).tolist()
        parts += [slice(*pair) for pair in pairwise(ends)]
    return replace(log, segments=tuple(parts))


def _thinned(log: Log, share: float) -> Log:
    parts = []
    for segment in log.segments:
        samples = segment.stop - segment.start
        count = max(1, round(share * samples * log.period / STRETCH))
        length = min(round(share * samples / count), samples)
        # the first begins where the segment does, the last ends with it
        starts = np.linspace(segment.start, segment.stop - length, count).astype(int)
        parts += [slice(int(start), int(start) + length) for start in starts]
    return _with_segments(log, parts)


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
