"""How far readings are off the straight line between their neighbours in time."""

from __future__ import annotations

import numpy as np


def off_the_line(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values minus the line between those before and after them, (n - 2, J).

    Args:
        time: of the readings, increasing, (n,).
        values: the readings, (n, J).
    """
    share = ((time[1:-1] - time[:-2]) / (time[2:] - time[:-2]))[:, None]
    return np.asarray(values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:])
