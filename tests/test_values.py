"""Values of causes: what of a shared effect acts, shapes off the grid, how sure they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from searches import EVERY, OFFSET, cause, search_of

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.geometry_error import DIMENSIONS
from par4_dynamics.effects.stribeck import SPEEDS
from par4_identification.diagnosis.evidence.doubt import with_doubt, with_doubt_of_choice
from par4_identification.diagnosis.evidence.estimates import (
    LASTING,
    effect_parameters,
    estimated,
)
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.joints import choices
from par4_identification.diagnosis.search.polish import polished
from par4_identification.diagnosis.search.requirement import torque_errors
from par4_identification.diagnosis.search.rules import Rules

ONE_ZERO = (0.0, 0.0, 0.004, 0.0)
BETWEEN = float(np.sqrt(SPEEDS[5] * SPEEDS[6]))
"""rad/s, between two Stribeck velocities of the grid."""


@pytest.mark.parametrize(('effect', 'values', 'joints', 'sets'), [
    ('encoder_offset', {'offset': ONE_ZERO}, (2,), (2,)),
    ('encoder_offset', {'offset': (0.004, 0.0, 0.0, -0.005)}, (0, 3), (0, 3)),
    ('encoder_eccentricity', {'amplitude': ONE_ZERO, 'phase': (0.0, 0.0, 0.7, 0.0)}, (2,), (2,)),
    ('geometry_error', {**dict.fromkeys(DIMENSIONS, 0.0), 'forearm_length': 0.004}, EVERY, (1,))])
def test_of_a_shared_effect_only_what_is_wrong_is_told(effect, values, joints, sets):
    """One encoder that is wrong changes the torque of all joints, and so does one dimension."""
    search = search_of((effect, values), library=(effect,))
    found, = search.run()
    assert (found.joints, found.sets) == (joints, sets)
    parameters = effect_parameters(search.pool.evidence, found, solve(
        search.pool.evidence, (found,)), 0)
    for name, value in values.items():
        told, true = np.ravel(parameters[name].value), np.ravel(value)
        assert len(told) in (1, len(joints))
        np.testing.assert_allclose(told, true[list(joints)] if len(true) > 1 else true,
                                   rtol=0.1, atol=1e-9)


def test_rods_are_told_without_bars_and_bars_never_without_rods():
    rods = ('distributed_rods', {'rod_mass': 0.05, 'bar_mass': 0.0})
    search = search_of(rods, library=('distributed_rods',))
    found, = search.run()
    assert found.columns == [0]
    tried = {tuple(item.columns) for item in choices(cause('distributed_rods'), EVERY)}
    assert tried == {(0,), (0, 1)}


def test_a_shape_is_told_off_the_grid_on_which_it_was_sought():
    values = {'stribeck_torque': 0.8, 'stribeck_velocity': BETWEEN}
    search = search_of(('stribeck', values), library=('stribeck',))
    found, = search.run()
    there, = polished(search, (found,))
    assert there.shape['stribeck_velocity'] == pytest.approx(BETWEEN, rel=0.02)
    assert search.pool.fit((there,)).fit_squares < search.pool.fit((found,)).fit_squares


def test_a_shape_that_has_its_usual_value_keeps_it():
    search = search_of(('nonlinear_viscous', {
        'quadratic': 0.02, 'torque': 0.0, 'exponent': 2.0}), library=('nonlinear_viscous',))
    square = cause('nonlinear_viscous', exponent=2.0)
    assert polished(search, (square,)) == (square,)
    near = cause('nonlinear_viscous', exponent=2.2)
    moved, = polished(search, (near,))
    assert moved.shape['exponent'] == pytest.approx(2.0, abs=0.1)


def test_an_order_of_a_periodic_torque_stays_a_whole_number():
    search = search_of(('cogging', {'amplitude': 0.3, 'periods': 31.0, 'phase': 0.4}),
                       library=('cogging',))
    found, = search.run()
    assert polished(search, (found,)) == (found,)


def test_deviations_without_model_error_are_those_of_least_squares():
    search = search_of(('torque_offset', {'offset': OFFSET}))
    evidence, item = search.pool.evidence, cause('torque_offset')
    fit = solve(evidence, (item,))
    _, std = estimated(evidence, item, fit, 0)
    np.testing.assert_allclose(
        std['offset'], np.sqrt(np.diag(fit.covariance)[fit.slices[0]]), rtol=1e-6)


def test_a_torque_error_widens_as_far_as_it_would_move_the_value():
    """An error that is the cause's own torque in every stretch moves the value by that share.

    The stretches are independent: the variance is that of their sum.
    """
    search = search_of(('torque_offset', {'offset': OFFSET}))
    evidence, item, share = search.pool.evidence, cause('torque_offset', (1,)), 0.1
    fit = solve(evidence, (item,))
    column = evidence.columns(item)[:, 0]
    error = share * column * fit.coefficients[0][0, 1]
    plain, widened = (float(estimated(evidence, item, fit, 0, errors=errors)[1]['offset'][0])
                      for errors in ((), (error,)))
    added = np.sqrt(widened ** 2 - plain ** 2)
    whole = share * abs(fit.coefficients[0][0, 1])
    seconds = sum(run.t[-1] - run.t[0] for run in evidence.observations.runs)
    # base terms take some of it, stretches of rest have none
    assert 0.3 * whole / np.sqrt(seconds / LASTING) < added < 3.0 * whole


def test_a_model_may_be_wrong_of_each_torque_that_it_has():
    search = search_of(('torque_offset', {'offset': OFFSET}))
    item, rules = cause('torque_offset'), Rules()
    measured, named = torque_errors(search.pool, (item,), (), rules)
    fit = solve(search.pool.evidence, (item,))
    np.testing.assert_allclose(named, rules.named_error * (
        search.pool.evidence.columns(item) @ item.stacked(fit.coefficients[0])), rtol=1e-5)
    assert measured @ measured == pytest.approx(
        rules.base_error ** 2 * search.pool.torque_squares[0])


def test_what_another_fit_says_of_a_cause_is_in_its_deviation():
    search = search_of(('cogging', {'amplitude': 0.3, 'periods': 31.0, 'phase': 3.1}),
                       library=('cogging',))
    item = cause('cogging', periods=31.0)
    evidence = search.pool.evidence
    one = effect_parameters(evidence, item, solve(evidence, (item,)), 0)
    turned = {**one, 'amplitude': one['amplitude'].model_copy(update={
        'value': tuple(value + 0.03 for value in one['amplitude'].value)}),
        'phase': one['phase'].model_copy(update={  # the same phase, a turn further
            'value': tuple(value - 2.0 * np.pi for value in one['phase'].value)})}
    both = with_doubt(one, turned)
    assert np.all(np.array(both['amplitude'].std) > 0.03)
    np.testing.assert_allclose(both['phase'].std, one['phase'].std, rtol=1e-6)


@pytest.mark.parametrize(('effect', 'parameter', 'true', 'told', 'joints', 'sets'), [
    ('geometry_error', 'base_radius', 0.0, {'base_radius': 0.004}, EVERY, (3,)),
    ('joint_friction_difference', 'coulomb', 0.25, {'coulomb': (0.3, 0.0, 0.0, 0.15)}, (0,), None)])
def test_what_fewest_parts_leave_unsaid_is_in_the_deviation(effect, parameter, true, told, joints,
                                                            sets):
    """The platform's radius is told as that of the base; one joint of two that differ is named.

    What is told is off by far more than the noise says. Without the assumption that the other
    parts are right the data say so. Of the friction the other joints' mean is the measure.
    """
    search = search_of((effect, told))
    evidence = search.pool.evidence
    item = replace(cause(effect, joints), sets=sets and (2,))
    plain = effect_parameters(evidence, item, solve(evidence, (item,)), 0)
    wide = with_doubt_of_choice(plain, evidence, item, (item,))
    value, std, doubted = (np.ravel(part)[0] for part in (
        plain[parameter].value, plain[parameter].std, wide[parameter].std))
    assert wide[parameter].value == plain[parameter].value
    assert abs(value - true) > 3.0 * std
    assert abs(value - true) < 2.0 * doubted


def test_a_cause_on_all_joints_is_in_no_doubt_of_choice():
    search = search_of(('torque_offset', {'offset': OFFSET}))
    item, evidence = cause('torque_offset'), search.pool.evidence
    plain = effect_parameters(evidence, item, solve(evidence, (item,)), 0)
    assert with_doubt_of_choice(plain, evidence, item, (item,)) == plain


def test_a_transmission_that_twists_on_some_joints_is_expanded_on_these_only():
    effect = CATALOGUE['elastic_transmission']
    shape = effect.expansion(np.array((1e-4, 2e-4, 3e-4, 4e-4)))
    for item in choices(Hypothesis(effect, shape, EVERY), EVERY):
        assert item.shape == {f'expanded_at_{joint}': shape[f'expanded_at_{joint}']
                              for joint in item.joints}


@pytest.mark.parametrize(('apart', 'told_as'), [(0.009, 'quadratic'), (0.011, 'torque')])
def test_an_exponent_that_is_nearly_two_is_told_as_two(apart, told_as):
    search = search_of(('nonlinear_viscous', {
        'quadratic': 0.02, 'torque': 0.0, 'exponent': 2.0}), library=('nonlinear_viscous',))
    item, evidence = cause('nonlinear_viscous', exponent=2.0 + apart), search.pool.evidence
    told = effect_parameters(evidence, item, solve(evidence, (item,)), 0)
    other, = {'quadratic', 'torque'} - {told_as}
    assert np.all(np.array(told[told_as].value) > 0.0)
    assert not np.any(told[other].value)
    assert np.all(np.isfinite(told['exponent'].std))
    assert np.all((np.array(told['exponent'].value) == 2.0) == (told_as == 'quadratic'))


def test_the_effects_that_have_separable_sets_have_them_of_their_columns():
    for effect in CATALOGUE.values():
        assert not effect.separable or effect.shared, effect.name


def test_of_names_that_explain_alike_the_one_with_fewer_numbers_is_taken():
    """An eccentricity has two numbers where a zero has one, and can imitate it."""
    search = search_of(('encoder_offset', {'offset': (0.004, 0.0, 0.0, -0.005)}),
                       library=('encoder_eccentricity', 'encoder_offset'))
    found, = search.run()
    assert found.effect.name == 'encoder_offset'
    swapped = search._with_a_swap((cause('encoder_eccentricity', (0, 3)),), set())
    assert swapped is not None
    assert [item.effect.name for item in swapped] == ['encoder_offset']
