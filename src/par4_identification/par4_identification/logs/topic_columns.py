"""The messages of one topic as columns, joined batch by batch.

An hour of joint states is 4 million messages. Their columns are taken from the memory once, as long
as the bag says that they will be: many small ones, joined at the end, would need twice as much and
leave holes that nothing else fits into. A column without a single value takes none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.logs.raw_bag import JointSamples, TrajectoryPoints

JOINT_ARRAYS = ('position', 'velocity', 'effort')
TRAJECTORY_ARRAYS = ('positions', 'velocities', 'accelerations', 'effort')
"""Names of the arrays in the message types."""


@dataclass(frozen=True)
class AlikeMessages:
    """Messages (m,) of one layout, of P points each.

    Attributes:
        rows: which messages of the batch, (m,).
        names: of their joints.
        stamp: (m,) ns.
        after: time from start of the points, (m, P) ns; a JointState is one point at 0.
        arrays: of the message type, (m, P, -).
    """

    rows: np.ndarray
    names: tuple[str, ...]
    stamp: np.ndarray
    after: np.ndarray
    arrays: tuple[np.ndarray, ...]


class _Appended:
    """Rows of numbers (n, width) that are appended to."""

    def __init__(self, expected: int, dtype: type[np.generic], width: int = 0) -> None:
        """Take memory for `expected` rows when the first number comes."""
        self._expected = expected
        self._values: np.ndarray | None = None
        self._empty = np.array(np.nan if dtype is np.float64 else 0, dtype=dtype)
        self._width = width
        self._rows = 0

    def append(self, part: np.ndarray) -> None:
        """Append rows (m, w); where other rows are wider, NaN goes on."""
        rows, self._width = self._rows + len(part), max(self._width, part.shape[1])
        if self._values is not None or not np.isnan(part).all():
            values = self._reserved(rows)
            values[self._rows:rows, :part.shape[1]] = part
            values[self._rows:rows, part.shape[1]:] = self._empty
        self._rows = rows

    def _reserved(self, rows: int) -> np.ndarray:
        """Return memory for so many rows; those that are there stand in it."""
        old = self._values
        if old is not None and rows <= len(old) and self._width == old.shape[1]:
            return old
        length = max(self._expected, rows if old is None else rows + rows // 2)
        values = np.empty((length, self._width), dtype=self._empty.dtype)
        if old is None:
            values[:self._rows] = self._empty
        else:
            values[:self._rows, :old.shape[1]] = old[:self._rows]
            values[:self._rows, old.shape[1]:] = self._empty
        self._values = values
        return values

    def table(self, width: int) -> np.ndarray:
        """Return all rows (n, width); those of a column without a number cannot be written to."""
        if self._values is None:
            return np.broadcast_to(self._empty, (self._rows, width))
        return self._values[:self._rows, :width]


class TopicColumns:
    """What one topic holds, joined batch by batch.

    Attributes:
        messages: that came.
        decoded: of these, that could be read.
    """

    def __init__(self, topic: str, expected: int, arrays: Sequence[str]) -> None:
        """Expect as many messages, of a type with these arrays."""
        self.messages = self.decoded = 0
        self._topic = topic
        self._layouts: dict[tuple[str, ...], int] = {}
        self._numbers = {name: _Appended(expected, np.int64, 1) for name in (
            'received', 'stamp', 'layout', 'message', 'after')}
        self._arrays = [_Appended(expected, np.float64) for _ in arrays]

    def append(self, received: np.ndarray, alike: Sequence[AlikeMessages]) -> None:
        """Append a batch of messages, received at (n,) ns; those of no layout cannot be read."""
        count = np.full(len(received), -1)
        for part in alike:
            count[part.rows] = part.after.shape[1]
        decoded = count >= 0
        count = np.maximum(count, 0)
        start = np.cumsum(count) - count
        stamp, after, layout = np.zeros((3, int(count.sum())), dtype=np.int64)
        alike = [part for part in alike if part.after.size]
        places = [start[part.rows, None] + np.arange(part.after.shape[1]) for part in alike]
        for part, place in zip(alike, places, strict=True):
            stamp[place], after[place] = part.stamp[:, None], part.after
            layout[place] = self._layouts.setdefault(part.names, len(self._layouts))
        numbers = {'received': np.repeat(received, count), 'stamp': stamp, 'layout': layout,
                   'message': np.repeat(self.decoded + np.cumsum(decoded) - 1, count),
                   'after': after}
        for name, column in self._numbers.items():
            column.append(numbers[name][:, None])
        width = max((len(part.names) for part in alike), default=0)
        for number, table in enumerate(self._arrays):
            values = np.full((len(stamp), width), np.nan)
            for part, place in zip(alike, places, strict=True):
                filled = min(part.arrays[number].shape[-1], len(part.names))
                values[place, :filled] = part.arrays[number][..., :filled]
            table.append(values)
        self.messages += len(received)
        self.decoded += int(decoded.sum())

    def joint_samples(self) -> JointSamples:
        """Return the messages of a topic of JointState."""
        position, velocity, effort = self._tables()
        return JointSamples(*self._named(), position, velocity, effort)

    def trajectory_points(self) -> TrajectoryPoints:
        """Return the points of a topic of JointTrajectory."""
        position, velocity, acceleration, effort = self._tables()
        return TrajectoryPoints(*self._named(), self._column('message'), self._column('after'),
                                position, velocity, acceleration, effort)

    def _column(self, name: str) -> np.ndarray:
        return self._numbers[name].table(1)[:, 0]

    def _named(self) -> tuple[str, np.ndarray, np.ndarray, tuple[tuple[str, ...], ...],
                              np.ndarray]:
        return (self._topic, self._column('received'), self._column('stamp'),
                tuple(self._layouts), self._column('layout'))

    def _tables(self) -> list[np.ndarray]:
        width = max(map(len, self._layouts), default=0)
        return [table.table(width) for table in self._arrays]
