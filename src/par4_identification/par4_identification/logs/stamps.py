"""Header stamps in order: spacing, gaps, jitter, and which stamp is nearest to a time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SHORTEST_PERIOD = 5e-6
"""s from sample to sample up to which times are likely to count another unit: hardly a logger
records so fast. One that does is read all the same, see `units.HIGHEST_RATE_HZ`."""
GAP = 1.5
"""Spacing in periods above which samples are missing."""
CROWDED = 0.25
"""Spacing in periods below which the later of two samples is dropped: splines would swing."""


@dataclass(frozen=True)
class Spacing:
    """How evenly stamps are spaced.

    Attributes:
        gaps: spacings of more than `GAP` periods.
        longest_gap: s.
        lost: samples that the gaps would have held.
        period: median spacing, s.
        jitter_rms: of the spacing about the period, gaps left out, s.
    """

    gaps: int
    longest_gap: float
    lost: int
    period: float
    jitter_rms: float


def spacing_counts(stamp: np.ndarray, run: np.ndarray | None = None) -> Spacing:
    """Return how evenly stamps are spaced, and what is missing between them.

    Args:
        stamp: (n,) ns, increasing.
        run: (n,); the spacing between samples of different runs means nothing.
    """
    spacing = np.diff(stamp)
    if run is not None:
        spacing = spacing[np.diff(run) == 0]
    if not len(spacing):
        return Spacing(0, 0.0, 0, 0.0, 0.0)
    period = float(np.median(spacing))
    gaps = spacing[spacing > GAP * period]
    others = spacing[spacing <= GAP * period]
    return Spacing(
        gaps=len(gaps), longest_gap=1e-9 * float(gaps.max(initial=0)),
        lost=int(np.sum(np.round(gaps / period) - 1)), period=1e-9 * period,
        jitter_rms=1e-9 * float(np.sqrt(np.mean((others - period) ** 2))))


def nearest_stamp(stamp: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of the stamp, of at least two in order, that is nearest to each time."""
    right = np.searchsorted(stamp, times).clip(1, len(stamp) - 1)
    return right - (times - stamp[right - 1] < stamp[right] - times)
