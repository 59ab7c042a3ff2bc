"""Names and unnamed causes in one search: what is found, what falls, and what stands against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured import excitation
from planned import evidence_of, log_of, state_of_motion
from scipy.signal import lfilter
from searches import (
    BELT,
    COGGING,
    DRIFT,
    EVERY,
    GAIN,
    LOADED,
    MODEL,
    OFFSET,
    cause,
    log_with,
    names,
    search_of,
    search_on,
)

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.effect import EffectParameter
from par4_dynamics.effects.geometry_error import DIMENSIONS
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_identification.diagnosis.evidence.estimates import effect_parameters, estimated
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.fit import left_by, residuals, solve
from par4_identification.diagnosis.evidence.holdout import blocks_of_runs
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.kind import Kind
from par4_identification.diagnosis.evidence.observations import observe
from par4_identification.diagnosis.evidence.pool import MOST_COLUMNS, Pool
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.evidence.unnamed import KINDS, Kinds
from par4_identification.diagnosis.evidence.whitener import flat_whitener
from par4_identification.diagnosis.nominal.gate import WORST_ERROR, unusable
from par4_identification.diagnosis.search.causes import named_of
from par4_identification.diagnosis.search.polish import polished
from par4_identification.diagnosis.search.requirement import requirement_of, torque_errors
from par4_identification.diagnosis.search.rules import OF_AXIS, Rules
from par4_identification.diagnosis.search.search import Rival
from par4_identification.diagnosis.search.shapes import shapes_of
from par4_identification.diagnosis.verdict.judgement import judge, unnamed_cause
from par4_identification.diagnosis.verdict.sure import without_replaceable_names
from par4_identification.fitting.identification import identify_runs
from par4_identification.signals.noise import ArNoise
from par4_identification.signals.rows import runs_of_log
from robots import REFERENCE, model_with


def bump(state):
    """Return friction that is higher around one place of joint 1: no effect of the library."""
    torque = np.zeros_like(state.q)
    middle = np.median(state.q[:, 1])
    torque[:, 1] = 1.5 * np.exp(-((state.q[:, 1] - middle) / 0.1) ** 2) * np.sign(state.qd[:, 1])
    return torque


# ------------------------------------------------------------------------------- fits of a pool


def test_a_pool_fits_what_least_squares_fit():
    search = search_of(('torque_offset', {'offset': OFFSET}), LOADED)
    model = (cause('torque_offset', (0, 2)), cause('load_dependent_friction'))
    pool, part = search.pool, search.pool.evidence
    fitted, solution = pool.fit(model), pool.solution(model)
    design = part.design(model)
    values, *_ = np.linalg.lstsq(design, part.target, rcond=None)
    found = [item.stacked(own) for item, own in zip(model, solution.coefficients)]
    np.testing.assert_allclose(np.concatenate((solution.base, *found)), values, rtol=1e-6,
                               atol=1e-9)
    left = part.target - design @ values
    assert fitted.fit_squares == pytest.approx(left @ left, rel=1e-9)
    missed = pool.heldout.target - pool.heldout.design(model) @ values
    assert fitted.heldout_squares == pytest.approx(missed @ missed, rel=1e-9)


def test_what_columns_explain_beside_a_design_is_what_rows_say():
    """Products kept for many columns give what a fit of the rows gives, order by order."""
    search = search_of(('torque_offset', {'offset': OFFSET}), LOADED)
    evidence = search.pool.evidence
    wave = Hypothesis(CATALOGUE['cogging'], {'periods': (11.0, 46.0, 76.0)}, (1, 3))
    model = (cause('torque_offset', (0, 2)), wave)
    projection = project(evidence, model)

    def squares(more: tuple[Hypothesis, ...]) -> float:
        design = evidence.design((*model, *more))
        values, *_ = np.linalg.lstsq(design, evidence.target, rcond=None)
        return float(np.sum((evidence.target - design @ values) ** 2))

    before = squares(())
    assert projection.squares == pytest.approx(before, rel=1e-9)
    assert projection.residual @ projection.residual == pytest.approx(before, rel=1e-9)
    for name, shapes in (('load_dependent_friction', [{}]), ('distributed_rods', [{}]),
                         ('stribeck', [{'stribeck_velocity': 0.05}, {'stribeck_velocity': 0.4}]),
                         ('cogging', [{'periods': (5.0, 12.0)}])):
        effect = CATALOGUE[name]
        for shape, gain in zip(shapes, projection.gains(effect, shapes)):
            assert gain == pytest.approx(before - squares((Hypothesis(effect, shape, EVERY),)),
                                         rel=1e-6, abs=1e-6 * before)


def test_the_prior_of_an_unnamed_cause_counts_as_rows_of_zeros():
    search = search_of(LOADED)
    evidence = search.pool.evidence
    kinds = Kinds(evidence.observations)
    kind = next(kind for kind in kinds.beside(evidence.observations, residuals(
        evidence.observations, [], solve(evidence, []))) if kind.name == 'speed')
    hypothesis = Hypothesis(kind, {}, EVERY)
    design = evidence.design([hypothesis])
    width = design.shape[1] - evidence.base.shape[1]
    squares = np.sum(design ** 2, axis=0)[-width:]
    squares = np.maximum(squares, squares.mean())
    prior = np.zeros((width, design.shape[1]))
    prior[:, -width:] = np.diag(np.sqrt(3.0 / (evidence.rows / 4) * squares))
    stacked = np.vstack((design, prior))
    values, *_ = np.linalg.lstsq(stacked, np.concatenate((evidence.target, np.zeros(width))),
                                 rcond=None)
    fit = search.pool.solution([hypothesis])
    found = np.concatenate((fit.base, hypothesis.stacked(fit.coefficients[0])))
    np.testing.assert_allclose(found, values, rtol=1e-4, atol=1e-6)
    left = np.sum((np.concatenate((evidence.target, np.zeros(width))) - stacked @ values) ** 2)
    assert search.pool.fit([hypothesis]).fit_squares == pytest.approx(left, rel=1e-9)


def test_a_column_that_the_rows_do_not_visit_leaves_the_other_values_alone():
    search = search_of(('torque_offset', {'offset': OFFSET}), library=('torque_offset',))
    part = search.pool.evidence
    later = Kinds(part.observations).ranges
    kind = replace(next(kind for kind in KINDS if kind.name == 'time'),
                   ranges=replace(later, end=4.0 * later.end))
    offset = cause('torque_offset')
    alone, beside = (solve(part, model).coefficients[0]
                     for model in ((offset,), (offset, Hypothesis(kind, {}, (1,)))))
    assert np.any(np.all(np.abs(part.columns(Hypothesis(kind, {}, (1,)))) < 1e-100, axis=0))
    np.testing.assert_allclose(beside[0, [0, 2, 3]], alone[0, [0, 2, 3]], rtol=1e-2)


# --------------------------------------------------------------------------------- what is found


def test_three_names_and_an_unnamed_cause_keep_each_other_company():
    search = search_of(('torque_offset', {'offset': OFFSET}), LOADED, ('cogging', COGGING),
                       library=('torque_offset', 'load_dependent_friction', 'cogging',
                                'coulomb_asymmetry', 'stribeck'), beside=bump)
    model = search.run()
    assert set(names(named_of(model))) & {'torque_offset', 'coulomb_asymmetry'}
    assert {'load_dependent_friction', 'cogging'} <= set(names(model))
    unnamed, = (item for item in model if isinstance(item.effect, Kind))
    assert unnamed.effect.name in ('place', 'position', 'memory')
    assert unnamed.joints == (1,)
    told = unnamed_cause(search, unnamed, model)
    assert told.margin > search.weighing.requirement(model).heldout
    assert 0.0 < told.share < 1.0


def ribbed(state):
    """Return friction of joints 0 and 2 that follows the ribs of their seals."""
    torque = np.zeros_like(state.q)
    for joint, ribs in ((0, 47.4), (2, 60.0)):
        rib = np.abs(np.sin(0.5 * ribs * state.q[:, joint] + joint))
        torque[:, joint] = rib * np.tanh(state.qd[:, joint] / 0.01)
    return torque


def test_friction_that_waves_with_the_position_is_no_ripple_of_the_torque():
    search = search_of(library=('torque_ripple', 'cogging', 'load_dependent_friction', 'stribeck'),
                       beside=ribbed)
    unnamed, = search.run()
    assert unnamed.effect.name == 'uneven'
    assert unnamed.joints == (0, 2)
    # its mean is Coulomb friction, with which the base parameters fit most of the torque
    heldout = search.pool.heldout.observations
    left = np.concatenate([part[run.valid] for run, part in zip(heldout.runs, residuals(
        heldout, (), solve(search.pool.evidence, ())))])
    told = unnamed_cause(search, unnamed, (unnamed,))
    assert told.torque_rms == pytest.approx(np.sqrt(np.mean(left ** 2)), rel=0.1)


def test_a_size_is_beyond_base_parameters_that_all_rows_have_in_common():
    """Held-out rows that go one way only would leave nothing of a constant torque but friction."""
    search = search_of(library=('cogging',), beside=lambda state: np.broadcast_to(
        OFFSET, state.q.shape))
    kind = next(kind for kind in KINDS if kind.name == 'position')
    cause_of_all = Hypothesis(replace(kind, ranges=Kinds(search.pool.evidence.observations).ranges),
                              {}, EVERY)
    one_way = [replace(run, valid=run.valid & (run.speed * OFFSET > 0.0))
               for run in search.pool.heldout.observations.runs]
    search.pool.heldout = replace(search.pool.heldout, observations=replace(
        search.pool.heldout.observations, runs=tuple(one_way)))
    told = unnamed_cause(search, cause_of_all, (cause_of_all,))
    rows = np.concatenate([np.broadcast_to(OFFSET, run.valid.shape)[run.valid] for run in one_way])
    # friction has some of it on these rows and none on the fitted ones; here alone it has most
    assert 0.5 < told.torque_rms / np.sqrt(np.mean(rows ** 2)) < 1.0


@pytest.mark.parametrize(('name', 'shape', 'share'), [
    ('torque_offset', {}, 0.035), ('stribeck', {'stribeck_velocity': 0.3}, 0.1)])
def test_a_constant_torque_has_no_law_that_an_axis_may_follow_otherwise(name, shape, share):
    search = search_of(('torque_offset', {'offset': OFFSET}), library=(name,))
    evidence, item = search.pool.evidence, Hypothesis(CATALOGUE[name], shape, EVERY)
    fit = solve(evidence, (item,))
    wrong = torque_errors(evidence, fit, OF_AXIS)[1]
    np.testing.assert_allclose(
        wrong, share * evidence.columns(item) @ item.stacked(fit.coefficients[0]))


def test_a_name_that_imitates_falls_beside_what_it_imitates_and_the_others_stay():
    search = search_of(('theta_friction', BELT), ('cogging', COGGING),
                       library=('passive_joint_friction', 'cogging'))
    model = search.run()
    assert names(named_of(model)) == ['cogging']
    assert 'wrench' in names(model)
    assert any(item.label == 'passive_joint_friction' for item in search.journal.rejected)


def test_no_unnamed_cause_stands_beside_the_right_names():
    search = search_of(('theta_friction', BELT), ('drive_gain_error', GAIN),
                       library=('theta_friction', 'passive_joint_friction', 'drive_gain_error',
                                'joint_inertia_difference'))
    assert set(names(search.run())) == {'theta_friction', 'drive_gain_error'}


def sprung(state):
    """Return an offset of joint 1 and friction of theta that builds up over 1 mrad of it."""
    theta = state.platform.x[:, 3]
    share = np.zeros_like(theta)
    for row, step in enumerate(np.diff(theta) / 1e-3, start=1):
        share[row] = (share[row - 1] + step) / (1.0 + abs(step))
    force = np.zeros((len(theta), 4))
    force[:, 3] = 0.12 * share + 0.02 * state.platform.xd[:, 3]
    return state.torque_of_force(force) + (0.0, 0.35, 0.0, 0.0)


def test_names_stay_where_a_force_that_has_their_laws_explains_what_these_get_wrong():
    parts = []
    for seed, duration in ((1, 12.0), (2, 8.0)):
        motion = excitation('reference', duration, 900 + seed)
        state = state_of_motion(REFERENCE, motion)
        log = log_of(REFERENCE, motion.t, motion.q, MODEL.torque(state) + sprung(state), seed,
                     noise=1.0)
        parts.append(evidence_of(log, REFERENCE, MODEL, noise=1.0))
    search = search_on(*parts, library=('theta_friction', 'torque_offset'))
    assert set(names(search.run())) == {'theta_friction', 'torque_offset'}


@pytest.mark.parametrize(('tilt', 'expected'), [(0.014, 'external_force'), (0.04, 'wrench')])
def test_what_stands_in_for_a_name_explains_as_much_more_as_it_would_beside_it(tilt, expected):
    """A force, and gravity that has turned a little: the name is right to a part in a thousand."""
    search = search_of(('external_force', {'x': 0.64, 'y': 3.57, 'z': 0.42}),
                       ('base_tilt', {'about_x': -tilt, 'about_y': 0.7 * tilt}),
                       library=('external_force',))
    assert names(search.run()) == [expected]


@pytest.mark.parametrize(('hidden', 'name', 'stays'), [
    (('friction_drift', DRIFT), 'coulomb_asymmetry', False),
    (('theta_friction', BELT), 'theta_friction', True), (LOADED, 'load_dependent_friction', True)])
def test_a_name_gives_way_to_a_nameless_function_that_explains_far_more(hidden, name, stays):
    search = search_of(hidden, library=())
    assert not named_of(search.run())  # and the kinds of unnamed causes are those of this motion
    model = without_replaceable_names(search, (cause(name),))
    assert (names(model) == [name]) is stays
    assert bool(named_of(model)) is stays


@pytest.mark.parametrize(('hidden', 'name', 'expected'), [
    (('theta_friction', BELT), 'coulomb_asymmetry', 'theta_friction'),
    (('theta_friction', BELT), 'theta_friction', 'theta_friction'),
    (('base_tilt', {'about_x': 0.02, 'about_y': -0.03}), 'torque_offset', 'torque_offset')])
def test_a_name_gives_way_to_another_that_explains_far_more_in_its_place(hidden, name, expected):
    search = search_of(hidden, library=(hidden[0], name))
    assert names(without_replaceable_names(search, (cause(name),))) == [expected]


def test_a_name_falls_where_another_that_is_no_cause_explains_far_more_in_its_place(monkeypatch):
    search = search_of(('theta_friction', BELT), library=('theta_friction', 'coulomb_asymmetry'))
    monkeypatch.setattr(search.weighing, 'standing', lambda *_of: 0.9)
    assert not named_of(without_replaceable_names(search, (cause('coulomb_asymmetry'),)))
    assert any('is no cause itself' in item.reason for item in search.journal.rejected)


def test_a_clean_machine_has_no_cause():
    assert search_of(library=('torque_offset', 'base_tilt', 'cogging', 'coulomb_asymmetry',
                              'stribeck', 'theta_friction')).run() == ()


@pytest.mark.parametrize(('effect', 'values', 'kinds'), [
    ('torque_ripple', {'relative': 0.04, 'periods': 23.0, 'phase': (0.0, 1.0, 2.0, 3.0)},
     {'torque'}),
    ('time_offset', {'delay': 0.002}, {'rate'}),
    ('actuator_lag', {'time_constant': 0.002}, {'rate'}),
    ('cogging', COGGING, {'periodic'}),
    ('drive_gain_error', GAIN, {'load'}),
    ('theta_friction', BELT, {'wrench'}),
    ('friction_drift', DRIFT, {'drift'}),
    ('stribeck', {'stribeck_torque': 1.0, 'stribeck_velocity': 0.2}, {'speed'}),
    ('presliding', {'distance': 0.01}, {'memory', 'speed'})])
def test_what_no_name_explains_has_a_kind(effect, values, kinds):
    model = search_of((effect, values)).run()
    assert model
    assert model[0].effect.name in kinds


@pytest.mark.parametrize('joints', [EVERY, (1, 2)])
def test_the_orders_of_a_periodic_torque_are_one_cause(joints):
    amplitude = np.where(np.isin(EVERY, joints), 1.0, 0.0)
    search = search_of(('cogging', {**COGGING, 'amplitude': tuple(0.3 * amplitude)}),
                       ('cogging', {**COGGING, 'amplitude': tuple(0.2 * amplitude),
                                    'periods': 54.0}), library=('cogging', 'torque_offset'))
    found, = search.run()
    assert (found.shape, found.joints) == ({'periods': (31.0, 54.0)}, joints)
    fit = search.pool.solution((found,))
    values, std = estimated(search.pool.evidence, found, fit, 0)
    expected = np.array([(0.3, 0.2)] * len(joints))
    np.testing.assert_allclose(values['amplitude'], expected, rtol=0.05)
    assert np.all(np.abs(values['amplitude'] - expected) < 5.0 * std['amplitude'])
    assert effect_parameters(search.pool.evidence, found, fit, 0)['amplitude'].value == (
        tuple(values['amplitude'][:, 0]), tuple(values['amplitude'][:, 1]))


# -------------------------------------------------------------------------------------- joints


@pytest.mark.parametrize('true', [(2,), (0, 3)])
@pytest.mark.parametrize(('effect', 'parameter', 'size'), [
    ('drive_gain_error', 'relative', 0.05), ('joint_friction_difference', 'coulomb', 0.4),
    ('joint_inertia_difference', 'inertia', 0.008)])
def test_of_equal_explanations_the_fewest_joints_are_named(effect, parameter, size, true):
    """What all joints share belongs to the base, so that several sets explain alike.

    Two joints that differ by the same cannot be told from the two others with the other sign.
    """
    values = np.zeros(4)
    values[list(true)] = size * np.linspace(1.0, 1.7, len(true))
    none = {item.name: 0.0 for item in CATALOGUE[effect].parameters}
    search = search_of((effect, {**none, parameter: tuple(values)}), library=(effect,))
    found, = search.run()
    assert found.joints == true


def test_a_joint_whose_value_is_zero_is_not_named():
    search = search_of(('cogging', {**COGGING, 'amplitude': (0.3, 0.0, 0.2, 0.0)}),
                       library=('cogging',))
    found, = search.run()
    assert found.joints == (0, 2)


# ------------------------------------------------------------------------ what must be gained


def test_a_strong_cause_asks_more_of_a_weak_one_by_the_squares_of_its_torque():
    search = search_of(('torque_offset', {'offset': (3.0, -3.0, 2.0, -2.0)}))
    strong, rules = (cause('torque_offset'),), Rules()
    alone, beside = (requirement_of(search.pool, part, rules) for part in ((), strong))
    explained = search.pool.fit(()).fit_squares - search.pool.fit(strong).fit_squares
    expected = 0.5 * rules.named_error ** 2 * explained
    assert beside.fit - alone.fit == pytest.approx(expected, rel=1e-6)
    assert beside.inflation - alone.inflation == pytest.approx(expected / rules.evidence)


def test_stribeck_friction_of_an_arm_dies_away_by_the_law_that_it_has():
    """Tustin's exponential is another law than the usual Gaussian, on an arm as on an axis."""
    search = search_of(('stribeck', {'stribeck_torque': 1.0, 'stribeck_velocity': 0.3,
                                     'exponent': 1.0}),
                       library=('stribeck', 'nonlinear_viscous'))
    item, = polished(search, search.run())
    assert item.effect.name == 'stribeck'
    assert item.shape['exponent'] == pytest.approx(1.0, abs=0.1)
    assert item.shape['stribeck_velocity'] == pytest.approx(0.3, rel=0.1)


@pytest.mark.parametrize(('torque', 'possible'), [(0.3, True), (-0.3, False)])
def test_a_value_on_the_wrong_side_of_zero_is_none_of_a_machine(torque, possible):
    search = search_of(('stribeck', {'stribeck_torque': torque, 'stribeck_velocity': 0.3}),
                       library=('stribeck',))
    item = cause('stribeck', stribeck_velocity=0.3)
    assert search.belief.is_possible(item, ()) == possible


@pytest.mark.parametrize(('torque', 'computed'), [(0.3, 0), (-0.3, 1)])
def test_deviations_are_computed_only_of_values_that_need_an_excuse(monkeypatch, torque, computed):
    search = search_of(('stribeck', {'stribeck_torque': torque, 'stribeck_velocity': 0.3}),
                       library=('stribeck',))
    asked = []
    monkeypatch.setattr('par4_identification.diagnosis.search.belief.estimated',
                        lambda *own: asked.append(own) or estimated(*own))
    reason = search.belief.objection(cause('stribeck', stribeck_velocity=0.3), ())
    assert (len(asked), reason is None) == (computed, computed == 0)


def test_a_value_beyond_its_bounds_by_chance_is_excused_by_its_deviation(monkeypatch):
    search = search_of(('stribeck', {'stribeck_torque': -0.3, 'stribeck_velocity': 0.3}),
                       library=('stribeck',))

    def doubted(*own):
        values, _ = estimated(*own)
        return values, {name: np.full(np.shape(value), 1e3) for name, value in values.items()}

    monkeypatch.setattr('par4_identification.diagnosis.search.belief.estimated', doubted)
    assert search.belief.objection(cause('stribeck', stribeck_velocity=0.3), ()) is None


@pytest.mark.parametrize(('name', 'values', 'joints', 'wrong'), [
    ('load_dependent_friction', {'coefficient': (-0.02,) * 4}, EVERY, True),
    ('load_dependent_friction', {'coefficient': (0.02, -0.02, 0.02, -0.02)}, EVERY, False),
    ('load_dependent_friction', {'coefficient': (0.02, -0.02, 0.02, -0.02)}, (1, 3), True),
    ('load_dependent_friction', {'coefficient': (5.0,) * 4}, EVERY, False),
    ('torque_offset', {'offset': (-0.5,) * 4}, EVERY, False),
    ('theta_friction', {'coulomb': -0.3, 'viscous': -0.1}, EVERY, True)])
def test_values_that_no_joint_of_a_machine_has_lie_on_the_wrong_side(name, values, joints, wrong):
    """One beyond a limit may be a mistake of the values; one below zero says that it is none."""
    search = search_of((name, values), library=(name,))
    assert search.belief.is_on_wrong_side(cause(name, joints), ()) == wrong


STRONG = (6.0, -6.0, 4.0, -4.0)
WEAK = 0.02


def one_sided(state):
    """Return a part of the strong torque that comes with one direction and goes with the other."""
    return WEAK * np.array(STRONG) * np.sign(state.qd)


@pytest.mark.parametrize(('others', 'left'), [
    (('external_force',), {'platform_drag', 'external_force'}), ((), {'platform_drag'})])
def test_a_cause_that_cannot_be_real_gives_way_to_a_twin_that_can(others, left):
    """A cable that has no stiffness beside drag is a constant force; it is no other name.

    Without the force the drag would have to explain its torque, too.
    """
    search = search_of(('external_force', {'x': 0.3, 'y': 0.0, 'z': -0.4}),
                       ('platform_drag', {'viscous': 0.0, 'quadratic': 0.3}),
                       library=('cable_spring', *others, 'platform_drag'))
    cable, drag = cause('cable_spring'), cause('platform_drag')
    assert 'no cable' in search.belief.objection(cable, (drag,))
    assert set(names(search.tested((cable, drag)))) == left


@pytest.mark.parametrize(('behind', 'on_heldout', 'first'), [
    (0.9, 5.0, 'torque_offset'), (1.1, 5.0, 'position_torque'), (1.1, 0.5, 'torque_offset'),
    (9.0, 0.5, 'torque_offset'), (11.0, 0.5, 'position_torque'), (np.inf, 0.0, 'position_torque')])
def test_of_names_as_likely_but_for_chance_the_simplest_goes_first(behind, on_heldout, first,
                                                                   monkeypatch):
    """One that is no more likely than no name at all is none of them."""
    search = search_of(('torque_offset', {'offset': STRONG}),
                       library=('position_torque', 'torque_offset'))
    scores = {'position_torque': 500.0, 'torque_offset': 500.0 - behind}
    monkeypatch.setattr(search, '_trimmed', lambda candidate, _: (
        scores[candidate.hypothesis.effect.name], candidate.hypothesis))
    gains = search.weighing.gains
    monkeypatch.setattr(search.weighing, 'gains', lambda own, others: (
        gains(own, others)[0], 400.0 - on_heldout * (own.effect.name == 'torque_offset')))
    model, = search._with_a_name((), set())
    assert model.effect.name == first


def test_without_twins_the_best_name_is_taken():
    search = search_of(('torque_offset', {'offset': STRONG}), rules=Rules(twin=0.0),
                       library=('drive_gain_error', 'torque_offset'))
    assert names(search.run()) == ['torque_offset']


def test_a_candidate_that_was_not_looked_at_closely_is_taken_for_none(monkeypatch):
    """The strongest ends the look at weaker ones."""
    search = search_of(('torque_offset', {'offset': STRONG}),
                       ('geometry_error', {**dict.fromkeys(DIMENSIONS, 0.0), 'arm_length': 0.004}),
                       library=('geometry_error', 'torque_offset'))
    looked_at, trimmed = [], search._trimmed

    def seen(candidate, model):
        looked_at.append(candidate.hypothesis.effect.name)
        return trimmed(candidate, model)

    monkeypatch.setattr(search, '_trimmed', seen)
    first, = search._with_a_name((), set())
    assert first.effect.name == 'torque_offset'
    assert looked_at == ['torque_offset']


@pytest.mark.parametrize('library', [('torque_offset', 'coulomb_asymmetry'),
                                     ('coulomb_asymmetry', 'torque_offset')])
def test_of_exact_twins_that_without_variables_goes_first_wherever_it_stands(library):
    """So it does among the rivals of a third, where rounding must not decide."""
    search = search_of(('torque_offset', {'offset': STRONG}), library=library)
    first, = search.run()
    assert first.effect.name == 'torque_offset'
    rivals = [rival.hypothesis for rival in search.rivals(cause('cogging', periods=7.0), ())]
    assert names(item for item in rivals if item is not None and not isinstance(
        item.effect, Kind)) == ['torque_offset', 'coulomb_asymmetry']


@pytest.mark.parametrize(('weak', 'stays'), [
    (('joint_friction_difference', {}), False),
    (('cogging', {'periods': 31.0}), True)])
def test_what_a_strong_cause_may_get_wrong_is_no_weak_one_but_anything_else_is(weak, stays):
    """Both gain more than chance, and less than an error of the strong torque could make.

    Friction resembles such an error, a periodic torque does not.
    """
    name, shape = weak
    search = search_of(
        ('torque_offset', {'offset': STRONG}),
        *([('cogging', {**COGGING, 'amplitude': WEAK})] if stays else []),
        library=('torque_offset', name), beside=None if stays else one_sided)
    model = (cause('torque_offset'), cause(name, EVERY if stays else EVERY[:3], **shape))
    fit_gain, _ = search.weighing.gains(model[1], model[:1])
    assert Rules().evidence < fit_gain < search.weighing.requirement(model).fit
    assert (name in names(search.tested(model))) == stays
    assert (name in names(search.run())) == stays


def test_a_weak_cause_waits_until_what_is_strong_is_known():
    """What two causes leave together counts as noise as long as one of them is not in the model."""
    weak, strong, unseen = (cause('cogging', periods=31.0), cause('torque_offset'),
                            cause('geometry_error'))
    search = search_of(('torque_offset', {'offset': STRONG}),
                       ('cogging', {**COGGING, 'amplitude': WEAK}),
                       ('geometry_error', {**dict.fromkeys(DIMENSIONS, 0.0),
                                           'arm_length': 0.02}))
    early, late = (search.weighing.standing(weak, others)
                   for others in ((strong,), (strong, unseen)))
    assert early < 1.0 < late


SMALL_WAVES = 'cogging', {**COGGING, 'amplitude': 0.1}


class LookAlike(TorqueOffset):
    """A law that all but is the sum of two others and of half a third one, with free waves."""

    name = 'look_alike'
    phrase = 'law that looks like others'
    parameters = tuple(EffectParameter(f'size_{number}', '1', 'platform') for number in range(14))
    shared = True

    def columns(self, state, _shape):
        both = model_with(model_with(MODEL, LOADED[0], **LOADED[1]), SMALL_WAVES[0],
                          **SMALL_WAVES[1])
        waves = np.sin((40.0 + np.arange(14)) * state.q[..., None])
        waves[..., 0] *= 0.2
        waves[..., 0] += both.torque(state) - MODEL.torque(state) + 0.1 * np.array(STRONG)
        return waves


def test_several_names_take_the_place_of_one_that_looks_like_them(monkeypatch):
    """It explains more than any of them, goes first and leaves them nothing; none does as well."""
    monkeypatch.setitem(CATALOGUE, LookAlike.name, LookAlike())
    true = {'torque_offset', LOADED[0], SMALL_WAVES[0]}
    search = search_of(('torque_offset', {'offset': 0.2 * np.array(STRONG)}), LOADED, SMALL_WAVES,
                       library=(LookAlike.name, *true))
    assert set(names(search.run())) == true
    monkeypatch.setattr(search, '_with_several_instead', lambda *_: None)
    assert set(names(search.run())) == {LookAlike.name, 'torque_offset'}


def test_a_pool_that_begins_anew_fits_as_before():
    search = search_of(('torque_offset', {'offset': OFFSET}))
    models = [(cause('stribeck', stribeck_velocity=0.01 * 1.1 ** number), cause('torque_offset'))
              for number in range(MOST_COLUMNS // 2)]
    before = search.pool.fit(models[0])
    for model in models:
        search.pool.fit(model)
    assert len(search.pool.columns_of(models[0][0])) == 1
    fresh = Pool(search.pool.evidence, search.pool.heldout)
    np.testing.assert_allclose(fresh.fit(models[0]).squares, before.squares, rtol=1e-9)
    np.testing.assert_allclose(search.pool.solution(models[0]).coefficients[1],
                               fresh.solution(models[0]).coefficients[1], rtol=1e-9)


# -------------------------------------------------------------------------------------- rivals


def test_twins_and_the_best_rival_of_a_cause_are_told():
    search = search_of(('torque_offset', {'offset': OFFSET}),
                       library=('torque_offset', 'coulomb_asymmetry', 'stribeck'))
    model = search.run()
    judgement = judge(search, model[0], model)
    assert {model[0].effect.name, *judgement.twins} == {'torque_offset', 'coulomb_asymmetry'}
    others = search.rivals(model[0], ())
    nothing, = (rival for rival in others if rival.hypothesis is None)
    assert judgement.margin == min(rival.margin for rival in others if rival.believable)
    assert nothing.margin == pytest.approx(search.weighing.gains(model[0], ())[1])


def test_a_name_far_behind_is_no_twin():
    search = search_of(('cogging', COGGING), library=('cogging', 'torque_ripple', 'torque_offset'))
    model = search.run()
    assert names(model) == ['cogging']
    assert judge(search, model[0], model).twins == ()


@pytest.mark.parametrize(('heldout', 'fitted', 'is_twin'), [
    (30.0, 47.0, False), (-37.0, 46.0, True), (-37.0, 60.0, False), (50.0, 8.0, True)])
def test_rows_held_out_that_speak_for_a_name_make_it_a_twin(heldout, fitted, is_twin, monkeypatch):
    search = search_of(('torque_offset', {'offset': OFFSET}), library=('torque_offset',))
    offset = cause('torque_offset')
    rival = Rival(cause('stribeck', stribeck_velocity=0.1), heldout, fitted, True)
    monkeypatch.setattr(search, 'rivals', lambda *_: [rival])
    assert judge(search, offset, (offset,)).twins == (('stribeck',) if is_twin else ())


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
    reason = search_on(evidence, evidence).belief.objection(hypothesis, ())
    assert (reason is None) == accepted, reason


# ------------------------------------------------------------------------ gains on whitened rows


@pytest.fixture(scope='module')
def two_runs():
    """Return evidence of two runs of another length and what two models leave of its rows."""
    logs = [log_with(('torque_offset', {'offset': OFFSET}), seed=seed, duration=duration)
            for seed, duration in ((1, 6.0), (2, 9.0))]
    evidence = evidence_of(logs, REFERENCE, MODEL)
    causes = [cause('torque_offset')]
    return evidence, [(part, solve(evidence, part)) for part in ([], causes)]


def test_shapes_are_those_of_the_run_that_moves_longest():
    """A log may begin with a longer rest, of which no law of the speed has a shape."""
    moving = log_with(('torque_offset', {'offset': OFFSET}), duration=6.0)
    resting = replace(moving, t=1e-3 * np.arange(14_000), q=np.repeat(moving.q[:1], 14_000, axis=0),
                      tau=np.repeat(moving.tau[:1], 14_000, axis=0), segments=(slice(0, 14_000),))
    runs = [runs_of_log(log, REFERENCE)[0] for log in (resting, moving)]
    assert len(runs[0].t) > len(runs[1].t)
    both, alone = (observe(part, REFERENCE, 'paper', None) for part in (runs, runs[1:]))
    for name in ('stribeck', 'cogging', 'presliding'):
        found = shapes_of(both, CATALOGUE[name])
        assert found
        assert found == shapes_of(alone, CATALOGUE[name])


@pytest.mark.parametrize(('name', 'shape', 'numbers'), [
    ('actuator_lag', {}, 1), ('time_offset', {'expanded_at': 0.002}, 1),
    ('cogging', {'periods': 7.0}, 9), ('cogging', {'periods': (7.0, 14.0, 84.0)}, 27),
    ('elastic_transmission', {f'expanded_at_{joint}': 1e-4 for joint in EVERY}, 4),
    ('elastic_transmission', {'expanded_at_1': 1e-4, 'damping_ratio': 0.1}, 5),
    ('stribeck', {'stribeck_velocity': 0.2}, 5)])
def test_numbers_are_what_a_fit_chooses(two_runs, name, shape, numbers):
    """What coefficients tell already, such as where a series is expanded, is none of them."""
    evidence, _ = two_runs
    pool = Pool(evidence, evidence)
    assert pool.numbers(Hypothesis(CATALOGUE[name], shape, EVERY)) == numbers


def test_what_a_fit_leaves_of_whitened_rows_is_what_it_leaves_whitened(two_runs):
    evidence, fits = two_runs
    coloured = replace(evidence.whitener, noise=tuple(
        ArNoise(np.array((0.9 - 0.1 * joint, -0.2)), 0.04) for joint in EVERY))
    for seen in (evidence, gather(evidence.observations, coloured)):
        for hypotheses, fit in fits:
            left = residuals(evidence.observations, hypotheses, fit)
            np.testing.assert_allclose(left_by(seen, hypotheses, fit), seen.whitened(left),
                                       atol=1e-8)


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
    return [reason.text for reason in unusable(rows, fit, REFERENCE)], fit.estimate.relative_error


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


@pytest.mark.parametrize(('name', 'values', 'set_number'), [
    ('theta_friction', {'coulomb': 0.3, 'viscous': 0.0}, 0),
    ('theta_friction', {'coulomb': 0.0, 'viscous': 0.1}, 1),
    ('passive_joint_friction', {'coulomb': 0.05, 'viscous': 0.0}, 0),
    ('platform_drag', {'viscous': 0.0, 'quadratic': 2.0}, 1)])
def test_a_law_of_two_terms_has_only_those_that_the_machine_has(name, values, set_number):
    """The other one would be any number within its deviation, below zero as often as above."""
    found, = search_of((name, values), library=(name,)).run()
    assert (found.effect.name, found.sets) == (name, (set_number,))


def test_both_terms_of_a_law_are_found_where_both_act():
    values = {'coulomb': 0.3, 'viscous': 0.1}
    found, = search_of(('theta_friction', values), library=('theta_friction',)).run()
    assert found.sets in {None, (0, 1)}


def test_a_ripple_of_few_periods_is_found_on_a_joint_that_hardly_makes_one():
    """It goes with the load, so that it is neither gravity nor a spring."""
    found, = search_of(('torque_ripple', {'relative': 0.05, 'periods': 7.0, 'phase': 0.3}),
                       library=('torque_ripple',)).run()
    assert found.shape == {'periods': 7.0}


@pytest.mark.parametrize(('found', 'told'), [
    ((-0.242, -0.238, -0.24, -0.241), '-0.24'), ((0.2, 0.31, 1.8, 1.0), '0.20 to 1.80')])
def test_a_share_that_is_the_same_on_all_joints_is_told_once(found, told, monkeypatch):
    monkeypatch.setattr('par4_identification.diagnosis.search.belief.fixed_sizes',
                        lambda *_: np.array([found]))
    search = search_of(library=('presliding',))
    reason = search.belief.objection(cause('presliding', distance=5e-3), ())
    assert reason == f'its torque comes out at {told} of what it must be'


def bound(stiffness):
    """Return the torque of a hose that turns the platform back to theta = 0, N m/rad."""

    def torque(state):
        moment = np.zeros_like(state.platform.x)
        moment[:, 3] = stiffness * state.platform.x[:, 3]
        return -state.torque_of_force(moment)

    return torque


@pytest.mark.parametrize(('stiffness', 'gives_away'), [(0.01, True), (0.3, False)])
def test_a_wide_function_takes_the_place_of_laws_only_for_what_its_numbers_are_worth(
        stiffness, gives_away):
    """A force that follows place and speed has the laws of theta and of drag in it."""
    laws = (('theta_friction', {'coulomb': 0.45, 'viscous': 0.03}),
            ('platform_drag', {'viscous': 1.0, 'quadratic': 0.5}))
    search = search_of(*laws, beside=bound(stiffness), library=[name for name, _ in laws])
    search.run()  # scales the kinds of unnamed causes
    wrench, = (Hypothesis(kind, {}, EVERY) for kind in search._kinds if kind.name == 'wrench')
    named = tuple(cause(name) for name, _ in laws)
    assert search._gives_names_away((wrench,), named) == gives_away
