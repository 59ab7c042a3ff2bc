"""What a diagnosis answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.effect import Effect
from par4_dynamics.model_file import ModelFile
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.holdout import Gain
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.search import Rejected
from par4_identification.diagnosis.verdict.judgement import UnnamedCause
from par4_identification.diagnosis.verdict.pair import Pair
from par4_identification.diagnosis.verdict.unrelated import Unrelated
from par4_identification.signals.rows import Run

Verdict = Literal['clean', 'explained', 'partly_explained', 'unknown']


@dataclass(frozen=True)
class Cause:
    """A named cause.

    Attributes:
        effect: from the catalogue.
        joints: where it acts.
        parameters: with standard deviations; one number for the machine or one a joint in
            `joints`.
        twins: names that explain the data as well.
        visible_fraction: rms left of it after refitting the base parameters, over its full rms.
        p_value: family-wise.
        margin: log-likelihood on rows that no fit has seen, over the best that could stand in
            its place.
        rival: what that is: a name, a kind of unnamed cause, or None for nothing.
        gain: share of the squared error of held-out rows, whitened, that it removes beside the
            other causes.
        predictable: whether the model can say its torque at each instant.
    """

    effect: Effect
    joints: tuple[int, ...]
    parameters: dict[str, Parameter]
    twins: tuple[str, ...]
    visible_fraction: float
    p_value: float
    margin: float
    rival: str | None
    gain: Gain
    predictable: bool = True

    @property
    def is_nothing(self) -> bool:
        """Whether all sizes that it is told with are zero within their deviations."""
        return self.is_zero_within(1.0)

    def is_zero_within(self, deviations: float) -> bool:
        """Return whether all sizes that it is told with are zero within so many deviations."""
        sizes = [self.parameters[parameter.name] for parameter in self.effect.parameters
                 if not parameter.is_shape and parameter.name in self.parameters]
        return bool(sizes) and all(np.all(
            np.abs(np.asarray(size.value, dtype=float))
            <= deviations * np.asarray(size.std, dtype=float)) for size in sizes)


@dataclass(frozen=True)
class Holdout:
    """Held-out rows before and after, for errors and pictures.

    Attributes:
        runs: the rows.
        baseline, extended: residuals (m, J) of each run, N m.
        baseline_rms, extended_rms, noise_floor_rms: (J,), N m, over valid rows.
        explained_fraction: (before - after) / (before - floor) in mean squares.
        interval: 95 %, block bootstrap.
    """

    runs: tuple[Run, ...]
    baseline: tuple[np.ndarray, ...]
    extended: tuple[np.ndarray, ...]
    baseline_rms: np.ndarray
    extended_rms: np.ndarray
    noise_floor_rms: np.ndarray
    explained_fraction: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Remaining:
    """What neither names nor unnamed causes explain.

    Attributes:
        floor_excess: its rms on held-out rows over the noise floor.
        unrelated: what of it follows nothing in the motion.
        nearest: where nothing is named, the effect that explains most without passing as a cause.
        uneven: whether torques at steady speeds miss the model by more than their own noise, though
            no function of the speed fits them all.
        swing_hz: frequency of something that swings and is most of it, Hz; None where nothing does.
    """

    floor_excess: float
    unrelated: Unrelated
    nearest: Effect | None
    uneven: bool = False
    swing_hz: float | None = None


@dataclass(frozen=True)
class Unusable:
    """Data that cannot carry a diagnosis.

    Attributes:
        reasons: why, and behind a semicolon what to do.
        fit_runs: rows that were to be fitted.
    """

    reasons: tuple[str, ...]
    fit_runs: tuple[Run, ...]
    verdict: ClassVar[str] = 'unusable_data'


@dataclass(frozen=True)
class Diagnosis:
    """The answer.

    Attributes:
        verdict: 'clean', 'explained', 'partly_explained' or 'unknown'.
        causes: with a name, strongest first.
        unnamed: causes without a name, strongest first.
        rejected: candidates that were looked at and why they are no causes.
        holdout: errors before and after.
        remaining: what is left.
        base_before, base_after: base parameters without and with the named causes.
        extended_model: base parameters and named causes as one model.
        fit_runs: rows that were fitted.
        evidence: these rows, whitened.
        hypotheses: of the named causes, in their order.
        fitted_rms: what base parameters and named causes leave on the rows that were fitted, N m.
        left_out: base parameters that the motion does not show.
        share: of the readings of long logs that was looked at, in stretches spread over them.
        doubts: what is unnamed or nearly passes as a cause, and what else it may be.
        effects: what their names stand for.
    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    unnamed: tuple[UnnamedCause, ...]
    rejected: tuple[Rejected, ...]
    holdout: Holdout
    remaining: Remaining
    base_before: dict[str, Parameter]
    base_after: dict[str, Parameter]
    extended_model: ModelFile
    fit_runs: tuple[Run, ...]
    evidence: Evidence
    hypotheses: tuple[Hypothesis, ...]
    fitted_rms: float = 0.0
    left_out: tuple[str, ...] = ()
    share: float = 1.0
    doubts: tuple[Pair, ...] = ()
    effects: Mapping[str, Effect] = field(default_factory=lambda: CATALOGUE)
