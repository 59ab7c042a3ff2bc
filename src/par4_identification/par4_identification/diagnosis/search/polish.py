"""Shapes of causes, moved from the grid of the search to the best fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_identification.diagnosis.evidence.estimates import shape_knobs, shape_slopes, turned
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import Fit, left_by
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.search.causes import Hypotheses, others_of
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.shapes import order_name

STEPS = 4
"""Steps of Gauss and Newton; the grid is at most a few percent off."""
LARGEST = 0.15
"""Step over the size of a number; the last step of the search on the grid is smaller."""
SMALL = 0.05
"""Step over its own standard deviation that is not worth taking."""


def polished(search: Search, model: Sequence[Hypothesis]) -> Hypotheses:
    """Return a model whose shapes fit the fitted rows best.

    The search tries shapes on a grid, so its result is off by up to half a step, which may be many
    standard deviations of a strong cause. Orders of periodic torques stay whole numbers. A shape
    that has its default value keeps it unless another one gains `Rules.price`. No shape moves to a
    value that no machine can have.
    """
    model, pool = _sought_again(search, tuple(model)), search.pool
    for place, item in enumerate(model):
        if isinstance(item.effect, Kind) or order_name(item.named) or not shape_knobs(item):
            continue
        if item.named.exact_at(item.shape, pool.evidence.observations.joints) is not None:
            continue
        moved = _with_best_shape(pool, model, item)
        gain = 0.5 * (pool.fit(model).fit_squares - pool.fit(moved).fit_squares)
        if (gain > (search.rules.price if is_usual(item) else 0.0)
                and search.belief.objection(moved[place], others_of(moved, moved[place])) is None):
            model = moved
    return model


def polished_alone(search: Search, item: Hypothesis, others: Hypotheses) -> Hypothesis:
    """Return a hypothesis whose shape fits the fitted rows best; the others are not changed."""
    return _with_best_shape(search.pool, (*others, item), item)[-1]


def _sought_again(search: Search, model: Hypotheses) -> Hypotheses:
    """Return a model whose far from linear causes are sought once more, beside all others."""
    for item in model:
        if isinstance(item.effect, Kind) or item.named.exact_at(
                item.shape, search.pool.evidence.observations.joints) is None:
            continue
        others = others_of(model, item)
        found = search.candidates.best(item.named, search.weighing.beside(others))
        if found is not None:
            shape = found.hypothesis.shape
            moved = replace(item, shape=shape if item.sets is None else
                            item.named.shape_of_sets(shape, item.sets))
            model = tuple(moved if other is item else other for other in model)
    return model


def _with_best_shape(pool: Pool, model: Hypotheses, item: Hypothesis) -> Hypotheses:
    for _ in range(STEPS):
        others = others_of(model, item)
        step, covariance = shape_step(pool.evidence, pool.solution((*others, item)), len(others))
        if np.all(np.abs(step) < SMALL * np.sqrt(np.maximum(np.diag(covariance), 0.0))):
            break
        moved = stepped(item, step, LARGEST)
        trial = tuple(moved if other is item else other for other in model)
        if pool.fit(trial).fit_squares >= pool.fit(model).fit_squares:
            break
        model, item = trial, moved
    return model


def shape_step(evidence: Evidence, fit: Fit, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the step of Gauss and Newton of the numbers of a shape, and their covariance.

    All coefficients of the fit move with them.

    Args:
        evidence: rows that were fitted.
        fit: of all causes.
        index: of the cause whose shape it is; `shape_knobs` are the numbers.

    Returns:
        (k,) and (k, k).
    """
    item = fit.hypotheses[index]
    slope = shape_slopes(evidence, item, fit.coefficients[index], shape_knobs(item))
    design, left = evidence.design(fit.hypotheses), left_by(evidence, fit.hypotheses, fit)
    inside = design.T @ slope
    covariance = np.linalg.pinv(slope.T @ slope - inside.T @ (fit.covariance @ inside),
                                rcond=1e-9, hermitian=True)
    return covariance @ (slope.T @ left - inside.T @ (fit.covariance @ (design.T @ left))
                         ), covariance


def stepped(item: Hypothesis, step: np.ndarray, largest: float) -> Hypothesis:
    """Return a cause whose shape went a step (k,), at most this share of each number."""
    moved = item
    for knob, part in zip(shape_knobs(item), step):
        size = largest * abs(float(np.atleast_1d(item.shape[knob[0]])[knob[1] or 0]))
        moved = replace(moved, shape=turned(moved.shape, knob, float(np.clip(part, -size, size))))
    return moved


def is_usual(item: Hypothesis) -> bool:
    """Return whether all numbers of a shape have their defaults, such as a power of two."""
    return all(parameter.default == item.shape[parameter.name]
               for parameter in item.named.parameters if parameter.name in item.shape)
