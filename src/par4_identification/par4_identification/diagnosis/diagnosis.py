"""From measured logs to causes: rows, noise, search, judgement, verdict, extended model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.base_terms import INERTIA, OFFSET, base_columns, base_terms
from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.effect import Effect, Machine
from par4_dynamics.model import Model
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model, torque_model
from par4_identification.diagnosis.below_resonance import (
    below_resonance,
    is_better,
    resonance,
)
from par4_identification.diagnosis.evidence.dithered import Dithered, dithered
from par4_identification.diagnosis.evidence.evidence import Evidence, gather
from par4_identification.diagnosis.evidence.extended import (
    base_parameters,
    baseline_with,
    extended_model,
)
from par4_identification.diagnosis.evidence.fit import residuals, solve
from par4_identification.diagnosis.evidence.observations import (
    Observations,
    is_worse_where_unsure,
    observe,
    remembered,
    sure_rows,
    with_nominal,
)
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.side_by_side import plain_linear_algebra
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.evidence.whitener import Whitener
from par4_identification.diagnosis.nominal.gate import driving_when_fast
from par4_identification.diagnosis.nominal.retimed import beside_retimed
from par4_identification.diagnosis.nominal.start import (
    Start,
    is_mended,
    shown,
    start_beside,
    start_beside_position,
    start_of,
)
from par4_identification.diagnosis.nominal.turning import turning
from par4_identification.diagnosis.progress import Progress, silent
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.causes import (
    named_of,
    names_of,
    unnamed_of,
)
from par4_identification.diagnosis.search.counts import counted_squares
from par4_identification.diagnosis.search.rules import Rules, rules_for
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.swing import Swing
from par4_identification.diagnosis.search.whitening import quieter, whitener_of
from par4_identification.diagnosis.split import manageable, split_runs
from par4_identification.diagnosis.summing_up import summed_up
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable
from par4_identification.fitting.identification import SINGULAR
from par4_identification.logs.log import Log, refuse_logs
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.run import Run
from par4_identification.signals.scales import conditioning_for
from par4_kinematics.robot import Axis, Robot

CONDITIONING = Conditioning(low_speed=0.02)
"""Lower than identification's: effects of low speed must show."""
LIBRARY = {name: effect for name, effect in CATALOGUE.items() if effect.shows}
"""Effects that may be named: all but those that add no torque to a motion."""
PASSES = 3
"""Searches beside the causes found by the one before."""
Apart = Mapping[str, Mapping[str, np.ndarray]]
"""Base parameters (J,) by which logs differ, by the name of the log and of the parameter."""


def diagnose(fit_logs: Sequence[Log], machine: Robot | Axis, baseline: ModelFile | None = None,
             holdout_logs: Sequence[Log] = (), library: Mapping[str, Effect] | None = None,
             rules: Rules | None = None, conditioning: Conditioning | None = None,
             progress: Progress = silent, apart: Apart | None = None, as_set: bool = False
             ) -> Diagnosis | Unusable:
    """Return what the model gets wrong about the machine that made the logs.

    Args:
        fit_logs: logs to fit.
        machine: that was recorded: geometry, bodies, gains.
        baseline: model whose rigid body and effects are taken as known; equation (20) without
            effects if None. Its base parameters are fitted anew.
        holdout_logs: logs to confirm causes on; see `split_runs` if there are none.
        library: effects that may be named, by name; `LIBRARY` by default.
        rules: what a cause must gain; by default those of a Par4, or `OF_AXIS` for an axis.
        conditioning: filters and rates; by default those that suit the logs, `conditioning_for`.
        progress: called with the name of each step.
        apart: what base parameters of some logs have beyond those of the others, which is taken
            out of their torque (`differences_between_logs`).
        as_set: whether the conditioning is what a user sets, so that loads which swing within the
            rows of a Par4 are not looked at below their resonance.

    Returns:
        the answer, or why the data cannot carry one.

    Raises:
        InputError: no log, two of one name, readings that are no numbers, or data that cannot be
            filtered.
        UnreachableError: joint positions with which the mechanism does not close.
    """
    refuse_logs(fit_logs)
    if holdout_logs:
        refuse_logs(holdout_logs)
    rules = rules or rules_for(isinstance(machine, Axis))
    searched = LIBRARY if library is None else library
    if conditioning is None:
        conditioning = conditioning_for([*fit_logs, *holdout_logs], machine, CONDITIONING)
    with plain_linear_algebra():
        answer = _diagnosed_logs(fit_logs, machine, baseline, holdout_logs, searched, rules,
                                 conditioning, progress, apart or {})
        if as_set or isinstance(machine, Axis) or isinstance(answer, Unusable):
            return answer
        narrow = below_resonance(answer, conditioning, rules.floor_excess)
        if narrow is None:
            return answer
        progress('diagnosing again below the resonance of the transmissions')
        second = _diagnosed_logs(fit_logs, machine, baseline, holdout_logs, searched, rules,
                                 narrow, progress, apart or {})
        if isinstance(second, Diagnosis) and is_better(second, answer, machine):
            return replace(second, below_hz=answer.swing_hz)
        return answer


def _diagnosed_logs(fit_logs: Sequence[Log], machine: Robot | Axis, baseline: ModelFile | None,
                    holdout_logs: Sequence[Log], searched: Mapping[str, Effect], rules: Rules,
                    conditioning: Conditioning, progress: Progress, apart: Apart
                    ) -> Diagnosis | Unusable:
    known = build_model(machine, baseline) if baseline else None
    progress('filtering the logs')
    fit_logs, holdout_logs, share = manageable(fit_logs, holdout_logs, machine, conditioning)
    fit_runs, holdout_runs = (
        [_alike(run, apart[run.name]) if run.name in apart else run for run in runs]
        for runs in split_runs(fit_logs, holdout_logs, machine, conditioning))
    try:
        answer = _diagnosed_runs(fit_runs, holdout_runs, machine, baseline, known, searched, rules,
                                 progress)
    except np.linalg.LinAlgError:
        answer = Unusable((SINGULAR,), tuple(fit_runs))
    return replace(answer, share=share) if isinstance(answer, Diagnosis) else answer


def _diagnosed_runs(fit_runs: list[Run], holdout_runs: list[Run], machine: Robot | Axis,
                    baseline: ModelFile | None, known: Model | None,
                    searched: Mapping[str, Effect], rules: Rules, progress: Progress
                    ) -> Diagnosis | Unusable:
    """Return the diagnosis of rows; once more from better base parameters if causes give them."""
    rigid_body = baseline.rigid_body if baseline else 'paper'
    observations = observe(fit_runs, machine, rigid_body, known)
    progress('fitting the base model')
    inertia = None if known is None else known.values[INERTIA]
    start = start_of(observations, machine, rigid_body, rules, inertia)
    if not start.reasons:
        told = isinstance(machine, Robot) and not (start.left_out or start.unless_mended)
        model = _base_model(start, machine, baseline)
        del observations, start  # which are large for a long log, and made anew
        for runs in (fit_runs, holdout_runs):  # in place: nobody keeps those before
            runs[:] = turning(runs, model, told)
        observations = observe(fit_runs, machine, rigid_body, known)
        start = start_of(observations, machine, rigid_body, rules, inertia)
    heldout = observe(holdout_runs, machine, rigid_body, known)
    reasons = list(start.reasons)
    if not any(run.valid.any() for run in shown(heldout, start).runs):
        reasons.append('no joint moves in the held-out data; give a bag of another motion')
    if reasons or start.identification is None:  # without one there is a reason
        return Unusable(tuple(reasons), tuple(fit_runs))

    effects = {**CATALOGUE, **searched}
    answer, swings = _diagnosed(start, heldout, machine, baseline, searched, rules,
                                tuple(fit_runs), progress)
    again = None
    if start.left_out and not answer.causes and answer.unnamed:
        again = start_beside_position(start, observations, machine, rigid_body, rules)
    if (start.left_out or start.unless_mended) and answer.causes:
        beside = observe(fit_runs, machine, rigid_body,
                         torque_model(machine, answer.extended_model, effects))
        again = start_beside(start, observations, beside.target, machine, rigid_body)
    if again is not None:
        progress('diagnosing again from the base parameters beside the causes found')
        answer, _ = _diagnosed(again, heldout, machine, baseline, searched, rules,
                               tuple(fit_runs), progress, swings)
    if start.unless_mended and not (answer.causes and is_mended(answer.base_after)):
        return Unusable(start.unless_mended, tuple(fit_runs))
    # an offset, or what differs between the directions, drives as much as it brakes
    by_speed = any(cause.effect.told_by_speeds and not cause.effect.needs_both_ways
                   for cause in answer.causes) or (
        baseline is not None and bool(baseline.effects))
    if isinstance(machine, Axis) and answer.verdict in ('clean', 'explained') and not by_speed:
        # what a law may get wrong makes no friction drive: the noise alone tells whether it does
        driving = driving_when_fast(base_parameters(answer.evidence, solve(
            answer.evidence, answer.hypotheses)), fit_runs)
        if driving is not None:
            return Unusable((driving,), tuple(fit_runs))
    return answer


def _alike(run: Run, beyond: Mapping[str, np.ndarray]) -> Run:
    """Return a run without the torque of what its base parameters (J,) have beyond others'."""
    values = np.stack([beyond.get(term.name, np.zeros(run.tau.shape[1]))
                       for term in base_terms(run.state)], axis=1)
    torque = np.einsum('njp,jp->nj', base_columns(run.state), values)
    torque = torque + beyond.get(OFFSET.name, 0.0)
    measured = run.state.measured
    return replace(run, tau=run.tau - run.rows(torque), apart=beyond, state=replace(
        run.state, measured=None if measured is None else measured - torque))


def _diagnosed(start: Start, heldout: Observations, machine: Robot | Axis,
               baseline: ModelFile | None, searched: Mapping[str, Effect], rules: Rules,
               fit_runs: tuple[Run, ...], progress: Progress, swings: Sequence[Swing] = ()
               ) -> tuple[Diagnosis, Sequence[Swing]]:
    """Return the diagnosis of rows to fit and rows held out from base parameters to begin with.

    `swings` is what an earlier diagnosis found to twist; what all did is returned, too.
    """
    observations, heldout, identification = (start.observations, shown(heldout, start),
                                             start.fitted)
    rigid_body = baseline.rigid_body if baseline else 'paper'
    effects = {**CATALOGUE, **searched}
    kind: Machine = machine.kind if isinstance(machine, Axis) else 'par4'
    # viscous friction at another time is an inertia, which would hide in it for good
    without_inertia = INERTIA in start.left_out and start.inertia is None
    applicable = {name: effect for name, effect in searched.items()
                  if effect.is_sought_on(kind)
                  and (effect.told_by_speeds or not observations.steady)
                  and not (effect.retimes and without_inertia)}
    base_model = _base_model(start, machine, baseline)
    sigma = identification.estimate.rms
    # of a torque that the base terms hardly explain, they do not say when it was read, nor what
    # goes on through a transmission
    first = {name: effect for name, effect in applicable.items()
             if not (start.bound and (effect.retimes or effect.needs_nominal))}
    base_model = beside_retimed(base_model, observations, machine, baseline, rigid_body,
                                 sigma, first)
    observations, heldout = (with_nominal(part, base_model) for part in (observations, heldout))
    moved = dithered(observations)
    progress('searching the library for the noise model')
    kinds, first_moved = Kinds(observations), moved.with_nominal(base_model)
    whitener = whitener_of(observations, sigma, first, kinds, rules, first_moved)

    progress('searching for causes')
    search = _search(observations, heldout, whitener, first, rules, first_moved, kinds,
                     swings=swings)
    model = search.run()
    seen = search.candidates.swings
    held: frozenset[str] = frozenset()  # names whose torque the nominal one has
    for _ in range(PASSES):
        named, found = named_of(model), search.pool.solution(model)
        quiet = quieter(whitener, observations, model, found, kinds)
        same = all(new is old for new, old in zip(quiet.noise, whitener.noise))
        if same and names_of(named) == held:
            break
        # effects that scale with the torque were searched with that of other causes
        progress('searching again beside the causes found')
        better = torque_model(machine, extended_model(
            baseline, rigid_body, search.pool.evidence, named,
            search.pool.solution((*named, *unnamed_of(model)))), effects)
        memory = max((item.named.memory for item in named), default=0.0)
        unsure = is_worse_where_unsure(observations, better, residuals(observations, model, found))
        observations, heldout = (remembered(with_nominal(part, better), memory)
                                 for part in (observations, heldout))
        if unsure:
            observations, heldout = (sure_rows(part, better) for part in (observations, heldout))
        same = same and all(new.valid is old.valid for new, old in zip(
            observations.runs, whitener.runs))
        whitener, held = replace(quiet, runs=observations.runs), names_of(named)
        search = _search(observations, heldout, whitener, applicable, rules,
                         moved.with_nominal(better), kinds, search.pool.evidence if same else None,
                         search.candidates.swings)
        model = search.run(tuple(named))
    answer = summed_up(search, model, machine, baseline, rigid_body, effects, fit_runs, progress)
    swings = search.candidates.swings
    return replace(answer, left_out=start.left_out, swing_hz=resonance(
        [*seen, *swings[-1:]], observations)), swings


def _base_model(start: Start, machine: Robot | Axis, baseline: ModelFile | None) -> Model:
    """Return the base parameters of a start, and the effects of a baseline, as a model."""
    return torque_model(machine, baseline_with(
        baseline, baseline.rigid_body if baseline else 'paper', start.fitted.parameters,
        start.observations.terms, ()))


def _search(observations: Observations, heldout: Observations, whitener: Whitener,
            library: Mapping[str, Effect], rules: Rules, moved: Dithered,
            kinds: Kinds, before: Evidence | None = None, swings: Sequence[Swing] = ()) -> Search:
    """Return a search over whitened rows.

    `before` is that of the same rows, for its columns, `swings` what earlier searches found to
    twist.
    """
    evidence = gather(observations, whitener, before)
    kept = gather(heldout, replace(whitener, runs=heldout.runs))
    pool = Pool(evidence, kept, counted_squares(moved, evidence))
    return Search(Candidates(library, evidence, rules, swings), pool, rules, moved, kinds)
