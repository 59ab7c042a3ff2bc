"""Feedforward torques, given to the reference points that they belong to by their times."""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.geometry import LEGS

MATCH = 1e-4
"""Torque belongs to the reference point within this time, s."""

MOST_WAITING = 200_000
"""Torques that wait at the most, 200 s of them at 1 kHz; beyond that the latest are let go."""


def _slots(times: np.ndarray) -> np.ndarray:
    """Return times (n,), s, in whole units of MATCH."""
    return np.rint(np.asarray(times) / MATCH).astype(np.int64)


@numba.njit(cache=True, error_model='numpy')
def _give(times, rows, slots, torques, taken):
    """Give torques to points without; each serves one point, the exact first.

    Args:
        times, rows: of the points.
        slots: when the torques are, in units of MATCH, ascending, (n,).
        torques: (n, 4).
        taken: whether each has been given, (n,), written.
    """
    for shift in (0, -1, 1):
        for row in range(times.shape[0]):
            if not math.isnan(rows[row, 12]):
                continue
            wanted = np.int64(np.rint(times[row] / MATCH)) + shift
            place = np.searchsorted(slots, wanted)
            if place < slots.shape[0] and slots[place] == wanted and not taken[place]:
                rows[row, 12:16] = torques[place]
                taken[place] = True


class WaitingTorque:
    """The torques that no point has taken yet."""

    def __init__(self) -> None:
        self._slots = np.empty(0, dtype=np.int64)
        self._torques = np.empty((0, LEGS))

    def __len__(self) -> int:
        return len(self._slots)

    def serve(self, times: np.ndarray, rows: np.ndarray) -> None:
        """Give what waits to new points: rows (n, COLUMNS) at times (n,), s."""
        if len(self):
            self._keep(_left(times, rows, self._slots, self._torques))

    def add(self, times: np.ndarray, torques: np.ndarray, point_times: np.ndarray,
            point_rows: np.ndarray) -> None:
        """Give torques (n, 4), N m, at `times` (n,), s, to points now, or let them wait for theirs.

        Points that have been served before take none that waits, so that the new ones suffice.
        """
        slots, torques = _slots(times), np.ascontiguousarray(torques, dtype=float)
        if (slots[1:] <= slots[:-1]).any():
            slots, torques = _newest(slots, torques)
        left = _left(point_times, point_rows, slots, torques)
        if left.any():
            self._slots, self._torques = _newest(
                np.concatenate((self._slots, slots[left])),
                np.concatenate((self._torques, torques[left])))
            if len(self) > MOST_WAITING:
                self._keep(slice(MOST_WAITING))

    def forget_before(self, time: float) -> None:
        """Forget what has waited in vain."""
        if len(self) and self._slots[0] * MATCH < time:
            self._keep(self._slots >= round(time / MATCH))

    def _keep(self, which: np.ndarray | slice) -> None:
        self._slots, self._torques = self._slots[which], self._torques[which]


def _left(times: np.ndarray, rows: np.ndarray, slots: np.ndarray, torques: np.ndarray
          ) -> np.ndarray:
    """Give torques to points and return which were not taken, (n,) bool."""
    taken = np.zeros(len(slots), dtype=np.bool_)
    near = slice(*np.searchsorted(times, (MATCH * (slots[0] - 2), MATCH * (slots[-1] + 2))))
    _give(times[near], rows[near], slots, torques, taken)
    return ~taken


def _newest(slots: np.ndarray, torques: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return slots ascending, of equal ones the last, and their torques."""
    slots, places = np.unique(slots[::-1], return_index=True)
    return slots, torques[::-1][places]
