"""The answer of a diagnosis: causes, verdict, errors and the extended model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
import scipy

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
from par4_identification.signals.run import Run

EITHER_SIDE = 2.0
"""Deviations of a 95 % interval."""
UNLIKE = 5.0
"""Error on fitted rows over that on rows held out from which the recordings hold different things:
motions alone make a factor of two or three."""
Verdict = Literal['clean', 'explained', 'partly_explained', 'unknown']


@dataclass(frozen=True)
class Cause:
    """A named cause.

    Attributes:
        effect: of the library that was searched.
        joints: indices of the joints on which it acts.
        parameters: name -> value with standard deviation: one number for the machine, or one for
            each of `joints`.
        twins: names that explain the fitted rows as well, within `Rules.twin`.
        visible_fraction: rms of its torque that no base parameter can take, over its full rms.
        p_value: of its gain on the fitted rows, family-wise over all effects and shapes.
        margin: log-likelihood on held-out rows, over the best that could stand in its place.
        rival: that best: a name, a kind of unnamed cause, or None for no cause.
        gain: share of the whitened squared error of held-out rows that it removes beside the other
            causes.
        predictable: whether the model can compute its torque at each instant; false for backlash
            that was told by its bounces.
        by_shape: variance of a size that is told at unit speed by that of the exponent alone.
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
    by_shape: Mapping[str, np.ndarray] = field(default_factory=dict)

    @property
    def is_nothing(self) -> bool:
        """Whether all its sizes are zero within one standard deviation."""
        return self.is_zero_within(1.0)

    @property
    def idle_joints(self) -> tuple[int, ...]:
        """Those of its joints whose own sizes are all zero within one standard deviation.

        There are none if no joint would be left, or if the effect acts on all joints or none.
        """
        if self.effect.shared and not self.effect.separable:
            return ()
        told = [parameter for parameter in self.effect.parameters
                if parameter.is_size and parameter.name in self.parameters]
        if not told or any(parameter.scope != 'joint' for parameter in told):
            return ()
        zero = np.ones(len(self.joints), dtype=bool)
        for size, std in self._sizes:
            small = np.abs(size) <= std
            zero &= np.all(np.reshape(small, (-1, len(self.joints))), axis=0)
        return () if zero.all() else tuple(
            joint for joint, idle in zip(self.joints, zero) if idle)

    def is_zero_within(self, deviations: float) -> bool:
        """Return whether all its sizes are zero within so many standard deviations."""
        return bool(self._sizes) and all(
            np.all(np.abs(size) <= deviations * std) for size, std in self._sizes)

    @property
    def may_be_zero(self) -> bool:
        """Whether all its sizes may be zero: by chance alone the largest of so many is as far off.

        One alone is within `EITHER_SIDE` deviations then, one of many by as much more as makes all
        of them as likely to be within (Sidak 1967).
        """
        count = max(sum(np.count_nonzero(std) for _, std in self._sizes), 1)
        inside = (2.0 * scipy.special.ndtr(EITHER_SIDE) - 1.0) ** (1.0 / count)
        return self.is_zero_within(float(scipy.special.ndtri(0.5 + 0.5 * inside)))

    @property
    def _sizes(self) -> list[tuple[np.ndarray, np.ndarray]]:
        """The values of sizes, and deviations that tell whether they are zero."""
        told = [(name, self.parameters[name]) for name in (
            parameter.name for parameter in self.effect.parameters
            if parameter.is_size or parameter.vanishing) if name in self.parameters]
        return [(np.asarray(size.value, dtype=float), np.sqrt(np.maximum(
            np.square(np.asarray(size.std, dtype=float)) - self.by_shape.get(name, 0.0), 0.0)))
            for name, size in told]


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

    @property
    def loudness(self) -> float:
        """Error without causes over the measured torque (rms) of these rows."""
        return self._over_torque(self.baseline_rms)

    @property
    def quietness(self) -> float:
        """Noise floor over the measured torque (rms) of these rows."""
        return self._over_torque(self.noise_floor_rms)

    def _over_torque(self, size: np.ndarray) -> float:
        torque = [run.tau[run.valid] for run in self.runs if run.valid.any()]
        whole = float(np.sqrt(np.mean(np.concatenate(torque) ** 2))) if torque else np.inf
        return float(np.sqrt(np.mean(size ** 2))) / max(whole, 1e-30)


@dataclass(frozen=True)
class Remaining:
    """What neither names nor unnamed causes explain.

    Attributes:
        floor_excess: rms of the remainder on held-out rows over the noise floor.
        unrelated: the parts of the remainder that follow nothing in the motion.
        nearest: if nothing is named, the effect that explains most without passing as a cause.
        uneven: whether torques at steady speeds differ from the model by more than their own noise,
            though no function of the speed fits them all.
        swing_hz: frequency, Hz, at which most of the remainder swings; None if it does not.
        no_noise: whether it is too much for noise and for what may be wrong of the torques, though
            it follows nothing that is known of the motion.
    """

    floor_excess: float
    unrelated: Unrelated
    nearest: Effect | None
    uneven: bool = False
    swing_hz: float | None = None
    no_noise: bool = False


@dataclass(frozen=True)
class Unusable:
    """Data that cannot carry a diagnosis.

    Attributes:
        reasons: each says why and, after a semicolon, what to do.
        fit_runs: rows that were to be fitted.
    """

    reasons: tuple[str, ...]
    fit_runs: tuple[Run, ...]
    verdict: ClassVar[str] = 'unusable_data'


@dataclass(frozen=True)
class Diagnosis:
    """The answer of a diagnosis.

    Attributes:
        verdict: 'clean', 'explained', 'partly_explained' or 'unknown'.
        causes: named causes, strongest first.
        unnamed: unnamed causes, strongest first.
        rejected: candidates that were looked at closely, and why they are no causes.
        holdout: errors on held-out rows without and with the named causes.
        remaining: what neither named nor unnamed causes explain.
        base_before, base_after: base parameters without and with the named causes.
        extended_model: base parameters and named causes as one model, the causes in their order
            behind the effects that were known.
        fit_runs: rows that were fitted.
        evidence: these rows, whitened.
        hypotheses: those of the named causes, in the order of `causes`.
        unnamed_hypotheses: those of the unnamed causes, in the order of `unnamed`.
        fitted_rms: rms that base parameters and named causes leave on the fitted rows, N m.
        left_out: names of base parameters that were not fitted because the motion does not show
            them.
        share: share of the readings that was looked at; less than 1 for long logs.
        doubts: each unnamed cause, or name that nearly passes as a cause, and what else it may be.
        effects: name -> effect, of the library that was searched and of the catalogue.
        swing_hz: lowest frequency, Hz, at which loads swing on transmissions that the search found,
            named or not; None if it found none.
        below_hz: such a frequency, below which the rows of this answer end; else None.
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
    unnamed_hypotheses: tuple[Hypothesis, ...] = ()
    fitted_rms: float = 0.0
    left_out: tuple[str, ...] = ()
    share: float = 1.0
    doubts: tuple[Pair, ...] = ()
    effects: Mapping[str, Effect] = field(default_factory=lambda: CATALOGUE)
    swing_hz: float | None = None
    below_hz: float | None = None

    @property
    def refitted_model(self) -> ModelFile:
        """The extended model without its causes, the base parameters fitted without them."""
        extended = self.extended_model
        return extended.model_copy(update={
            'parameters': {**extended.parameters, **self.base_before},
            'effects': extended.effects[:len(extended.effects) - len(self.causes)]})

    @property
    def fitted_unlike(self) -> bool:
        """Whether far more is left of the fitted rows than of those held out."""
        return bool(self.fitted_rms > UNLIKE * np.sqrt(np.mean(self.holdout.extended_rms ** 2)))
