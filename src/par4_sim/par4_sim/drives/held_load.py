"""A load on the drives that is known in advance: a row of torques a period."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np


@dataclass(frozen=True)
class HeldLoad:
    """Torques that the drives must supply on top, each held for a period, the last one for ever.

    A `LoadTorque` of a `Machine`; the exact plant takes it in compiled steps.

    Attributes:
        torque: (n, 4), N m, from the machine's start on.
        period: s.
    """

    torque: np.ndarray
    period: float

    def __call__(self, time: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """Return the torque (4,), N m, at a time since the machine's start, s."""
        return self.torque[held_row(len(self.torque), self.period, time)]


@numba.njit(cache=True, error_model='numpy')
def held_row(rows, period, time):
    """Return which of so many rows is held at a time, s."""
    return min(int(time / period), rows - 1)
