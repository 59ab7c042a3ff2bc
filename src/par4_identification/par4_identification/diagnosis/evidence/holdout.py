"""The gain on held-out rows, with an interval by block bootstrap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

BLOCK = 0.5
"""Length of a bootstrap block, s; longer than the noise remembers."""
DRAWS = 400


@dataclass(frozen=True)
class Gain:
    """Share of the whitened squared error that a model removes on held-out rows.

    Attributes:
        share: 1 - after / before.
        low, high: 95 % interval.
    """

    share: float
    low: float
    high: float


@dataclass(frozen=True)
class Blocks:
    """Held-out rows cut into blocks of time.

    Attributes:
        labels: block number of each row of each run, (m,).
        valid: (m, J) of each run.
        draws: how often each block is drawn in each bootstrap sample, (DRAWS, blocks).
    """

    labels: tuple[np.ndarray, ...]
    valid: tuple[np.ndarray, ...]
    draws: np.ndarray

    def sums(self, residuals: Sequence[np.ndarray]) -> np.ndarray:
        """Return the sum of squares of residuals (m, J) in each block, (blocks, J)."""
        total = np.zeros((self.draws.shape[1], residuals[0].shape[1]))
        for residual, label, valid in zip(residuals, self.labels, self.valid):
            square = np.where(valid, residual, 0.0) ** 2
            np.add.at(total, label, square)
        return total

    def counts(self) -> np.ndarray:
        """Return the number of valid rows in each block, (blocks, J)."""
        total = np.zeros((self.draws.shape[1], self.valid[0].shape[1]))
        for label, valid in zip(self.labels, self.valid):
            np.add.at(total, label, valid.astype(float))
        return total

    def mean_square(self, residuals: Sequence[np.ndarray]) -> np.ndarray:
        """Return the mean square of residuals (m, J) over the valid rows, (J,)."""
        return self.sums(residuals).sum(axis=0) / np.maximum(self.counts().sum(axis=0), 1)

    def whitened_gain(self, before: np.ndarray, after: np.ndarray) -> Gain:
        """Return the gain from whitened rows (N,), joint after joint, `before` to `after`.

        Noise that wanders fills the squares of plain residuals and hides what a model removes;
        independent rows count what each of them tells.
        """
        labels = np.tile(np.concatenate(self.labels), self.valid[0].shape[1])
        old, new = (np.bincount(labels, rows ** 2, self.draws.shape[1])
                    for rows in (before, after))
        drawn = 1.0 - (self.draws @ new) / np.maximum(self.draws @ old, 1e-30)
        low, high = np.quantile(drawn, (0.025, 0.975))
        return Gain(float(1.0 - new.sum() / max(old.sum(), 1e-30)), float(low), float(high))


def blocks_of_runs(times: Sequence[np.ndarray], valid: Sequence[np.ndarray]) -> Blocks:
    """Return blocks of `BLOCK` seconds over runs with row times (m,), with seeded draws.

    Blocks without a valid row, in which the machine rests, are not drawn.
    """
    labels, first = [], 0
    for time in times:
        label = ((time - time[0]) / BLOCK).astype(int) + first
        first = int(label[-1]) + 1
        labels.append(label)
    random = np.random.default_rng(0)
    held = np.bincount(np.concatenate(labels), np.concatenate(
        [part.any(axis=1) for part in valid]), first) > 0
    count = max(int(held.sum()), 1)
    draws = random.multinomial(count, held / count, size=DRAWS).astype(float)
    return Blocks(tuple(labels), tuple(valid), draws)
