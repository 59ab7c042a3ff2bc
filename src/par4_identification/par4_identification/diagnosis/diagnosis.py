"""From measured logs to causes: fit, search, confirm, sufficiency, verdict, extended model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.base_terms import BaseTerm
from par4_dynamics.effects.backlash import Backlash
from par4_dynamics.effects.catalogue import CATALOGUE, effect_named
from par4_dynamics.effects.effect import Effect
from par4_dynamics.effects.elastic_transmission import ElasticTransmission
from par4_dynamics.model import Model, build_model
from par4_dynamics.model_file import EffectEntry, ModelFile
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.estimates import effect_parameters
from par4_identification.diagnosis.evidence import (
    Evidence,
    Fit,
    Hypothesis,
    flat_whitener,
    gather,
    project,
    residuals,
    solve,
    whitener_of_residuals,
)
from par4_identification.diagnosis.floor import noise_floor
from par4_identification.diagnosis.gate import unusable
from par4_identification.diagnosis.holdout import Blocks, Gain, blocks_of_runs
from par4_identification.diagnosis.law import dithered
from par4_identification.diagnosis.observations import Observations, observe, with_nominal
from par4_identification.diagnosis.rattle import WIDTH_ERROR, Rattle, rattle
from par4_identification.diagnosis.rules import Rules
from par4_identification.diagnosis.selection import Found, Rejected, Selector
from par4_identification.diagnosis.shapes import EXPANSIONS
from par4_identification.diagnosis.sufficiency import (
    Remaining,
    Verdict,
    left_over,
    own_share,
    remaining_of,
    rings,
    verdict_of,
)
from par4_identification.identification import identify_runs
from par4_identification.log import Log
from par4_identification.progress import Progress, silent
from par4_identification.rows import Conditioning, Run, runs_of_log
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

CONDITIONING = Conditioning(low_speed=0.02)
"""Lower than identification's: effects of low speed must show."""
LIBRARY = {name: effect for name, effect in CATALOGUE.items()
           if name not in ('quantization', 'torque_saturation')}
"""Effects that may be named: all but those that add no torque to a motion."""

AGREED = 4
"""Times that base parameters and a time of the torque are fitted in turn."""
RETIMED = 0.5
"""Most of the base model's squared error that a torque of another time may leave, to be taken as
the nominal one."""



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
        gain: on held-out rows.
        predictable: whether the model can say its torque at each instant.
    """

    effect: Effect
    joints: tuple[int, ...]
    parameters: dict[str, Parameter]
    twins: tuple[str, ...]
    visible_fraction: float
    p_value: float
    gain: Gain
    predictable: bool = True


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
class Diagnosis:
    """The answer.

    Attributes:
        verdict: 'clean', 'explained', 'partly_explained', 'unknown' or 'unusable_data'.
        causes: strongest first.
        reasons: why the data are unusable, or why names were withheld.
        rejected: candidates that were looked at and why they are no causes.
        holdout: errors before and after; None for unusable data.
        remaining: what is left; None for unusable data.
        base_before, base_after: base parameters without and with the causes.
        extended_model: base parameters and causes as one model; None for unusable data.
        fit_runs: rows that were fitted.
        evidence: these rows, whitened; None for unusable data.
        hypotheses: of the causes, in their order.
    """

    verdict: Verdict
    causes: tuple[Cause, ...]
    reasons: tuple[str, ...]
    rejected: tuple[Rejected, ...]
    holdout: Holdout | None
    remaining: Remaining | None
    base_before: dict[str, Parameter]
    base_after: dict[str, Parameter]
    extended_model: ModelFile | None
    fit_runs: tuple[Run, ...]
    evidence: Evidence | None = None
    hypotheses: tuple[Hypothesis, ...] = ()


def split_runs(fit_logs: Sequence[Log], holdout_logs: Sequence[Log], machine: Robot | Axis,
               conditioning: Conditioning) -> tuple[list[Run], list[Run]]:
    """Return the rows to fit and those held out.

    Without held-out logs the last log is held out; of a single log the last stretch without gaps
    or, where there is one only, its last third, cut at a standstill within a sixth of the rows.
    """
    fit_runs = [run for log in fit_logs for run in runs_of_log(log, machine, conditioning)]
    if holdout_logs:
        return fit_runs, [run for log in holdout_logs
                          for run in runs_of_log(log, machine, conditioning)]
    if len(fit_logs) > 1:
        last = fit_logs[-1].name
        return ([run for run in fit_runs if run.name != last],
                [run for run in fit_runs if run.name == last])
    if len(fit_runs) > 1:
        return fit_runs[:-1], fit_runs[-1:]
    run = fit_runs[0]
    rows = len(run.t)
    cut = 2 * rows // 3
    resting = np.flatnonzero(run.standstill.all(axis=1))
    resting = resting[(resting > rows // 2) & (resting < 5 * rows // 6)]
    if len(resting):
        cut = int(resting[np.argmin(np.abs(resting - cut))])
    return [run.part(slice(0, cut))], [run.part(slice(cut, rows))]


def diagnose(fit_logs: Sequence[Log], machine: Robot | Axis, baseline: ModelFile | None = None,
             holdout_logs: Sequence[Log] = (), library: Mapping[str, Effect] | None = None,
             rules: Rules | None = None, conditioning: Conditioning = CONDITIONING,
             progress: Progress = silent) -> Diagnosis:
    """Return what the model gets wrong about the machine that made the logs.

    Args:
        fit_logs: data to learn from.
        machine: geometry, bodies, gains.
        baseline: model whose rigid body and effects are taken as known; equation (20) without
            effects if None. Its base parameters are fitted anew.
        holdout_logs: data to confirm on; see `split_runs`.
        library: effects that may be named; all of the catalogue by default.
        rules: what a cause must show.
        conditioning: filters and rates.
        progress: called with the name of each step.

    Raises:
        InputError: data that cannot be filtered.
    """
    rules = rules or Rules()
    rigid_body = baseline.rigid_body if baseline else 'paper'
    known = build_model(machine, baseline) if baseline else None
    progress('filtering the logs')
    fit_runs, holdout_runs = split_runs(fit_logs, holdout_logs, machine, conditioning)
    observations = observe(fit_runs, machine, rigid_body, known)
    heldout = observe(holdout_runs, machine, rigid_body, known)
    progress('fitting the base model')
    try:
        identification = identify_runs(fit_runs, observations.target, observations.base, rigid_body)
    except InputError as error:
        return _unusable((str(error),), tuple(fit_runs))
    reasons = unusable(observations, identification)
    if not any(run.valid.any() for run in holdout_runs):
        reasons.append('no joint moves in the held-out data; give a bag of another motion')
    if reasons:
        return _unusable(tuple(reasons), tuple(fit_runs))

    searched = LIBRARY if library is None else library
    base_model = build_model(machine, _baseline_with(
        baseline, rigid_body, identification.parameters, identification.terms, ()))
    sigma = identification.estimate.rms
    base_model = _beside_retimed(base_model, observations, machine, baseline, rigid_body,
                                 sigma, searched)
    observations, heldout = (with_nominal(part, base_model) for part in (observations, heldout))
    moved = dithered(observations, machine)
    applicable = {name: effect for name, effect in searched.items()
                  if isinstance(machine, Robot) or not effect.needs_platform}
    blocks = blocks_of_runs([run.t for run in holdout_runs], [run.valid for run in holdout_runs])
    progress('searching the library for the noise model')
    flat = gather(observations, flat_whitener(observations, sigma))
    richest = Selector(applicable, flat, heldout, blocks, rules, moved).richest()
    left = residuals(observations, richest, solve(flat, richest))
    whitener = whitener_of_residuals(observations, left, flat.design(richest).shape[1])
    evidence = gather(observations, whitener)

    progress('searching the library for causes')
    selector = Selector(applicable, evidence, heldout, blocks, rules,
                        moved.with_nominal(base_model))
    selection = selector.run()
    if selection.found:
        # effects that scale with the torque were searched with that of a model without causes
        progress('searching again beside the causes found')
        better = build_model(machine, _extended_model(
            baseline, rigid_body, evidence, selection.hypotheses,
            solve(evidence, selection.hypotheses)))
        observations, heldout = (with_nominal(part, better) for part in (observations, heldout))
        evidence = gather(observations, whitener, evidence)
        selector = Selector(applicable, evidence, heldout, blocks, rules,
                            moved.with_nominal(better))
        selection = selector.run()
    progress('looking for twins')
    selection = selector.with_twins(selection)
    hypotheses = selection.hypotheses
    base_only, full_fit = solve(evidence, []), solve(evidence, hypotheses)

    progress('checking what remains')
    before = residuals(heldout, [], base_only)
    after = residuals(heldout, hypotheses, full_fit)
    extended = _extended_model(baseline, rigid_body, evidence, hypotheses, full_fit)
    # of effects with a nominal torque the noise of counts is left out of the floor
    simple = extended.model_copy(update={'effects': tuple(
        entry for entry in extended.effects if not effect_named(entry.effect).needs_nominal)})
    floor = noise_floor(holdout_runs, machine, build_model(machine, simple))
    remaining = remaining_of(selector, selection.found, before, after, floor)
    holdout = _holdout(holdout_runs, blocks, before, after, floor)
    nearest = left_over(selector, selection)
    verdict, withheld = verdict_of(selection.found, remaining, nearest,
                                   own_share(selector, selection), rules)
    if nearest is not None and not selection.found:
        remaining = replace(remaining, nearest=nearest.hypothesis.effect)
    rejected = list(selection.rejected)
    if withheld:
        rejected += [Rejected(item.hypothesis.label, withheld) for item in selection.found]
        full_fit = base_only
        holdout = _holdout(holdout_runs, blocks, before, before, floor)
        extended = _extended_model(baseline, rigid_body, evidence, [], base_only)
        remaining = remaining_of(selector, [], before, before, floor)
        selection.found.clear()
    diagnosis = Diagnosis(
        verdict=verdict,
        causes=tuple(_cause(item, evidence, full_fit, index)
                     for index, item in enumerate(selection.found)),
        reasons=(withheld,) if withheld else (),
        rejected=tuple(rejected),
        holdout=holdout,
        remaining=remaining,
        base_before=_base_parameters(evidence, base_only),
        base_after=_base_parameters(evidence, full_fit),
        extended_model=extended, fit_runs=tuple(fit_runs), evidence=evidence,
        hypotheses=tuple(selection.hypotheses))
    named = {cause.effect.name for cause in diagnosis.causes}
    smooth = remaining.gain.share > rules.most_of_rest
    if (Backlash.name in applicable and not named & {Backlash.name, ElasticTransmission.name}
            and not smooth and not rings(selector, selection)):
        left = residuals(evidence.observations, diagnosis.hypotheses, full_fit)
        found = rattle([(evidence.observations, left), (heldout, diagnosis.holdout.extended)])
        if found is not None and found.p_value < rules.p_value:
            return _with_backlash(diagnosis, applicable[Backlash.name], found)
    return diagnosis


def _with_backlash(diagnosis: Diagnosis, effect: Effect, found: Rattle) -> Diagnosis:
    """Return the diagnosis with loads that rattle as one more cause, which gains nothing."""
    parameters = {'gap': Parameter(value=tuple(map(float, found.gap)), unit='rad',
                                   std=tuple(map(float, WIDTH_ERROR * found.gap)))}
    cause = Cause(effect, found.joints, parameters, (), 1.0, found.p_value, Gain(0.0, 0.0, 0.0),
                  predictable=False)
    entry = EffectEntry(effect=effect.name, joints=found.joints, parameters=parameters)
    extended = diagnosis.extended_model
    return replace(
        diagnosis, verdict='partly_explained', reasons=(), causes=(*diagnosis.causes, cause),
        hypotheses=(*diagnosis.hypotheses, Hypothesis(effect, {}, found.joints)),
        extended_model=extended.model_copy(update={'effects': (*extended.effects, entry)}))


def _beside_retimed(base_model: Model, observations: Observations, machine: Robot | Axis,
                    baseline: ModelFile | None, rigid_body: str,
                    sigma: np.ndarray, library: Mapping[str, Effect]) -> Model:
    """Return the model fitted beside a torque read at another time, where that explains most.

    Such an effect is bilinear: its column is the rate of the torque of the base parameters, which
    without it come out wrong in first order. Both are fitted in turn until they agree.
    """
    everywhere = tuple(range(observations.joints))
    whitener = flat_whitener(observations, sigma)
    best = base_model
    before = project(gather(observations, whitener), []).residual
    least = RETIMED * float(before @ before)
    for effect in library.values():
        if not effect.retimes:
            continue
        time = effect.parameters[0].name
        model, hypothesis = base_model, Hypothesis(effect, effect.shape_of({time: 0.0}), everywhere)
        for _ in range(AGREED):
            evidence = gather(with_nominal(observations, model), whitener)
            for _ in range(EXPANSIONS if effect.expanded else 1):
                fit = solve(evidence, [hypothesis])
                hypothesis = replace(hypothesis, shape=effect.shape_of(
                    {time: fit.coefficients[0][0, 0]}))
            fit = solve(evidence, [hypothesis])
            model = build_model(machine, _extended_model(
                baseline, rigid_body, evidence, [hypothesis], fit))
        left = project(evidence, [hypothesis]).residual
        if left @ left < least:
            best, least = model, left @ left
    return best


def _unusable(reasons: tuple[str, ...], runs: tuple[Run, ...]) -> Diagnosis:
    return Diagnosis('unusable_data', (), reasons, (), None, None, {}, {}, None, runs)


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


def _base_parameters(evidence: Evidence, fit: Fit) -> dict[str, Parameter]:
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    return {term.name: Parameter(value=float(value), std=float(error), unit=term.unit)
            for term, value, error in zip(evidence.observations.terms, fit.base, std)}


def _cause(found: Found, evidence: Evidence, fit: Fit, index: int) -> Cause:
    hypothesis = found.hypothesis
    columns = evidence.columns(hypothesis)
    return Cause(
        effect=hypothesis.effect, joints=hypothesis.joints,
        parameters=effect_parameters(evidence, hypothesis, fit, index), twins=found.twins,
        visible_fraction=project(evidence, []).left_share(
            columns, hypothesis.stacked(fit.coefficients[index])),
        p_value=found.p_value, gain=found.gain)


def _extended_model(baseline: ModelFile | None, rigid_body: str, evidence: Evidence,
                    hypotheses: Sequence[Hypothesis], fit: Fit) -> ModelFile:
    """Return the baseline with refitted base parameters and the causes added."""
    added = tuple(
        EffectEntry(effect=hypothesis.effect.name, joints=hypothesis.joints,
                    parameters=effect_parameters(evidence, hypothesis, fit, index))
        for index, hypothesis in enumerate(hypotheses))
    return _baseline_with(baseline, rigid_body, _base_parameters(evidence, fit),
                          evidence.observations.terms, added)


def _baseline_with(baseline: ModelFile | None, rigid_body: str, fitted: Mapping[str, Parameter],
                   terms: Sequence[BaseTerm], added: tuple[EffectEntry, ...]) -> ModelFile:
    """Return the baseline with other base parameters and more effects.

    A base parameter that came out slightly negative is written as zero.
    """
    parameters = {term.name: fitted[term.name] if not term.nonnegative else
                  fitted[term.name].model_copy(update={'value': max(fitted[term.name].value, 0.0)})
                  for term in terms}
    return ModelFile(schema='par4/model/1', rigid_body=rigid_body, parameters=parameters,
                     effects=(*(baseline.effects if baseline else ()), *added),
                     torque_limit=baseline.torque_limit if baseline else None)
