"""What causes leave behind, what each has of its own, and which data can have a cause at all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured import excitation
from planned import NOISE, evidence_of, log_of, state_of_motion
from scipy.signal import lfilter

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model import read_model
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.diagnosis.evidence import (
    Hypothesis,
    flat_whitener,
    gather,
    project,
    residuals,
    solve,
)
from par4_identification.diagnosis.gate import WORST_ERROR, unusable
from par4_identification.diagnosis.holdout import Gain, blocks_of_runs
from par4_identification.diagnosis.law import Dithered
from par4_identification.diagnosis.observations import observe
from par4_identification.diagnosis.rules import Rules
from par4_identification.diagnosis.selection import Found, Rejected, Selection, Selector
from par4_identification.diagnosis.sufficiency import (
    Remaining,
    left_over,
    own_share,
    remaining_of,
    verdict_of,
)
from par4_identification.identification import identify_runs
from par4_identification.noise import ArNoise
from par4_identification.rows import runs_of_log
from robots import REFERENCE, model_with

MODEL = read_model('table1', REFERENCE)
EVERY = (0, 1, 2, 3)
OFFSET = (0.3, -0.2, 0.25, 0.15)
TILT = {'about_x': 0.02, 'about_y': -0.015}
LOADED = ('load_dependent_friction', {'coefficient': 0.004})
DRIFT = {'drop': 0.5, 'time_constant': 4.0}
GAIN = {'relative': (0.05, -0.03, 0.02, -0.04)}
BELT = {'coulomb': 0.3, 'viscous': 0.05}
COGGING = {'amplitude': 0.03, 'periods': 31.0, 'phase': (0.0, 1.0, 2.0, 3.0)}
COGGING_SHAPE = {'periods': 31.0}


def log_with(*effects, seed=1, duration=12.0):
    """Return the log of the reference robot that has effects, each a name and its values."""
    model = MODEL
    for name, values in effects:
        model = model_with(model, name, **values)
    motion = excitation('reference', duration, 900 + seed)
    return log_of(REFERENCE, motion.t, motion.q, model.torque(state_of_motion(REFERENCE, motion)),
                  seed)


def selector_of(*effects, library=()):
    """Return a selector on a log with effects, whose library has some names only."""
    evidence = evidence_of(log_with(*effects), REFERENCE, MODEL)
    heldout = evidence_of(log_with(*effects, seed=2, duration=8.0), REFERENCE, MODEL).observations
    return selector_on(evidence, heldout, library)


def selector_on(evidence, heldout, library=()):
    """Return a selector on rows to fit and rows held out."""
    blocks = blocks_of_runs([run.t for run in heldout.runs], [run.valid for run in heldout.runs])
    return Selector({name: CATALOGUE[name] for name in library}, evidence, heldout, blocks,
                    Rules(), Dithered())


def selected(*causes):
    """Return a selection of causes, each a name, its shape and its joints."""
    return Selection([Found(Hypothesis(CATALOGUE[name], shape, joints), 0.0, 0.0,
                            Gain(0.0, 0.0, 0.0)) for name, shape, joints in causes])


def names(selection):
    return [item.effect.name for item in selection.hypotheses]


# ------------------------------------------------------------------------------ what is left over


def test_what_a_relative_leaves_of_the_true_effect_is_left_over():
    """A tilted base called a torque offset: what the offset lacks looks like the tilt."""
    selector = selector_of(('base_tilt', TILT), library=('torque_offset', 'base_tilt'))
    wrong, right = (selected(('torque_offset', {}, EVERY)), selected(('base_tilt', {}, EVERY)))
    assert left_over(selector, wrong).hypothesis.effect.name == 'base_tilt'
    assert left_over(selector, right) is None


def test_another_small_effect_is_held_against_nobody_but_a_clean_verdict():
    """An offset and friction under load: of a motion to and fro they have nothing in common."""
    selector = selector_of(('torque_offset', {'offset': OFFSET}), LOADED,
                           library=('torque_offset', 'load_dependent_friction'))
    causes, loaded = (selected((name, {}, EVERY)) for name in selector.library)
    beside = project(selector.evidence, causes.hypotheses).gain(loaded.hypotheses[0])
    assert beside > 4.0 * Rules().left_score  # it is there
    assert left_over(selector, causes) is None
    # without any cause, what explains something is left over
    assert left_over(selector, selected()) is not None


def test_what_the_held_out_rows_do_not_know_is_not_left_over():
    """An offset's name stays where what looks like a tilt is an accident of the rows to fit."""
    tilted = evidence_of(log_with(('base_tilt', TILT)), REFERENCE, MODEL)
    wrong = selected(('torque_offset', {}, EVERY))
    for effect, kept in ((('base_tilt', TILT), False),
                         (('torque_offset', {'offset': OFFSET}), True)):
        rows = evidence_of(log_with(effect, seed=2, duration=8.0), REFERENCE, MODEL).observations
        selector = selector_on(tilted, rows, ('torque_offset', 'base_tilt'))
        assert (left_over(selector, wrong) is None) == kept


def test_noise_alone_is_not_left_over():
    selector = selector_of(library=('torque_offset', 'base_tilt', 'cogging', 'coulomb_asymmetry'))
    assert left_over(selector, selected()) is None


# ---------------------------------------------------------------------------- what is one's own


def test_causes_that_have_nothing_in_common_own_all_they_explain():
    offset, loaded = ('torque_offset', {}, EVERY), ('load_dependent_friction', {}, EVERY)
    selector = selector_of(('torque_offset', {'offset': OFFSET}),
                           (LOADED[0], {'coefficient': 0.02}))
    assert own_share(selector, selected(offset, loaded)) == pytest.approx(1.0, abs=0.05)
    for alone in (offset, loaded):
        assert own_share(selector, selected(alone)) == pytest.approx(1.0, abs=1e-9)


def test_causes_with_one_torque_own_nothing():
    """While a joint moves, an offset and an asymmetry of Coulomb friction are one law."""
    selector = selector_of(('torque_offset', {'offset': OFFSET}))
    twins = selected(('torque_offset', {}, EVERY), ('coulomb_asymmetry', {}, EVERY))
    assert own_share(selector, twins) < 0.02


@pytest.mark.parametrize(('causes', 'share', 'verdict'), [
    (1, 0.0, 'explained'), (2, 0.1, 'unknown'), (2, 0.2, 'explained'), (2, 1.5, 'unknown'),
    (3, 0.4, 'unknown'), (3, 0.6, 'explained'), (3, 1.5, 'unknown')])
def test_the_more_names_it_takes_the_more_each_must_own(causes, share, verdict):
    found = selected(*[('torque_offset', {}, EVERY)] * causes).found
    nothing = Remaining(False, None, Gain(0.0, 0.0, 0.0), 1.0)
    assert verdict_of(found, nothing, None, share, Rules())[0] == verdict


# --------------------------------------------------------------------- what nameless functions see


@pytest.mark.parametrize(('effect', 'values', 'block'), [
    ('torque_ripple', {'relative': 0.04, 'periods': 23.0, 'phase': (0.0, 1.0, 2.0, 3.0)}, 'torque'),
    ('time_offset', {'delay': 0.002}, 'rate'),
    ('actuator_lag', {'time_constant': 0.002}, 'rate'),
    ('cogging', {**COGGING, 'amplitude': 0.3}, 'periodic'),
    ('drive_gain_error', GAIN, 'load'),
    ('theta_friction', BELT, 'wrench'),
    ('friction_drift', DRIFT, 'drift')])
def test_what_no_name_of_the_library_explains_is_seen_by_a_nameless_function(effect, values, block):
    selector = selector_of((effect, values))
    before = residuals(selector.heldout.observations, [], solve(selector.evidence, []))
    remaining = remaining_of(selector, [], before, before, np.full(4, NOISE))
    assert remaining.significant
    assert remaining.looks_like == block


@pytest.mark.parametrize(('effect', 'values', 'relative', 'block'), [
    ('theta_friction', BELT, 'passive_joint_friction', 'wrench'),
    ('drive_gain_error', GAIN, 'joint_inertia_difference', 'load'),
    ('friction_drift', DRIFT, 'joint_friction_difference', 'drift'),
    ('encoder_offset', {'offset': (0.004, -0.003, 0.002, 0.003)}, 'torque_offset', 'reading')])
def test_a_nameless_function_explains_more_than_a_relative_but_not_more_than_the_cause(
        effect, values, relative, block):
    selector = selector_of((effect, values))
    for name, instead in ((relative, block), (effect, None)):
        shape = CATALOGUE[name].shape_of(values) if name == effect else {}
        causes = selected((name, shape, EVERY))
        before, after = (
            residuals(selector.heldout.observations, part, solve(selector.evidence, part))
            for part in ([], causes.hypotheses))
        remaining = remaining_of(selector, causes.found, before, after, np.full(4, NOISE))
        assert remaining.instead == instead
        verdict, reason = verdict_of(causes.found, remaining, None, 1.0, Rules())
        assert (verdict == 'unknown') == (instead is not None), reason


def test_no_function_stands_against_a_name_whose_twin_is_the_cause():
    selector = selector_of(('theta_friction', BELT))
    relative, belt = (selected((name, {}, EVERY)) for name in (
        'passive_joint_friction', 'theta_friction'))
    before, after = (residuals(selector.heldout.observations, part, solve(selector.evidence, part))
                     for part in ([], relative.hypotheses))
    for rivals, instead in (((), 'wrench'), (tuple(belt.hypotheses), None)):
        found = [replace(relative.found[0], rivals=rivals)]
        assert remaining_of(selector, found, before, after, np.full(4, NOISE)).instead == instead


def test_what_explains_most_without_passing_is_told():
    log, heldout = (log_with(('cogging', {**COGGING, 'amplitude': 0.3}), seed=seed)
                    for seed in (1, 2))
    diagnosis = diagnose([log], REFERENCE, holdout_logs=[heldout],
                         library={'cogging': CATALOGUE['cogging']}, rules=Rules(holdout_gain=1.0))
    assert (diagnosis.verdict, diagnosis.causes) == ('unknown', ())
    assert diagnosis.remaining.nearest.name == 'cogging'


# --------------------------------------------------------------------------------------- shadows


@pytest.mark.parametrize(('amplitude', 'falls'), [(0.04, True), (0.4, False)])
def test_a_shadow_falls_and_what_casts_it_stays(amplitude, falls):
    """Beside a cause a thousand times as strong one falls, though it is no chance."""
    selector = selector_of(('torque_offset', {'offset': (3.0, -3.0, 2.0, -2.0)}),
                           ('cogging', {**COGGING, 'amplitude': amplitude}))
    selection = selected(('cogging', COGGING_SHAPE, EVERY), ('torque_offset', {}, EVERY))
    cogging, offset = selection.hypotheses
    assert project(selector.evidence, [offset]).gain(cogging) > 10.0 * Rules().least_gain
    selector._prune(selection)
    assert names(selection) == (['torque_offset'] if falls else ['cogging', 'torque_offset'])
    assert [item.label for item in selection.rejected] == ([cogging.label] if falls else [])


def test_of_two_with_one_torque_one_falls():
    selector = selector_of(('torque_offset', {'offset': OFFSET}), ('base_tilt', TILT))
    selector.rules = replace(Rules(), least_evidence=0.0)
    selection = selected(('torque_offset', {}, EVERY), ('base_tilt', {}, EVERY),
                         ('coulomb_asymmetry', {}, EVERY))
    selector._prune(selection)
    assert len(selection.found) == 2
    assert 'base_tilt' in names(selection)
    assert selection.rejected[0].reason == 'its torque is that of another cause'


def test_the_share_a_cause_has_alone_is_that_of_its_torque_beside_the_others():
    """By least squares on the torque itself, at hand."""
    selector = selector_of(('torque_offset', {'offset': OFFSET}), ('base_tilt', TILT))
    offset, tilt = selected(('torque_offset', {}, EVERY), ('base_tilt', {}, EVERY)).hypotheses
    evidence = selector.evidence
    torque = evidence.columns(tilt) @ tilt.stacked(solve(evidence, [offset, tilt]).coefficients[-1])

    def left(design):
        return np.linalg.norm(torque - design @ np.linalg.lstsq(design, torque, rcond=None)[0])

    expected = left(evidence.design([offset])) / left(evidence.base)
    assert selector._alone(tilt, [offset]) == pytest.approx(expected, rel=1e-6)


# ----------------------------------------------------------------------------- what is accepted


def test_a_candidate_that_was_refused_is_looked_at_again_beside_another(monkeypatch):
    selector = selector_of(('torque_offset', {'offset': OFFSET}), (LOADED[0], {'coefficient': 0.1}),
                           library=('torque_offset', 'load_dependent_friction'))
    confirm = selector._confirm

    def wary(candidate, others):
        name = candidate.hypothesis.effect.name
        if name == 'load_dependent_friction' and not others:
            return Rejected(name, 'not alone')
        return confirm(candidate, others)

    monkeypatch.setattr(selector, '_confirm', wary)
    result = selector.run()
    assert result.rejected[0].reason == 'not alone'
    assert set(names(result)) == {'torque_offset', 'load_dependent_friction'}


@pytest.mark.parametrize(('size', 'accepted'), [(1.0, True), (0.3, False), (1.8, False)])
@pytest.mark.parametrize('nominal', [0.4, 1.0, 2.5])
def test_presliding_is_as_large_as_the_friction_found_beside_it(nominal, size, accepted):
    """Whatever friction its column was made with."""
    log, values = log_with(), {'distance': np.full(4, 4e-3)}
    state = evidence_of(log, REFERENCE, MODEL).observations.runs[0].state
    change = CATALOGUE['presliding'].torque(state, values, EVERY)
    friction = {**MODEL.values, 'coulomb_friction': nominal * MODEL.values['coulomb_friction']}
    evidence = evidence_of(replace(log, tau=log.tau + size * change), REFERENCE,
                           replace(MODEL, values=friction))
    hypothesis = Hypothesis(CATALOGUE['presliding'], {'distance': 4e-3}, EVERY)
    selector = selector_on(evidence, evidence.observations)
    reason = selector._implausible(hypothesis, solve(evidence, [hypothesis]), 0)
    assert (reason is None) == accepted, reason


# ------------------------------------------------------------------------ gains on whitened rows


@pytest.fixture(scope='module')
def two_runs():
    """Return evidence of two runs of another length and what two models leave of its rows."""
    logs = [log_with(('torque_offset', {'offset': OFFSET}), seed=seed, duration=duration)
            for seed, duration in ((1, 6.0), (2, 9.0))]
    evidence = evidence_of(logs, REFERENCE, MODEL)
    causes = selected(('torque_offset', {}, EVERY)).hypotheses
    return evidence, [(part, solve(evidence, part)) for part in ([], causes)]


def test_what_a_fit_leaves_of_whitened_rows_is_what_it_leaves_whitened(two_runs):
    evidence, fits = two_runs
    coloured = replace(evidence.whitener, noise=tuple(
        ArNoise(np.array((0.9 - 0.1 * joint, -0.2)), 0.04) for joint in EVERY))
    for seen in (evidence, gather(evidence.observations, coloured)):
        for hypotheses, fit in fits:
            left = residuals(evidence.observations, hypotheses, fit)
            np.testing.assert_allclose(seen.left(hypotheses, fit), seen.whitened(left), atol=1e-8)


def test_in_white_noise_the_whitened_gain_is_the_gain(two_runs):
    evidence, fits = two_runs
    runs = evidence.observations.runs
    sigma = np.array((0.5, 1.0, 2.0, 4.0))
    blocks = blocks_of_runs([run.t for run in runs], [run.valid for run in runs])
    seen = gather(evidence.observations, flat_whitener(evidence.observations, sigma))
    before, after = (residuals(evidence.observations, *fit) for fit in fits)
    old, new = ((blocks.sums(part) / sigma ** 2).sum(axis=1) for part in (before, after))
    plain = 1.0 - new.sum() / old.sum()
    drawn = np.quantile(1.0 - (blocks.draws @ new) / (blocks.draws @ old), (0.025, 0.975))
    white = blocks.whitened_gain(seen.whitened(before), seen.whitened(after))
    assert plain > 0.5
    np.testing.assert_allclose((white.share, white.low, white.high), (plain, *drawn), rtol=1e-9)


def test_wandering_noise_hides_a_gain_in_plain_rows_only():
    random = np.random.default_rng(5)
    rows, memory = 4000, 0.98
    t, valid = np.arange(rows) * 0.01, np.ones((rows, 2), bool)
    wander = lfilter([1.0], [1.0, -memory], random.normal(0.0, 1.0, (rows, 2)), axis=0)
    before = wander + np.sin(2.0 * np.pi * 20.0 * t)[:, None]
    blocks = blocks_of_runs([t], [valid])
    noise = ArNoise(np.array((memory,)), 1.0)
    white = blocks.whitened_gain(*(np.concatenate([noise.whiten(part[:, joint, None], valid[:, 0])
                                                   for joint in range(2)])[:, 0]
                                   for part in (before, wander)))
    assert np.sum(wander ** 2) > 0.95 * np.sum(before ** 2)
    assert white.low > 0.3


# -------------------------------------------------------------------------------------- the gate


def reasons_of(log):
    rows = observe(runs_of_log(log, REFERENCE), REFERENCE, 'paper', None)
    fit = identify_runs(list(rows.runs), rows.target, rows.base, 'paper')
    return unusable(rows, fit), fit.estimate.relative_error


@pytest.fixture(scope='module')
def plain():
    """Return the log of a machine that is as modelled."""
    return log_with()


@pytest.mark.parametrize('anchor', [(1.0, -0.8, 0.5), (0.3, -0.3, 0.0), (0.3, -0.3, -1.5)])
def test_a_strong_cable_is_no_reason_to_doubt_the_bodies(plain, anchor):
    """It moves the torque far from that of the bodies, and yet they show beside it."""
    state = runs_of_log(plain, REFERENCE)[0].state
    pull = {'stiffness': np.full(3, 100.0), 'anchor': np.array(anchor)}
    cable = CATALOGUE['cable_spring'].torque(state, pull, EVERY)
    reasons, error = reasons_of(replace(plain, tau=plain.tau + cable))
    assert error > WORST_ERROR
    assert reasons == []


@pytest.mark.parametrize('order', [[3, 2, 1, 0], [1, 2, 3, 0], [2, 3, 0, 1]])
def test_joints_in_another_order_are(plain, order):
    assert reasons_of(plain)[0] == []
    assert reasons_of(replace(plain, tau=plain.tau[:, order]))[0]


@pytest.mark.parametrize('seed', [1, 2])
def test_so_is_torque_that_has_nothing_to_do_with_the_motion(plain, seed):
    noise = np.random.default_rng(seed).normal(0.0, 5.0, plain.tau.shape)
    assert any('explain only' in reason for reason in reasons_of(replace(plain, tau=noise))[0])
