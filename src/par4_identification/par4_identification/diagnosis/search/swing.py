"""Where the compliances of transmissions lie: their resonances make the fit far from linear."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from par4_dynamics.effects.elastic_transmission import STIFFNESSES, ElasticTransmission
from par4_dynamics.effects.transmission import DAMPING_RATIO, Springs
from par4_identification.diagnosis.evidence.evidence import Projection

GRID = np.geomspace(1e-5, 1e-2, 19)
"""rad/(N m): a resonance apart at the coarse damping."""
COARSE_DAMPING = 0.1
"""Of the first search: wide resonances overlap, and so do the basins of the fit."""
COARSE_STEP = 2
"""Samples from step to step of the integration in the first search."""
SOFTEST, STIFFEST = (1.0 / stiffness for stiffness in STIFFNESSES)
"""rad/(N m): compliances of what is believed."""
SWEEPS, STEPS, TRIALS = 3, 12, 5
TINY = 1e-12
"""rad/(N m): what is rigid, where a logarithm is taken."""
CHANGE = 1e-3
"""Of log compliance, for its derivative."""
WIDEST = 0.7
"""Step of log compliance."""


def compliances(projection: Projection, least: float) -> tuple[np.ndarray, float] | None:
    """Return the compliances (J,), rad/(N m), whose torque the target has, and what that explains.

    The second is twice the gain in log-likelihood with the torque as large as the compliances make
    it, so that noise in the columns cannot pass as a twist of another size or sign. None where no
    compliance explains more than `least` at a first look.
    """
    evidence, target = projection.evidence, projection.residual
    springs = {id(run.state): Springs(run.state) for run in evidence.observations.runs}

    def torque(compliance: np.ndarray, damping: float) -> np.ndarray:
        return evidence.torque(
            (ElasticTransmission, (damping, *np.round(np.log(compliance + TINY), 9))),
            lambda state: springs[id(state)].torque(
                compliance, damping, COARSE_STEP if damping == COARSE_DAMPING else 1)[1])

    def left(log_compliance: np.ndarray, damping: float) -> np.ndarray:
        return target - projection.rest(torque(np.exp(log_compliance), damping))

    joints = evidence.observations.joints
    alone = [torque(compliance * unit, COARSE_DAMPING)
             for unit in np.eye(joints) for compliance in GRID]
    found, worth = _first_look(projection.rest(np.stack(alone, axis=1)), target, joints)
    if worth <= least:
        return None
    for damping in (COARSE_DAMPING, DAMPING_RATIO):
        found, best = _descend(lambda x, damping=damping: left(x, damping), found)
    return np.exp(found), _square(target) - best


def _first_look(alone: np.ndarray, target: np.ndarray, joints: int) -> tuple[np.ndarray, float]:
    """Return the log compliances (J,) that explain most, and how much, if no joint moves another.

    Args:
        alone: torque of each compliance of `GRID` on each joint, the others rigid, (n, J * g).
        target: (n,).
        joints: J.
    """
    moment, gram = alone.T @ target, alone.T @ alone
    chosen = np.full(joints, -1)  # rigid
    squares = 0.0
    for _ in range(SWEEPS):
        for joint in range(joints):
            others = np.array([index for other, index in enumerate(chosen)
                               if other != joint and index >= 0], dtype=int)
            first = joint * len(GRID)
            own = np.arange(first, first + len(GRID))
            rest = 2.0 * moment[others].sum() - gram[np.ix_(others, others)].sum()
            worth = (rest + 2.0 * moment[own] - gram[own, own]
                     - 2.0 * gram[np.ix_(own, others)].sum(axis=1))
            best = int(np.argmax(worth))
            chosen[joint], squares = ((own[best], float(worth[best])) if worth[best] > rest
                                      else (-1, float(rest)))
    stiff = np.log(3.0 * STIFFEST)
    return np.array([stiff if index < 0 else np.log(GRID[index % len(GRID)])
                     for index in chosen]), squares


def _descend(left: Callable[[np.ndarray], np.ndarray], x: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the minimum of |left(x)|^2 near x and its value, by Levenberg and Marquardt."""
    now, weight = left(x), 1e-2
    for _ in range(STEPS):
        slope = np.stack([(left(x + CHANGE * unit) - now) / CHANGE for unit in np.eye(len(x))], 1)
        gram = slope.T @ slope
        size = np.diag(np.diag(gram) + 1e-9 * np.trace(gram) + 1e-12)
        done = True
        for _ in range(TRIALS):
            step = np.linalg.solve(gram + weight * size, -slope.T @ now)
            trial = np.clip(x + np.clip(step, -WIDEST, WIDEST), np.log(2.0 * STIFFEST),
                            np.log(SOFTEST))
            after = left(trial)
            if _square(after) < _square(now):
                done = _square(now) - _square(after) < 1e-4 * _square(now)
                x, now, weight = trial, after, max(weight / 10.0, 1e-6)
                break
            weight *= 10.0
        if done:
            break
    return x, _square(now)


def _square(values: np.ndarray) -> float:
    return float(values @ values)
