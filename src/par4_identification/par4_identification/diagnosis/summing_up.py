"""The answer from the causes that a search has found: margins, what remains, verdict, model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.effects.backlash import Backlash
from par4_dynamics.effects.effect import Effect
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import torque_model
from par4_identification.diagnosis.evidence.extended import (
    as_told,
    base_parameters,
    extended_model,
)
from par4_identification.diagnosis.evidence.fit import Fit, residuals, rms_of, solve
from par4_identification.diagnosis.evidence.holdout import Blocks
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.progress import Progress
from par4_identification.diagnosis.search.causes import Hypotheses, unnamed_of
from par4_identification.diagnosis.search.requirement import torque_errors
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.simplicity import best_first
from par4_identification.diagnosis.verdict.answer import (
    Diagnosis,
    Holdout,
    Remaining,
    Verdict,
)
from par4_identification.diagnosis.verdict.floor import deviation_of_base, noise_floor
from par4_identification.diagnosis.verdict.judgement import doubt_of, unnamed_cause
from par4_identification.diagnosis.verdict.loose_loads import cause_of
from par4_identification.diagnosis.verdict.loudness import follows_in_size
from par4_identification.diagnosis.verdict.pair import Pair
from par4_identification.diagnosis.verdict.settled import settle
from par4_identification.diagnosis.verdict.sure import is_most_of_it, is_no_noise
from par4_identification.diagnosis.verdict.true_angles import by_true_angles
from par4_identification.diagnosis.verdict.unrelated import left_of, swing_of, unrelated
from par4_identification.signals.run import Run
from par4_kinematics.robot import Axis, Robot

UNEVEN = 3.0
"""Ratio beyond which the means of steady speeds contain more than noise: what the model leaves of
them (rms) over their deviation, as told by how the parts of each stretch differ. Noise that wanders
makes both larger."""


def summed_up(search: Search, model: Hypotheses, machine: Robot | Axis, baseline: ModelFile | None,
              rigid_body: str, effects: Mapping[str, Effect], fit_runs: tuple[Run, ...],
              progress: Progress) -> Diagnosis:
    """Return what is said of the causes that a search has found.

    Args:
        search: over the rows to fit and the rows held out.
        model: the causes that it has found.
        machine: that was recorded.
        baseline: the model that was taken as known, if any.
        rigid_body: of the base model, 'paper' or 'full'.
        effects: by name, those of the library and of the catalogue.
        fit_runs: rows to fit, as they came.
        progress: called with the name of each step.
    """
    pool, rules = search.pool, search.rules
    evidence, heldout = pool.evidence, pool.heldout.observations
    progress('comparing each cause with what could stand in its place')
    base_only = search.weighing.corrected(solve(evidence, ()))
    settled = settle(search, model, noise_floor(heldout.runs, torque_model(
        machine, extended_model(baseline, rigid_body, evidence, (), base_only), effects)))
    model, named, told = settled.model, settled.named, settled.told
    causes = by_true_angles(settled.causes)
    whole = search.weighing.corrected(solve(evidence, model))
    blocks = settled.blocks
    unnamed = sorted(((unnamed_cause(search, item, model), item) for item in unnamed_of(model)),
                     key=lambda pair: -pair[0].margin)
    progress('checking what remains')
    before, after, left = (residuals(heldout, part, fit) for part, fit in (
        ((), base_only), (named, told), (model, whole)))
    errors = torque_errors(evidence, whole, rules)
    extended = as_told(extended_model(baseline, rigid_body, evidence, named, told, errors),
                       [cause.parameters for cause in causes])
    floor = noise_floor(heldout.runs, torque_model(machine, extended, effects))
    hypotheses = named
    if settled.loose is not None:
        cause, entry = cause_of(search.candidates.library[Backlash.name], settled.loose)
        causes.append(cause)
        hypotheses = (*named, Hypothesis(cause.effect, {}, cause.joints))
        extended = extended.model_copy(update={'effects': (*extended.effects, entry)})
    remaining, near = _remaining(search, model, named, (base_only, whole), (before, after, left),
                                 floor, blocks, is_caused=bool(causes))
    doubts = [doubt_of(search, item, model) for item in unnamed_of(model)] or [
        None if near is None else Pair(near, None, (), twins=False)]
    alone = remaining.unrelated
    incomplete = bool(unnamed or settled.loose or alone.lines or alone.bursts or remaining.nearest
                      or remaining.uneven or remaining.no_noise or remaining.swing_hz)
    answer = Diagnosis(
        verdict=_verdict(bool(causes), incomplete), causes=tuple(causes),
        unnamed=tuple(cause for cause, _ in unnamed),
        rejected=search.journal.beside(item.label for item in named),
        # noise that is louder than what is left is none of these rows
        holdout=_holdout(heldout.runs, blocks, before, after, np.minimum(
            floor, np.sqrt(blocks.mean_square(left)))), remaining=remaining,
        base_before=base_parameters(evidence, base_only, torque_errors(evidence, base_only, rules)),
        base_after=base_parameters(evidence, told, errors), extended_model=extended,
        fit_runs=fit_runs, evidence=evidence, hypotheses=hypotheses,
        unnamed_hypotheses=tuple(item for _, item in unnamed),
        fitted_rms=rms_of(evidence.observations, residuals(evidence.observations, named, told)),
        doubts=tuple(pair for pair in doubts if pair is not None), effects=effects)
    # rows held out may lack what is wrong with the fitted ones, which nothing has explained then
    return replace(answer, verdict=_verdict(bool(causes), incomplete or answer.fitted_unlike))


def _remaining(search: Search, model: Hypotheses, named: Hypotheses,
               fits: tuple[Fit, Fit], residual: Sequence[tuple[np.ndarray, ...]], floor: np.ndarray,
               blocks: Blocks, is_caused: bool) -> tuple[Remaining, Hypothesis | None]:
    """Return what no cause explains, and the effect that comes nearest to it.

    Args:
        search: over the rows to fit and the rows held out.
        model, named: all causes, and those with a name.
        fits: of the base parameters alone, and of the whole model.
        residual: of the base parameters alone, beside `named` and beside `model`; each (m, J) N m
            of each held-out run.
        floor: that noise alone would leave, (J,), N m.
        blocks: of the held-out rows.
        is_caused: whether the answer has a named cause.
    """
    pool, rules = search.pool, search.rules
    heldout, (base_only, whole) = pool.heldout.observations, fits
    before, after, left = residual
    rest = tuple(left_of(part.observations, model, base_only, whole, rules)
                 for part in (pool.evidence, pool.heldout))
    # what the fitted rows of a Par4 hardly tell is off on another motion, which is no fault of it;
    # the model of an axis may be wrong by so much more that its deviations say nothing
    known = floor if heldout.of_axis else np.hypot(floor, deviation_of_base(heldout, whole))
    alone = unrelated(rest[0], rest[1], known, rules, named=not unnamed_of(model))
    excess = float(np.sqrt(blocks.mean_square(left).sum() / max((known ** 2).sum(), 1e-30)))
    near = None if is_caused else _nearest(search, excess > rules.floor_excess)
    steady = pool.evidence.observations.steady
    swing = None if steady or excess < rules.floor_excess or alone.lines else swing_of(rest)
    # there may be causes that no function of the motion follows, such as a load with play
    no_noise = not steady and (
        is_most_of_it(heldout, left, known, rules) or (
            is_no_noise(heldout, left, [old - new for old, new in zip(before, after)], named, known,
                        rules)
            if heldout.of_axis else
            excess > rules.floor_excess and follows_in_size(*rest)))
    return Remaining(excess, alone, None if near is None else near.named,
                     steady and excess > UNEVEN, swing, no_noise), near


def _verdict(named: bool, incomplete: bool) -> Verdict:
    """Return the verdict by whether there are names and whether anything is beside them."""
    if named:
        return 'partly_explained' if incomplete else 'explained'
    return 'unknown' if incomplete else 'clean'


def _nearest(search: Search, is_much: bool) -> Hypothesis | None:
    """Return the effect that rows to fit and rows held out know best though it is no cause.

    Unless much is left, it must be one that a machine can have: friction just before a joint sticks
    is less than its law says, on sound machines, too.
    """
    found = search.candidates.all_of(search.weighing.beside(()), set())
    best = min(found, key=lambda item: best_first(search.pool, item.hypothesis, -item.gain),
               default=None)
    if best is None:
        return None
    needed = search.weighing.requirement((best.hypothesis,))
    fit_gain, gain = search.weighing.sound_gains(best.hypothesis, ())
    evident = fit_gain > needed.fit and gain > needed.heldout and (
        is_much or search.belief.objection(best.hypothesis, ()) is None)
    return best.hypothesis if evident else None


def _holdout(runs: Sequence[Run], blocks: Blocks, before: Sequence[np.ndarray],
             after: Sequence[np.ndarray], floor: np.ndarray) -> Holdout:
    counts, old, new = blocks.counts(), blocks.sums(before), blocks.sums(after)

    def fraction(weights: np.ndarray) -> float:
        # each joint counts with the inverse of its noise, so that none drowns the others
        scale = np.maximum(floor, 1e-9) ** 2
        total = (weights @ (old / scale)).sum()
        closed = total - (weights @ (new / scale)).sum()
        open_before = total - (weights @ counts).sum()
        return float(np.clip(closed / max(open_before, 1e-30), -1.0, 1.0)) if (
            open_before > 0.0) else 0.0

    drawn = [fraction(weights) for weights in blocks.draws]
    low, high = np.quantile(drawn, (0.025, 0.975))
    return Holdout(
        tuple(runs), tuple(before), tuple(after), np.sqrt(blocks.mean_square(before)),
        np.sqrt(blocks.mean_square(after)), floor, fraction(np.ones(len(old))),
        (float(low), float(high)))
