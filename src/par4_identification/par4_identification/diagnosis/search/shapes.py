"""The best shape of an effect: first over a grid, then around the best one there."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from par4_dynamics.effects.effect import Effect, Shape, single
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.evidence.projection import Projection
from par4_identification.signals.run import Run, longest_motion

SLOWEST = 0.05
"""Share of the rows, the slowest, in which an order that is sought must show."""
BEYOND = 2.0
"""Highest frequency of an order there over the cut-off of the torque, of which a small share passes
the filter: of a torque at twice the cut-off three thousandths."""
EXPANSIONS = 4
"""Times that a series is expanded around what came of it."""


def shapes_of(observations: Observations, effect: Effect) -> tuple[Shape, ...]:
    """Return the shapes of an effect worth trying on the run that moves longest.

    For an axis, which may have any speed, an order of a periodic torque is worth trying if the
    torque's filter passes some of it where the motion is slowest (`highest_visible_order`).
    """
    run = longest_motion(observations.runs)
    shapes = effect.shapes(run.state)
    name = order_name(effect)
    if name is None or run.state.geometry is not None or not run.valid.any():
        return shapes
    highest = highest_visible_order(run)
    return tuple(shape for shape in shapes if single(shape[name]) <= highest)


def highest_visible_order(run: Run) -> float:
    """Return the order up to which a periodic torque shows in the slowest part of a motion.

    There the filter of the torque lets some of it pass. Its column passes the same filter.
    """
    slow = float(np.quantile(np.abs(run.speed[run.valid]), SLOWEST))
    return 2.0 * np.pi * BEYOND * run.conditioning.torque_cutoff_hz / slow


def order_name(effect: Effect) -> str | None:
    """Return the shape parameter of an effect that may be a tuple of orders, or None."""
    return next((parameter.name for parameter in effect.parameters
                 if parameter.per_order and parameter.is_shape), None)


def best_shape(effect: Effect, shapes: Sequence[Shape],
               worth: Callable[[Sequence[Shape]], np.ndarray]) -> tuple[Shape, float]:
    """Return the shape of the largest worth, found around the best of `shapes`, and its worth."""
    worths = worth(shapes)
    shape, most = shapes[int(np.argmax(worths))], float(np.max(worths))
    for step in (1.0, 0.5, 0.25):
        around = effect.refined(shape, step)
        if len(around) < 2:
            break
        worths = worth(around)
        if np.max(worths) > most:
            shape, most = around[int(np.argmax(worths))], float(np.max(worths))
    return shape, most


def self_consistent(projection: Projection, effect: Effect, shape: Shape) -> Shape:
    """Return the shape of a series whose fitted coefficient is the value that the shape assumes."""
    for _ in range(EXPANSIONS):
        estimate = projection.estimate(effect, shape)
        shape = {'expanded_at': float(estimate[0])}
    return shape
