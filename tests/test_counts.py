"""Encoder counts as errors of the columns: what they imitate, and what they leave alone."""

from __future__ import annotations

import numpy as np
import pytest
from measured import excitation
from planned import evidence_of, log_of, state_of_motion
from searches import EVERY, MODEL

from par4_dynamics.base_terms import base_columns
from par4_dynamics.effects.catalogue import CATALOGUE
from par4_identification.diagnosis.evidence.dithered import DRAWS, Dithered, dithered
from par4_identification.diagnosis.evidence.estimates import effect_parameters
from par4_identification.diagnosis.evidence.evidence import Evidence
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.pool import Pool
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.search.candidates import Candidates
from par4_identification.diagnosis.search.causes import Hypotheses, named_of, names_of
from par4_identification.diagnosis.search.counts import DOUBT, Counts
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.search import Search
from par4_kinematics.motion import Motion
from robots import REFERENCE, model_with

COARSE = REFERENCE.model_copy(update={
    'drives': REFERENCE.drives.model_copy(update={'encoder_counts': 4096})})
COUNT = 2.0 * np.pi / 4096


@pytest.fixture(scope='module')
def motion() -> Motion:
    return excitation('reference', 12.0, 70)


def evidence_on(motion: Motion, *, counted: bool, model=MODEL) -> Evidence:
    """Return rows of a machine that obeys a model, with positions in counts or without."""
    torque = model.torque(state_of_motion(REFERENCE, motion))
    q = COUNT * np.round(motion.q / COUNT) if counted else motion.q
    return evidence_of(log_of(COARSE, motion.t, q, torque, 1), COARSE, MODEL)


def judged(evidence: Evidence, effect: str) -> tuple[float, float]:
    """Return the gain of an effect on all joints and how much of it counts may have made."""
    hypothesis = Hypothesis(CATALOGUE[effect], {}, EVERY)
    counts = Counts(dithered(evidence.observations).with_nominal(MODEL))
    projection = project(evidence, ())
    return (0.5 * projection.gain(hypothesis.effect, {}),
            counts.imitate(projection, hypothesis))


@pytest.mark.parametrize('effect', ['distributed_rods', 'theta_inertia'])
def test_what_counts_imitate_is_not_held_for_a_cause(motion, effect):
    """The machine obeys (20). In counts its motion has a false cause, which is seen through."""
    gain, imitated = judged(evidence_on(motion, counted=True), effect)
    assert gain > 1000.0, 'counts no longer imitate it: the test shows nothing'
    assert gain - imitated < 0.01 * gain
    plain, _ = judged(evidence_on(motion, counted=False), effect)
    assert plain < 10.0


def test_a_cause_that_is_there_keeps_its_gain(motion):
    rods = model_with(MODEL, 'distributed_rods', rod_mass=0.3, bar_mass=0.0)
    gain, imitated = judged(evidence_on(motion, counted=True, model=rods), 'distributed_rods')
    assert gain > 500.0
    assert imitated < 0.6 * gain
    offset = model_with(MODEL, 'torque_offset', offset=(0.1, -0.1, 0.1, 0.05))
    gain, imitated = judged(evidence_on(motion, counted=True, model=offset), 'torque_offset')
    assert gain > 500.0
    assert imitated < 0.05 * gain


@pytest.mark.parametrize('effect', ['presliding', 'load_dependent_friction'])
def test_a_search_names_nothing_that_counts_imitate(motion, effect):
    """The same search that does not know the counts is deceived: the data can deceive."""
    fit = evidence_on(motion, counted=True)
    heldout = evidence_on(excitation('reference', 8.0, 80), counted=True)

    def found(known: Dithered) -> Hypotheses:
        search = Search(Candidates({effect: CATALOGUE[effect]}, fit, Rules()),
                        Pool(fit, heldout), Rules(), known, Kinds(fit.observations))
        return search.run()

    deceived = names_of(found(Dithered()))  # the effect, or what remembers the way as it does
    assert deceived & {effect, 'memory'}, 'counts no longer deceive: the test shows nothing'
    assert named_of(found(dithered(fit.observations).with_nominal(MODEL))) == []


def test_a_cause_with_log_likelihood_to_spare_takes_one_draw(motion, monkeypatch):
    """No answer depends on how much of it counts make, as long as that is less than it can spare.
    """
    evidence = evidence_on(motion, counted=True)
    hypothesis = Hypothesis(CATALOGUE['distributed_rods'], {}, EVERY)
    projection, drawn = project(evidence, ()), []
    moment = Counts.moment
    monkeypatch.setattr(Counts, 'moment', lambda own, rows, item, draws: (
        drawn.append(draws), moment(own, rows, item, draws))[1])

    def imitated(spare):
        drawn.clear()
        counts = Counts(dithered(evidence.observations).with_nominal(MODEL))
        return counts.imitate(projection, hypothesis, spare), list(drawn)

    exact, all_draws = imitated(0.0)
    assert all_draws == [1, DRAWS]
    roughly, one_draw = imitated(1e6)
    assert one_draw == [1]
    assert 0.3 * exact < roughly < 3.0 * exact
    assert imitated(0.9 * exact) == (exact, all_draws)


def test_nothing_is_imitated_where_the_counts_are_not_known(motion):
    evidence = evidence_on(motion, counted=True)
    hypothesis = Hypothesis(CATALOGUE['distributed_rods'], {}, EVERY)
    assert Counts(Dithered()).imitate(project(evidence, ()), hypothesis) == 0.0


def test_least_squares_are_off_by_what_the_moments_say(motion):
    """A second way to the same bias: the fit of what counts add, on many drawn motions."""
    evidence = evidence_on(motion, counted=False)
    item = Hypothesis(CATALOGUE['distributed_rods'], {}, EVERY)
    moved = dithered(evidence.observations, seed=5).with_nominal(MODEL)
    plain = solve(evidence, (item,)).coefficients[0][0, 0]
    drawn = [fitted_with(draw, evidence, item) for draw in moved.draws]
    counts = Counts(moved)
    own = evidence.columns(item)
    projection = project(evidence, ())
    rest = projection.rest(own)
    told = -np.linalg.solve(rest.T @ rest, counts.moment(evidence, item, len(moved.draws)))[0]
    assert float(np.mean(drawn) - plain) == pytest.approx(told, rel=0.3)
    assert abs(np.mean(drawn) - plain) < DOUBT * abs(told)


def fitted_with(draw, evidence: Evidence, item: Hypothesis) -> float:
    """Return the rod mass that a fit gives whose columns are those of another motion."""
    base = evidence.whitener.whiten([run.rows(base_columns(run.state)) for run in draw.runs])
    own = evidence.whitener.whiten([run.rows(item.effect.columns(run.state, {}))
                                    for run in draw.runs])
    design = np.vstack([np.hstack(parts) for parts in zip(base, own)])
    return float(np.linalg.lstsq(design, evidence.target, rcond=None)[0][base[0].shape[1]])



def test_a_fit_is_brought_back_to_the_machine(motion):
    """Counts bias a rod by many of its deviations; what they say of that is taken out."""
    rods = model_with(MODEL, 'distributed_rods', rod_mass=0.3, bar_mass=0.0)
    evidence = evidence_on(motion, counted=True, model=rods)
    item = Hypothesis(CATALOGUE['distributed_rods'], {}, EVERY, (0,))
    fit = solve(evidence, (item,))
    counts = Counts(dithered(evidence.observations).with_nominal(MODEL))
    told = counts.corrected(evidence, fit)
    off, left = (abs(part.coefficients[0][0, 0] - 0.3) for part in (fit, told))
    assert off > 10.0 * np.sqrt(fit.covariance[fit.slices[0], fit.slices[0]][0, 0])
    assert left < 0.4 * off
    before, after = (effect_parameters(evidence, item, part, 0)['rod_mass']
                     for part in (fit, told))
    assert abs(before.value - 0.3) > 10.0 * before.std
    assert abs(after.value - 0.3) < 2.0 * after.std
    assert Counts(Dithered()).corrected(evidence, fit) is fit
