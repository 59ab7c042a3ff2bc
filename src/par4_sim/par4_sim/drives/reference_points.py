"""Reference points in order of time, with room for more of them behind and in front."""

from __future__ import annotations

from typing import Self

import numpy as np

from par4_sim.drives.reference_curve import COLUMNS

ROOM = 4096
"""Points for which room is made; more than these are moved as seldom as possible."""


class ReferencePoints:
    """Points that are added to where they stand: what a point costs does not depend on how many.

    Attributes:
        times: ascending, (n,), s.
        rows: q, qd, qdd, feedforward torque of four joints, (n, COLUMNS); NaN = no torque yet.
    """

    def __init__(self, times: np.ndarray, rows: np.ndarray) -> None:
        """Take the memory of times (n,) and rows (n, COLUMNS)."""
        self._all_times, self._all_rows = times, rows
        self._show(0, len(times))

    @classmethod
    def of_motion(cls, times: np.ndarray, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray) -> Self:
        """Return points of a motion (n, 4) at times (n,), s, which still lack their torques.

        Many are given room, in front for those that are kept before them.
        """
        count, front, behind = len(times), 0, 0
        if count > ROOM:
            front, behind = ROOM, count
        points = cls(np.empty(front + count + behind), np.empty((front + count + behind, COLUMNS)))
        points._show(front, front + count)
        points.times[:] = times
        for part, values in enumerate((q, qd, qdd)):
            points.rows[:, 4 * part:4 * part + 4] = values
        points.rows[:, 12:] = np.nan
        return points

    def __len__(self) -> int:
        return len(self.times)

    def _show(self, first: int, end: int) -> None:
        self._first, self._end = first, end
        self.times, self.rows = self._all_times[first:end], self._all_rows[first:end]

    def forget_before(self, row: int) -> None:
        """Forget the points in front of `row`."""
        self._show(self._first + row, self._end)

    def forget_from(self, row: int) -> None:
        """Forget the points from `row` on."""
        self._show(self._first, self._first + row)

    def append(self, times: np.ndarray, rows: np.ndarray) -> None:
        """Add points (n, COLUMNS) at later times (n,)."""
        end = self._end + len(times)
        if end > len(self._all_times):
            own_times, own_rows = self.times, self.rows
            count = len(own_times)
            room = max(ROOM, 2 * (count + len(times)))
            self._all_times, self._all_rows = np.empty(room), np.empty((room, COLUMNS))
            self._all_times[:count], self._all_rows[:count] = own_times, own_rows
            self._show(0, count)
            end = count + len(times)
        self._all_times[self._end:end], self._all_rows[self._end:end] = times, rows
        self._show(self._first, end)

    def followed_by(self, later: ReferencePoints) -> ReferencePoints:
        """Return these points and later ones; neither is to be used any more.

        The fewer are moved to the more.
        """
        first = later._first - len(self)
        if len(later) <= ROOM or first < 0:
            self.append(later.times, later.rows)
            return self
        later._all_times[first:later._first] = self.times
        later._all_rows[first:later._first] = self.rows
        later._show(first, later._end)
        return later
