"""Where the compliances of transmissions lie: their resonances make the fit far from linear."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from par4_dynamics.effects.elastic_transmission import STIFFNESSES, ElasticTransmission
from par4_dynamics.effects.transmission import DAMPING_RATIO, Springs
from par4_identification.diagnosis.evidence import Projection

GRID = np.geomspace(1e-5, 1e-2, 19)
"""rad/(N m): a resonance apart at the coarse damping."""
COARSE_DAMPING = 0.1
"""Of the first search: wide resonances overlap, and so do the basins of the fit."""
COARSE_STEP = 2
"""Samples from step to step of the integration in the first search."""
SOFTEST, STIFFEST = (1.0 / stiffness for stiffness in STIFFNESSES)
"""rad/(N m): compliances of what is believed."""
SWEEPS, STEPS, TRIALS = 2, 12, 5
CHANGE = 1e-3
"""Of log compliance, for its derivative."""
WIDEST = 0.7
"""Step of log compliance."""


def compliances(projection: Projection) -> tuple[np.ndarray, float] | None:
    """Return the compliances (J,), rad/(N m), whose torque the target has, and what that explains.

    The second is twice the gain in log-likelihood with the torque as large as the compliances make
    it, so that noise in the columns cannot pass as a twist of another size or sign. None where no
    compliance explains anything.
    """
    evidence, target = projection.evidence, projection.residual
    springs = {id(run.state): Springs(run.state) for run in evidence.observations.runs}

    def left(log_compliance: np.ndarray, damping: float) -> np.ndarray:
        torque = evidence.torque(
            (ElasticTransmission, (damping, *np.round(log_compliance, 9))),
            lambda state: springs[id(state)].torque(
                np.exp(log_compliance), damping,
                COARSE_STEP if damping == COARSE_DAMPING else 1)[1])
        return target - projection.rest(torque)

    found = np.full(evidence.observations.joints, np.log(STIFFEST))
    best = before = _square(target)
    for _ in range(SWEEPS):
        start = found
        for joint in range(len(found)):
            for value in np.log(GRID):
                trial = found.copy()
                trial[joint] = value
                size = _square(left(trial, COARSE_DAMPING))
                if size < best:
                    found, best = trial, size
        if found is start:
            break
    if best >= before:
        return None
    found = np.maximum(found, np.log(3.0 * STIFFEST))
    for damping in (COARSE_DAMPING, DAMPING_RATIO):
        found, best = _descend(lambda x, damping=damping: left(x, damping), found)
    return np.exp(found), before - best


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
