"""What named causes may get wrong of their own torque.

The law of a library is never quite that of a machine. What it gets wrong follows the motion like
the torque itself: more in one place, direction or at one speed than elsewhere, or a little earlier.
Such an error is part of the covariance of the rows. Only a cause that resembles one of its shapes
must therefore explain more than the error may make.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.polynomial.legendre import legvander

from par4_dynamics.effects.time_rate import time_rate
from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.unnamed import Kind, Ranges

PLACE_DEGREE = 2
"""Of the polynomial of a joint's position that a torque may be wrong by."""
SLOW = (0.01, 0.03, 0.1)
"""Speeds, over the largest, below which a torque may be wrong by another factor."""


@dataclass(frozen=True, eq=False)
class LawError(Kind):
    """The error of the torque of named causes, as columns with a prior; never a cause itself.

    Attributes:
        share: rms of the error over that of the torque; each column has an equal part of it.
    """

    share: float = 0.0

    def prior(self, squares: np.ndarray, rows: float) -> np.ndarray:  # noqa: ARG002
        """Return the weights of the prior, see `Kind.prior`.

        Args:
            squares: of the whitened columns, (g, k); the first one is the torque itself.
            rows: on which they are.
        """
        expected = self.share ** 2 * squares[:, :1] / squares.shape[1]
        return np.where(squares > 0.0, squares, 1.0) / np.maximum(expected, 1e-30)


def law_error_of(named: Sequence[Hypothesis], coefficients: Sequence[np.ndarray], ranges: Ranges,
               share: float) -> LawError:
    """Return what the torque of named causes may be wrong by.

    Args:
        named: causes.
        coefficients: (K, J) of each.
        ranges: of the fitted data.
        share: rms of the error over that of the torque.
    """
    return LawError('law_error', 'an error of the torque of named causes', partial(
        _wrong, tuple(named), tuple(coefficients)), ranges, share=share)


def _wrong(named: Sequence[Hypothesis], coefficients: Sequence[np.ndarray], state: State,
           ranges: Ranges) -> np.ndarray:
    """Return the torque of named causes times each factor, and its rate, (n, J, k)."""
    torque = sum(np.einsum('njk,kj->nj', np.concatenate(
        [item.effect.columns(state, part) for part in item.effect.parts(item.shape)], axis=2), own)
        for item, own in zip(named, coefficients, strict=True))
    return np.concatenate((torque[..., None] * _factors(state, ranges),
                           time_rate(state, torque)[..., None]), axis=-1)


def _factors(state: State, ranges: Ranges) -> np.ndarray:
    low, high = ranges.q
    place = legvander(2.0 * (state.q - low) / np.maximum(high - low, 1e-12) - 1.0, PLACE_DEGREE)
    speed = state.qd / ranges.qd
    by_speed = [speed, np.abs(speed), *(np.exp(-(speed / slow) ** 2) for slow in SLOW)]
    return np.concatenate((place, np.sign(speed)[..., None] * place, np.stack(by_speed, axis=-1)),
                          axis=-1)
