"""Generalised least squares of base terms and hypotheses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.observations import Observations

DOUBT = 0.5
"""Standard deviation of a correction of fitted values, over the correction."""


def prior_weights(evidence: Evidence, hypotheses: Sequence[Hypothesis], coefficients: int
                  ) -> np.ndarray:
    """Return the weight (c,) of the prior, zero, of each coefficient: squares of a row of its own.

    Only what has no name has one, see `Kind.prior`.
    """
    own = [evidence.once((item.effect, ('prior', *item.key[1:])), partial(_prior, evidence, item))
           for item in hypotheses]
    return np.concatenate((np.zeros(coefficients - sum(map(len, own))), *own))


def _prior(evidence: Evidence, item: Hypothesis) -> np.ndarray:
    """Return these weights of the coefficients of a hypothesis, (k,)."""
    if not isinstance(item.effect, Kind):
        return np.zeros(item.width(evidence.width(item.effect, item.shape))
                        * (1 if item.effect.shared else len(item.joints)))
    block, = evidence.blocks(item.effect, item.shape)
    squares = np.einsum('jkk->jk', block.gram)
    own = squares.sum(axis=0) if item.effect.shared else squares[list(item.joints)]
    rows = evidence.rows if item.effect.shared else evidence.rows / len(squares)
    return item.effect.prior(own, rows).ravel()


@dataclass(frozen=True)
class Fit:
    """Generalised least squares of base terms and hypotheses.

    Unnamed causes have a prior; their part of the covariance is that of the posterior.

    Attributes:
        base: values (p,).
        coefficients: (K, J) of each hypothesis, zero on joints it does not act on.
        covariance: of everything, in the order of the design, (c, c).
        slices: where the coefficients of each hypothesis are in it.
        hypotheses: that were fitted.
        correction: what was added to the values of least squares, (c,), see `corrected`; empty
            where nothing was.
    """

    base: np.ndarray
    coefficients: tuple[np.ndarray, ...]
    covariance: np.ndarray
    slices: tuple[slice, ...]
    hypotheses: tuple[Hypothesis, ...]
    correction: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def doubt(self) -> np.ndarray:
        """Share of the covariance (c, c) that the correction has: it may be half wrong."""
        if not len(self.correction):
            return np.zeros_like(self.covariance)
        return np.outer(DOUBT * self.correction, DOUBT * self.correction)


def solve(evidence: Evidence, hypotheses: Sequence[Hypothesis]) -> Fit:
    """Return the fit of base terms and hypotheses with its covariance."""
    design = evidence.design(hypotheses)
    prior = prior_weights(evidence, hypotheses, design.shape[1])
    # a column that these rows do not visit has its prior alone
    scale = np.sqrt(np.maximum(np.einsum('nc,nc->c', design, design) + prior, 1e-60))
    inverse = np.linalg.pinv((design / scale).T @ (design / scale) + np.diag(prior / scale ** 2),
                             rcond=1e-12, hermitian=True)
    values = inverse @ ((design / scale).T @ evidence.target) / scale
    return fit_of(evidence, hypotheses, values, inverse / np.outer(scale, scale))


def fit_of(evidence: Evidence, hypotheses: Sequence[Hypothesis], values: np.ndarray,
           covariance: np.ndarray) -> Fit:
    """Return the fit whose values are (c,), in the order of the design."""
    parameters = evidence.base.shape[1]
    joints = evidence.observations.joints
    coefficients, slices, first = [], [], parameters
    for hypothesis in hypotheses:
        width = evidence.width(hypothesis.effect, hypothesis.shape)
        full = np.zeros((width, joints))
        if hypothesis.effect.shared:
            span = slice(first, first + len(full[hypothesis.columns]))
            full[hypothesis.columns] = values[span, None]
        else:
            span = slice(first, first + width * len(hypothesis.joints))
            full[:, list(hypothesis.joints)] = values[span].reshape(-1, width).T
        coefficients.append(full)
        slices.append(span)
        first = span.stop
    return Fit(values[:parameters], tuple(coefficients), covariance, tuple(slices),
               tuple(hypotheses))


def _values(fit: Fit) -> np.ndarray:
    """Return all values of a fit, in the order of the design, (c,)."""
    return np.concatenate([fit.base, *(item.stacked(coefficients) for item, coefficients in zip(
        fit.hypotheses, fit.coefficients))])


def pinned(evidence: Evidence, fit: Fit, retimed: bool = True) -> Fit:
    """Return a fit in which columns that are exact at some coefficients only have these.

    The other values are those of least squares beside them.

    Args:
        evidence: rows that were fitted.
        fit: of the causes.
        retimed: whether this holds for torques of another time, too.
    """
    joints, own, told = evidence.observations.joints, [np.empty(0, dtype=int)], [np.empty(0)]
    for item, place in zip(fit.hypotheses, fit.slices):
        exact = (None if isinstance(item.effect, Kind) or (item.named.retimes and not retimed)
                 else item.effect.exact_at(item.shape, joints))
        if exact is not None:
            own.append(np.arange(place.start, place.stop))
            told.append(exact[item.columns])
    pins, values = np.concatenate(own), _values(fit)
    if not len(pins):
        return fit
    away = np.concatenate(told) - values[pins]
    values = values + fit.covariance[:, pins] @ np.linalg.solve(
        fit.covariance[np.ix_(pins, pins)], away)
    return replace(fit_of(evidence, fit.hypotheses, values, fit.covariance),
                   correction=fit.correction)


def with_coefficients(evidence: Evidence, fit: Fit, coefficients: Sequence[np.ndarray]) -> Fit:
    """Return a fit whose causes have these coefficients, with the best base parameters beside them.

    Args:
        evidence: rows that were fitted.
        fit: of the causes.
        coefficients: (K, J) of each, as a fit has them.
    """
    told = [item.stacked(part) for item, part in zip(fit.hypotheses, coefficients, strict=True)]
    if np.array_equal(np.concatenate([np.empty(0), *told]), _values(fit)[len(fit.base):]):
        return fit
    left = evidence.target - sum(evidence.columns(item) @ values
                                 for item, values in zip(fit.hypotheses, told))
    base = solve(replace(evidence, target=left), ()).base
    return replace(fit_of(evidence, fit.hypotheses, np.concatenate([base, *told]),
                          fit.covariance), correction=fit.correction)


def corrected(evidence: Evidence, fit: Fit, moment: np.ndarray) -> Fit:
    """Return a fit whose normal equations have another right side.

    Args:
        evidence: rows that were fitted.
        fit: by least squares.
        moment: what to add to the products of the columns with the target, (c,).
    """
    correction = fit.covariance @ moment
    return replace(fit_of(evidence, fit.hypotheses, _values(fit) + correction, fit.covariance),
                   correction=correction)


def left_by(evidence: Evidence, hypotheses: Sequence[Hypothesis], fit: Fit) -> np.ndarray:
    """Return the target minus a fit, (N,). The fit may have been made on other rows."""
    return evidence.target - evidence.design(hypotheses) @ _values(fit)


def residuals(observations: Observations, hypotheses: Sequence[Hypothesis], fit: Fit
              ) -> tuple[np.ndarray, ...]:
    """Return measured minus fitted torque (m, J) of each run of `observations`."""
    results = []
    for index, (target, base) in enumerate(zip(observations.target, observations.base)):
        left = target - base @ fit.base
        for hypothesis, coefficients in zip(hypotheses, fit.coefficients):
            rows = observations.effect_rows(hypothesis.effect, hypothesis.shape)[index]
            left = left - np.einsum('mjk,kj->mj', rows, coefficients)
        results.append(left)
    return tuple(results)


def rms_of(observations: Observations, left: Sequence[np.ndarray]) -> float:
    """Return the rms of residuals (m, J) of each run over the valid rows, N m."""
    kept = np.concatenate([part[run.valid] for run, part in zip(observations.runs, left)])
    return float(np.sqrt(np.mean(kept ** 2))) if len(kept) else 0.0
