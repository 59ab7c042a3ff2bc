"""Header stamps in order: spacing, gaps, jitter, and which stamp is nearest to a time."""

from __future__ import annotations

import numpy as np

GAP = 1.5
"""Spacing in periods above which samples are missing."""
CROWDED = 0.25
"""Spacing in periods below which the later of two samples is dropped: splines would swing."""


def spacing_counts(stamp: np.ndarray, run: np.ndarray | None = None) -> dict[str, float]:
    """Return `gaps`, `longest_gap` (s), `lost`, `period` (s) and `jitter_rms` (s) of stamps.

    Args:
        stamp: (n,) ns, increasing.
        run: (n,); the spacing between samples of different runs means nothing.
    """
    spacing = np.diff(stamp)
    if run is not None:
        spacing = spacing[np.diff(run) == 0]
    if not len(spacing):
        return {'gaps': 0, 'longest_gap': 0.0, 'lost': 0, 'period': 0.0, 'jitter_rms': 0.0}
    period = float(np.median(spacing))
    gaps = spacing[spacing > GAP * period]
    others = spacing[spacing <= GAP * period]
    return {
        'gaps': len(gaps), 'longest_gap': 1e-9 * float(gaps.max(initial=0)),
        'lost': int(np.sum(np.round(gaps / period) - 1)), 'period': 1e-9 * period,
        'jitter_rms': 1e-9 * float(np.sqrt(np.mean((others - period) ** 2))),
    }


def nearest_stamp(stamp: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of the stamp, of at least two in order, that is nearest to each time."""
    right = np.searchsorted(stamp, times).clip(1, len(stamp) - 1)
    return right - (times - stamp[right - 1] < stamp[right] - times)
