"""The error that the laws of named causes may have in their own torque.

The law of a library is never quite that of a machine. Its error follows the motion like the torque
itself: it is larger in one place, direction, at one speed or under one load than elsewhere, or acts
a little earlier. Each of these ways is a column. Such an error is part of the covariance of the
rows. A cause that resembles one of the columns must therefore explain more than the error may make;
other causes need not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import legvander

from par4_dynamics.state import State
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.kind_functions import Ranges
from par4_identification.diagnosis.evidence.observations import Observations

PLACE_DEGREE = 2
"""Of the polynomial of a joint's position that a torque may be wrong by."""
SLOW = (0.01, 0.03, 0.1)
"""Speeds, over the largest, below which a torque may be wrong by another factor."""


@dataclass(frozen=True, eq=False)
class LawError(Kind):
    """The error of the torque of named causes, as columns with a prior; never a cause itself.

    Its columns are no function of the motion but made of the rows of the causes, see `put_in`.

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


def law_error_of(share: float) -> LawError:
    """Return a law error without columns yet, of this share (rms) of the torque."""
    return LawError('law_error', 'an error of the torque of named causes', share=share)


def factors_of(observations: Observations, ranges: Ranges) -> list[np.ndarray]:
    """Return the factors by which a torque may be wrong, filtered like it, (m, J, k) of each run.
    """
    return [run.rows(_factors(run.state, ranges)) for run in observations.runs]


def put_in(evidence: Evidence, error: LawError, named: Sequence[Hypothesis],
           coefficients: Sequence[np.ndarray], factors: Sequence[np.ndarray]) -> None:
    """Put the columns of a law error into an evidence.

    They are made of filtered rows: the product of filtered torque and factor is near enough to the
    filtered product.

    Args:
        evidence: that has the rows.
        error: whose columns they become.
        named: the causes.
        coefficients: (K, J) of each.
        factors: of the same rows, see `factors_of`.
    """
    of_causes = [evidence.observations.effect_rows(item.effect, item.shape) for item in named]
    columns = []
    for index, run in enumerate(evidence.observations.runs):
        torque = sum(np.einsum('mjk,kj->mj', rows[index], own)
                     for rows, own in zip(of_causes, coefficients, strict=True))
        rate = np.gradient(torque, run.t, axis=0) if len(run.t) > 1 else np.zeros_like(torque)
        columns.append(np.concatenate((torque[..., None] * factors[index], rate[..., None]),
                                      axis=-1))
    evidence.put(error, columns)


def _factors(state: State, ranges: Ranges) -> np.ndarray:
    place = legvander(ranges.place(state.q), PLACE_DEGREE)
    speed = state.qd / ranges.qd
    others = [speed, np.abs(speed), *(np.exp(-(speed / slow) ** 2) for slow in SLOW),
              np.abs(state.delivered)]
    return np.concatenate((place, state.direction[..., None] * place, np.stack(others, axis=-1)),
                          axis=-1)
