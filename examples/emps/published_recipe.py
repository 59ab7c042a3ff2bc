"""The published recipe (Janot, Gautier and Brunot 2019), as calls of the library and of scipy.

Position through a zero-phase Butterworth filter, central differences, zero-phase decimation of
force and columns, ordinary least squares.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import butter, cheby1, filtfilt

from par4_identification import Estimate, Problem, Series, ordinary, problem_of

CUTOFF_HZ, ORDER = 100.0, 4
"""Of the Butterworth filter, run forward and backward, padded by three times its order."""
DROPPED = 49
"""Samples at the start that the recipe leaves out."""
FACTOR = 10
"""Of the decimation: Chebyshev I of order 8, 0.05 dB, at 0.8 / 10 of the Nyquist frequency."""
UNITS = {'M': 'kg', 'Fv': 'N s/m', 'Fc': 'N', 'offset': 'N', 'Fv+': 'N s/m', 'Fc+': 'N',
         'Fv-': 'N s/m', 'Fc-': 'N'}
COLUMNS = ('M', 'Fv', 'Fc', 'offset')
"""force = M a + Fv v + Fc sign v + offset."""
BY_DIRECTION = ('M', 'Fv+', 'Fc+', 'Fv-', 'Fc-')
"""Friction of its own in either direction."""


def published_problem(position: np.ndarray, force: np.ndarray, period: float,
                      names: Sequence[str] = COLUMNS) -> Problem:
    """Return the rows of the recipe.

    Args:
        position, force: (n,), m and N.
        period: s.
        names: of the parameters.
    """
    return problem_of_columns(recipe_columns(position, period, names), force)


def recipe_motion(position: np.ndarray, period: float
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return position, speed and acceleration (n,) as the recipe filters them."""
    smooth = filtfilt(*butter(ORDER, 2.0 * CUTOFF_HZ * period), position, padlen=3 * ORDER)
    speed = _difference(smooth, period)
    return smooth, speed, _difference(speed, period)


def recipe_columns(position: np.ndarray, period: float, names: Sequence[str]
                   ) -> dict[str, np.ndarray]:
    """Return what a unit of each parameter adds to the force, (n,)."""
    _, speed, acceleration = recipe_motion(position, period)
    forward, backward = speed > 0.0, speed < 0.0
    columns = {'M': acceleration, 'Fv': speed, 'Fc': np.sign(speed), 'offset': np.ones_like(speed),
               'Fv+': speed * forward, 'Fc+': 1.0 * forward, 'Fv-': speed * backward,
               'Fc-': -1.0 * backward}
    return {name: columns[name] for name in names}


def problem_of_columns(columns: Mapping[str, np.ndarray], force: np.ndarray,
                       counts: np.ndarray | None = None) -> Problem:
    """Return the rows of the recipe of any columns.

    Args:
        columns: what a unit of each parameter adds to the force, (n,).
        force: (n,), N.
        counts: samples whose rows count, (n,); all by default.
    """
    rows = _decimated(np.stack(list(columns.values()), axis=1)[DROPPED:])
    target = _decimated(force[DROPPED:, None])
    valid = (np.ones(target.shape, dtype=bool) if counts is None
             else _kept(counts[DROPPED:, None]))
    return problem_of([Series(target, rows[:, None], valid)], list(columns),
                      [UNITS.get(name, '') for name in columns])


def published_relative_std(problem: Problem, estimate: Estimate) -> np.ndarray:
    """Return relative deviations as published, (p,): the residual over N - 1 in place of N - p."""
    freedom = (problem.rows - problem.size) / (problem.rows - 1)
    return np.sqrt(freedom) * estimate.textbook_std / np.abs(estimate.values)


def published_estimate(position: np.ndarray, force: np.ndarray, period: float,
                       names: Sequence[str] = COLUMNS) -> tuple[Estimate, np.ndarray]:
    """Return the recipe's estimate and its relative deviations (p,)."""
    problem = published_problem(position, force, period, names)
    estimate = ordinary(problem)
    return estimate, published_relative_std(problem, estimate)


def _difference(values: np.ndarray, period: float) -> np.ndarray:
    """Return the second order central difference of (n,), one-sided at the ends."""
    return np.gradient(values, period)


def _decimated(values: np.ndarray) -> np.ndarray:
    """Return every tenth row of (n, k), low-passed; the last row is kept, as MATLAB keeps it."""
    return _kept(filtfilt(*cheby1(8, 0.05, 0.8 / FACTOR), values, axis=0, padlen=3 * 8))


def _kept(values: np.ndarray) -> np.ndarray:
    return values[(len(values) - 1) % FACTOR::FACTOR]
