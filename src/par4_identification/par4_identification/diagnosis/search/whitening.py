"""The noise of the rows: what is left after all that follows the motion has been taken away."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from par4_dynamics.effects.cogging import HIGHEST_PERIODS
from par4_dynamics.effects.effect import Effect
from par4_identification.diagnosis.evidence.dithered import Dithered
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.fit import Fit, residuals, solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import PRIOR_ROWS
from par4_identification.diagnosis.evidence.observations import Observations
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.side_by_side import side_by_side
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.evidence.whitener import (
    Whitener,
    flat_whitener,
    whitener_of_residuals,
)
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.counts import Counts
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.signals.noise import ArNoise
from par4_identification.signals.plateaus import scatter

WORTH = 0.1
"""Share of the squares of rows it was not fitted to that an unnamed function must take away."""
MOST = 3
"""Unnamed functions that are taken away from a joint."""
QUIETER = 0.7
"""Share of the variance of the noise below which a model's rest is taken as the noise."""
AS_LARGE = 1.05
"""Standard deviation of the noise of an axis over that of another up to which it is no larger."""
BY_COUNTS = 0.5
"""Share of what an effect explains that encoder counts may make, from which on it explains noise.
"""
HALF = 1.0
"""s after which the two halves of the rows alternate."""


def whitener_of(observations: Observations, sigma: np.ndarray, library: Mapping[str, Effect],
                kinds: Kinds, rules: Rules, moved: Dithered) -> Whitener:
    """Return the model of the noise that neither effects nor unnamed functions explain.

    A poorer model would take what it lacks for noise, and whitening would then hide it. An effect
    that may owe most of what it explains to encoder counts takes noise away: a soft transmission
    lets through less of what counts make of the acceleration. Of steady speeds the noise is
    measured: by the parts of each plateau and by how plateaus of neighbouring speeds differ.

    Args:
        observations: rows to fit.
        sigma: size of the residuals of the base model, (J,), N m.
        library: effects, each of which is fitted at its best shape.
        kinds: of unnamed functions.
        rules: for the search of shapes.
        moved: the motion as other encoders could have read it.
    """
    if observations.steady:
        return flat_whitener(observations, _noise_of_plateaus(observations))
    flat = gather(observations, flat_whitener(observations, sigma))
    projection, counts = project(flat, []), Counts(moved)
    found = Candidates(library, flat, rules).all_of(projection, set(), wanted=0.0)
    richest = [item.hypothesis for item in found if counts.imitate(
        projection, item.hypothesis, BY_COUNTS * item.gain) < BY_COUNTS * item.gain]
    left = residuals(observations, richest, solve(flat, richest))
    return whitener_of_residuals(observations, _without_unnamed(observations, left, kinds),
                                 flat.design(richest).shape[1])


def quieter(whitener: Whitener, observations: Observations, model: Sequence[Hypothesis], fit: Fit,
            kinds: Kinds) -> Whitener:
    """Return the smaller noise of each joint: that of the noise model, or what a model leaves.

    Causes that hide each other count as noise at the first look. Once some are found, the
    rest of them shows.
    """
    if observations.steady:
        return whitener
    left = residuals(observations, model, fit)
    found = whitener_of_residuals(observations, _without_unnamed(observations, left, kinds),
                                  len(fit.covariance))
    most = AS_LARGE if observations.of_axis else np.inf
    return replace(whitener, noise=tuple(
        new if _is_quieter(new, old, most) else old
        for new, old in zip(found.noise, whitener.noise)))


def _is_quieter(new: ArNoise, old: ArNoise, most: float) -> bool:
    """Return whether a noise is the smaller one by what is new in each row.

    As a whole it may be `most` times as large. One whose rows tell more of each other, but which is
    larger, only wanders more. That is what a wrong cause leaves, or a law that an axis follows less
    closely than a Par4 does.
    """
    return new.variance < QUIETER * old.variance and new.size < most * old.size


def _noise_of_plateaus(observations: Observations) -> np.ndarray:
    """Return the standard deviation (J,) of the mean torques at steady speeds."""
    known = np.mean([run.noise_floor ** 2 for run in observations.runs], axis=0)
    speed, target, valid = (np.concatenate(parts) for parts in (
        [run.speed for run in observations.runs], observations.target,
        [run.valid for run in observations.runs]))
    differing = [scatter(*(part[valid[:, joint], joint] for part in (speed, target)))
                 for joint in range(len(known))]
    return np.sqrt(np.maximum(known, differing))


def _without_unnamed(observations: Observations, left: tuple[np.ndarray, ...], kinds: Kinds
                     ) -> tuple[np.ndarray, ...]:
    """Return residuals (m, J) without the unnamed functions that one half tells of the other.

    Their waves have the orders of an arm. Effects have more on an axis; of so many unnamed ones the
    strongest would be noise.
    """
    rows = side_by_side(partial(observations.effect_rows, shape={}),
                        kinds.beside(observations, left, HIGHEST_PERIODS))
    lengths = np.cumsum([len(part) for part in left])[:-1]
    kept = np.concatenate(left)
    time = np.concatenate([run.t for run in observations.runs])
    halves = (time // HALF % 2).astype(bool)

    def of_joint(joint: int) -> np.ndarray:
        valid = np.concatenate([run.valid[:, joint] for run in observations.runs])
        designs = [np.concatenate([part[:, joint] for part in parts]) for parts in rows]
        target = kept[:, joint]
        for _ in range(MOST):
            before = float(np.sum(target[valid] ** 2))
            squares = [sum(float(np.sum((target - design @ _ridge(design, target, valid & half))
                                        [valid & ~half] ** 2)) for half in (halves, ~halves))
                       for design in designs]
            best = int(np.argmin(squares))
            if squares[best] > (1.0 - WORTH) * before:
                break
            target = target - designs[best] @ _ridge(designs[best], target, valid)
        return target

    return tuple(np.split(np.stack(side_by_side(of_joint, range(observations.joints)), axis=1),
                          lengths))


def _ridge(design: np.ndarray, target: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return coefficients (k,) of columns (n, k), fitted to some rows with the prior."""
    columns, wanted = design[rows], target[rows]
    gram = columns.T @ columns
    own = np.maximum(np.diag(gram), np.diag(gram).mean())
    gram[np.diag_indices(len(gram))] += PRIOR_ROWS / max(len(columns), 1) * own + 1e-30
    return np.linalg.lstsq(gram, columns.T @ wanted, rcond=1e-12)[0]
