"""Masks of samples: how many are true, where they are true in a row, and what is near them."""

from __future__ import annotations

import numpy as np


def taken(values: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return values[order] (m, ...); where that is all of them in order, without a copy."""
    everything = len(order) == len(values) and bool((np.diff(order) == 1).all())
    return values if everything else values[order]


def count(mask: np.ndarray) -> int:
    """Return how many values are true, as an integer that JSON takes."""
    return int(np.count_nonzero(mask))


def stretches(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return start and end (excluded) of every run of true values."""
    edges = np.flatnonzero(np.diff(np.r_[False, mask, False].astype(np.int8)))
    return [(int(start), int(end)) for start, end in edges.reshape(-1, 2)]


def near(mask: np.ndarray, reach: int) -> np.ndarray:
    """Return where a true value of `mask` (n, J) is at most `reach` rows away, (n, J)."""
    count = np.cumsum(np.pad(mask, ((reach + 1, reach), (0, 0))), axis=0, dtype=np.int32)
    return count[2 * reach + 1:] > count[:-2 * reach - 1]
