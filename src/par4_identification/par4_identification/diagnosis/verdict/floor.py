"""The noise floor: the residual that a perfect model would still leave."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.model import Model
from par4_identification.diagnosis.evidence.dithered import dithered_state, is_noisy
from par4_identification.diagnosis.evidence.fit import Fit
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.signals.run import Run

WINDOW = 30
"""Torque noise is measured in stretches of standstill of so many rows."""
LEAST_WINDOWS = 3
LONGEST = 60_000
"""Samples of a run from which the noise of encoder counts is computed. More of them change the
result by a few percent."""


def torque_noise(runs: Sequence[Run]) -> np.ndarray:
    """Return the standard deviation (J,), N m, of the torque noise in the rows.

    There are two measures, and the larger one counts. The first is the level above the pass band;
    jumps of the acceleration raise it. The second is the scatter while the machine rests, where
    little but noise moves the torque; it counts where there are at least `LEAST_WINDOWS` windows of
    rest. A resting drive creeps, and now and then it breaks loose. A parabola is therefore taken
    out of each window, and the median over the windows is used.
    """
    floor = np.sqrt(np.mean([run.noise_floor ** 2 for run in runs], axis=0))
    time = np.arange(WINDOW)
    for joint in range(len(floor)):
        variances = []
        for run in runs:
            resting, tau = run.standstill[:, joint], run.tau[:, joint]
            for first in range(0, len(tau) - WINDOW + 1, WINDOW):
                window = slice(first, first + WINDOW)
                if resting[window].all():
                    left = tau[window] - np.polyval(np.polyfit(time, tau[window], 2), time)
                    variances.append(left @ left / (WINDOW - 3))
        if len(variances) >= LEAST_WINDOWS:
            floor[joint] = max(floor[joint], np.sqrt(np.median(variances)))
    return floor


def deviation_of_base(observations: Observations, fit: Fit) -> np.ndarray:
    """Return the standard deviation (J,), N m, of the torque of base parameters of a fit on rows.

    Where the fitted motion hardly tells a parameter, such as the inertia by slow ones, it is off by
    more than noise on another motion.
    """
    count = len(observations.terms)
    covariance = fit.covariance[:count, :count]
    squares = sum(np.sum(np.einsum('mjp,pq,mjq->mj', base, covariance, base) * run.valid, axis=0)
                  for run, base in zip(observations.runs, observations.base))
    rows = np.sum([np.count_nonzero(run.valid, axis=0) for run in observations.runs], axis=0)
    return np.sqrt(np.asarray(squares) / np.maximum(rows, 1))


def encoder_noise(runs: Sequence[Run], model: Model) -> np.ndarray:
    """Return the standard deviation (J,), N m, of the calculated torque that encoders cause.

    Positions are known to one count, or to the noise that they show. The torque of the model is
    calculated twice, from the measured positions and from positions that the encoders could have
    told as well; the difference is the noise.
    """
    joints = runs[0].tau.shape[1]
    if not is_noisy(runs):
        return np.zeros(joints)
    random = np.random.default_rng(0)
    squares, rows = np.zeros(joints), np.zeros(joints)
    for run in runs:
        state = run.state.part(slice(0, LONGEST))
        moved = dithered_state(run, state, random)
        # friction's sign is the same: rows near its change are not used
        change = run.rows(model.torque(moved) - model.torque(state))
        valid = run.valid[:len(change)]
        squares += np.sum(np.where(valid, change, 0.0) ** 2, axis=0)
        rows += valid.sum(axis=0)
    return np.sqrt(squares / np.maximum(rows, 1))


def noise_floor(runs: Sequence[Run], model: Model) -> np.ndarray:
    """Return the standard deviation (J,), N m, of the rows' residual under a perfect model.

    What counts make of effects with a nominal torque is left out: a soft transmission that swings
    with them would make any error a floor.
    """
    simple = replace(model, effects=tuple(
        active for active in model.effects if not active.effect.needs_nominal))
    return np.sqrt(torque_noise(runs) ** 2 + encoder_noise(runs, simple) ** 2
                   + _by_times_of_readings(runs) ** 2 + rounding_noise(runs, simple) ** 2)


def rounding_noise(runs: Sequence[Run], model: Model) -> np.ndarray:
    """Return the deviation (J,), N m, of rows by rounded torques, beyond white noise as large.

    Where torque changes slowly its readings stay near one end of a step for long, which the
    low-pass lets through. The torque of the model is rounded as the readings are, with noise as
    large as theirs.
    """
    joints = runs[0].tau.shape[1]
    random = np.random.default_rng(0)
    squares, rows = np.zeros(joints), np.zeros(joints)
    for run in runs:
        if not run.torque_step.any():
            continue
        torque = model.torque(run.state.part(slice(0, LONGEST)))
        white = random.standard_normal(torque.shape)
        passes = np.mean(run.rows(white) ** 2, axis=0)
        rounded = run.torque_step ** 2 / 12.0
        told = torque + white * np.sqrt(np.maximum(run.noise_floor ** 2 / passes - rounded, 0.0))
        step = np.maximum(run.torque_step, 1e-30)
        change = run.rows(np.where(rounded > 0.0, step * np.round(told / step) - told, 0.0))
        valid = run.valid[:len(change)]
        squares += np.sum(np.where(valid, change ** 2 - passes * rounded, 0.0), axis=0)
        rows += valid.sum(axis=0)
    return np.sqrt(np.maximum(squares, 0.0) / np.maximum(rows, 1))


def _by_times_of_readings(runs: Sequence[Run]) -> np.ndarray:
    """Return the rms (J,), N m, of what the times of readings make of rows where torque jumps."""
    squares = sum(np.sum(np.where(run.valid, run.timing_error, 0.0) ** 2, axis=0) for run in runs)
    return np.sqrt(squares / np.maximum(sum(run.valid.sum(axis=0) for run in runs), 1))
