"""What waits for the physics, put together so that a stream costs what a chunk does."""

from __future__ import annotations

from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Generic, Protocol, TypeVar

import numpy as np

from par4_kinematics.stamps import SECOND
from par4_sim.drives.reference_points import ROOM

MOST = 1000
"""Points that are taken at a time: a flood of them must not stop the physics."""


class Timed(Protocol):
    """What waits: rows (n, -) at ascending times (n,), s."""

    @property
    def times(self) -> np.ndarray: ...

    @property
    def rows(self) -> np.ndarray: ...


@dataclass(frozen=True, eq=False)
class Torques:
    """Feedforward torques.

    Attributes:
        times: ascending, (n,), s.
        rows: (n, 4), N m.
    """

    times: np.ndarray
    rows: np.ndarray


TimedRows = TypeVar('TimedRows', bound=Timed)


class Inbox(Generic[TimedRows]):
    """TimedRows from one thread for another, in the order in which they came."""

    def __init__(self) -> None:
        self._waiting: SimpleQueue[tuple[int, TimedRows]] = SimpleQueue()

    def put(self, epoch_ns: int, rows: TimedRows) -> None:
        """Leave rows whose times count from `epoch_ns`."""
        self._waiting.put((epoch_ns, rows))

    def take(self, epoch_ns: int) -> list[list[TimedRows]]:
        """Return what waits, with times from `epoch_ns` on: groups that go on in time.

        Many rows are a group of their own, which need not be put together.
        """
        groups: list[list[TimedRows]] = []
        end, count = np.inf, 0
        while count < MOST:
            try:
                since_ns, rows = self._waiting.get_nowait()
            except Empty:
                break
            times = rows.times
            if since_ns != epoch_ns:
                times += (since_ns - epoch_ns) / SECOND
            many = len(times) > ROOM
            if many or times[0] <= end:
                groups.append([])
            groups[-1].append(rows)
            count += len(times)
            end = np.inf if many else times[-1]
        return groups


def as_one(group: list[TimedRows]) -> tuple[np.ndarray, np.ndarray]:
    """Return the times and rows of a group as one."""
    if len(group) == 1:
        return group[0].times, group[0].rows
    return (np.concatenate([part.times for part in group]),
            np.concatenate([part.rows for part in group]))
