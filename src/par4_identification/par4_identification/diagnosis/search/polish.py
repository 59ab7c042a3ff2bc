"""Shapes of causes, moved from the grid of the search to the best fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.effects.effect import single
from par4_identification.diagnosis.evidence.estimates import shape_knobs, shape_slopes, turned
from par4_identification.diagnosis.evidence.fit import left_by
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.unnamed import Kind
from par4_identification.diagnosis.search.causes import Model, others_of
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.shapes import order_name

STEPS = 4
"""Steps of Gauss and Newton; the grid is at most a few percent off."""
LARGEST = 0.15
"""Step over the size of a number; the last step of the search on the grid is smaller."""
SMALL = 0.05
"""Step over its own standard deviation that is not worth taking."""


def polished(search: Search, model: Sequence[Hypothesis]) -> Model:
    """Return a model whose shapes fit the fitted rows best.

    The search tries shapes on a grid. What it gives is off by up to half a step of that, which may
    be many standard deviations of a strong cause. Orders of periodic torques stay whole numbers,
    a shape that has its default value keeps it unless `Rules.price` is gained, and none goes where
    no machine can be.
    """
    model, pool = tuple(model), search.pool
    for place, item in enumerate(model):
        if isinstance(item.effect, Kind) or order_name(item.named) or not shape_knobs(item):
            continue
        moved = _with_best_shape(pool, model, item)
        gain = 0.5 * (pool.fit(model).fit_squares - pool.fit(moved).fit_squares)
        if (gain > (search.rules.price if _is_usual(item) else 0.0)
                and search.belief.objection(moved[place], others_of(moved, moved[place])) is None):
            model = moved
    return model


def polished_alone(search: Search, item: Hypothesis, others: Model) -> Hypothesis:
    """Return a hypothesis whose shape fits the fitted rows best beside others as they are."""
    return _with_best_shape(search.pool, (*others, item), item)[-1]


def _with_best_shape(pool: Pool, model: Model, item: Hypothesis) -> Model:
    for _ in range(STEPS):
        others, knobs = others_of(model, item), shape_knobs(item)
        fit = pool.solution((*others, item))
        slope = shape_slopes(pool.evidence, item, fit.coefficients[-1], knobs)
        design = pool.evidence.design((*others, item))
        inside = design.T @ slope
        curvature = slope.T @ slope - inside.T @ (fit.covariance @ inside)
        inverse = np.linalg.pinv(curvature, rcond=1e-9, hermitian=True)
        left = left_by(pool.evidence, (*others, item), fit)
        step = inverse @ (slope.T @ left - inside.T @ (fit.covariance @ (design.T @ left)))
        if np.all(np.abs(step) < SMALL * np.sqrt(np.maximum(np.diag(inverse), 0.0))):
            break
        moved = item
        for knob, part in zip(knobs, step):
            size = LARGEST * abs(single(moved.shape[knob[0]]))
            moved = replace(moved, shape=turned(moved.shape, knob,
                                                float(np.clip(part, -size, size))))
        trial = tuple(moved if other is item else other for other in model)
        if pool.fit(trial).fit_squares >= pool.fit(model).fit_squares:
            break
        model, item = trial, moved
    return model


def _is_usual(item: Hypothesis) -> bool:
    """Return whether all numbers of a shape have their defaults, such as a power of two."""
    return all(parameter.default == item.shape[parameter.name]
               for parameter in item.named.parameters if parameter.name in item.shape)
