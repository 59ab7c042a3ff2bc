"""Values of causes: what of a shared effect acts, shapes off the grid, how sure they are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from measured import excitation
from planned import evidence_of, state_of_motion
from searches import EVERY, MODEL, OFFSET, cause, log_with, names, search_of

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.geometry_error import DIMENSIONS
from par4_dynamics.effects.stribeck import SPEEDS
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.doubt import (
    with_doubt,
    with_doubt_of_choice,
    with_doubt_of_size,
)
from par4_identification.diagnosis.evidence.estimates import (
    LASTING,
    effect_parameters,
    estimated,
    told_values,
)
from par4_identification.diagnosis.evidence.fit import corrected, pinned, solve
from par4_identification.diagnosis.evidence.holdout import Gain
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.joints import choices, with_needed_joints
from par4_identification.diagnosis.search.polish import polished
from par4_identification.diagnosis.search.requirement import torque_errors
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.verdict.agreement import parameters_by, with_disagreement
from par4_identification.diagnosis.verdict.answer import Cause
from par4_identification.diagnosis.verdict.swinging_loads import with_doubt_of_counts
from par4_identification.diagnosis.verdict.weak_causes import weak_causes, widened
from robots import REFERENCE

ONE_ZERO = (0.0, 0.0, 0.004, 0.0)
BETWEEN = float(np.sqrt(SPEEDS[5] * SPEEDS[6]))
"""rad/s, between two Stribeck velocities of the grid."""


@dataclass(frozen=True)
class SimpleCause:
    """A cause of which only the parameters are asked."""

    parameters: dict[str, Parameter]


@pytest.mark.parametrize(('effect', 'values', 'joints', 'sets'), [
    ('encoder_offset', {'offset': ONE_ZERO}, (2,), (2,)),
    ('encoder_offset', {'offset': (0.004, 0.0, 0.0, -0.005)}, (0, 3), (0, 3)),
    ('encoder_eccentricity', {'amplitude': ONE_ZERO, 'phase': (0.0, 0.0, 0.7, 0.0)}, (2,), (2,)),
    ('leg_length_error', {'arm_length': ONE_ZERO, 'forearm_length': (0.0, 0.0, -0.003, 0.0)},
     (2,), (2,)),
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
    fit = solve(search.pool.evidence, (item,))
    measured, named = torque_errors(search.pool.evidence, fit, rules)
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
    wide = with_doubt_of_choice(plain, evidence, item, (item,), lambda fit: fit)
    value, std, doubted = (np.ravel(part)[0] for part in (
        plain[parameter].value, plain[parameter].std, wide[parameter].std))
    assert wide[parameter].value == plain[parameter].value
    assert abs(value - true) > 3.0 * std
    assert abs(value - true) < 2.0 * doubted


def test_a_cause_on_all_joints_is_in_no_doubt_of_choice():
    search = search_of(('torque_offset', {'offset': OFFSET}))
    item, evidence = cause('torque_offset'), search.pool.evidence
    plain = effect_parameters(evidence, item, solve(evidence, (item,)), 0)
    assert with_doubt_of_choice(plain, evidence, item, (item,), lambda fit: fit) == plain


def test_what_a_weak_cause_would_change_is_in_the_deviation():
    """An offset that gains too little for a name moves the asymmetry by far more than the noise.

    Nobody can say whether it acts; a sound machine has none, and then nothing is widened.
    """
    asymmetry = ('viscous_asymmetry', {'asymmetry': (0.5, -0.3, 0.4, 0.6)})
    item = cause('viscous_asymmetry')
    told = {}
    for size in (0.0025, 0.0):
        search = search_of(asymmetry, ('torque_offset', {'offset': (size, size, -size, size)}),
                           library=('viscous_asymmetry', 'torque_offset'))
        assert names(search.tested((item,))) == ['viscous_asymmetry']
        assert search.weighing.standing(cause('torque_offset'), (item,)) < 1.0
        evidence, weak = search.pool.evidence, weak_causes(search, (item,))
        plain = effect_parameters(evidence, item, solve(evidence, (item,)), 0)
        wide = widened(search, SimpleCause(plain), item, (item,), weak)
        told[size] = names(weak), plain['asymmetry'], wide.parameters['asymmetry']
    found, plain, wide = told[0.0025]
    assert found == ['torque_offset']
    assert wide.value == plain.value
    errors = np.abs(np.array(plain.value) - asymmetry[1]['asymmetry'])
    assert np.max(errors / plain.std) > 3.0
    assert np.max(errors / wide.std) < 2.0
    found, plain, wide = told[0.0]
    assert found == []
    assert wide == plain


def test_a_transmission_that_twists_on_some_joints_is_expanded_on_these_only():
    search = search_of(('elastic_transmission', {'stiffness': (0.0, 5e3, 0.0, 0.0)}),
                       library=('elastic_transmission',))
    effect = CATALOGUE['elastic_transmission']
    everywhere = effect.expansion(np.array((1e-6, 2e-4, 1e-6, 1e-6)))
    item = with_needed_joints(search.pool, search.belief, Hypothesis(effect, everywhere, EVERY), ())
    assert item.joints == (1,)
    assert item.shape == {'expanded_at_1': 2e-4}


def test_a_joint_that_no_machine_could_have_goes_if_it_is_worth_little():
    """A small error of a strong cause looks like one joint more, with an impossible value."""
    offset = (0.5, 0.0, 0.0045, 0.0)  # the third is worth little more than its price
    search = search_of(('torque_offset', {'offset': offset}), library=('torque_offset',))
    item, pool = Hypothesis(CATALOGUE['torque_offset'], {}, EVERY), search.pool

    def needed(impossible):
        belief = SimpleNamespace(rules=search.rules, objection=lambda item, _others: (
            'impossible' if impossible in item.joints else None))
        return with_needed_joints(pool, belief, item, ()).joints

    assert needed(3) == (0, 2)
    assert needed(2) == (0,)
    assert needed(0) == (0, 2)  # nothing else does nearly as well: that it is refused is said


def test_a_joint_that_no_machine_could_have_goes_if_the_error_of_the_cause_makes_it():
    """It is worth more than chance, and no more than what a strong cause may get wrong."""
    search = search_of(('torque_offset', {'offset': (0.5, 0.0, 0.009, 0.0)}),
                       library=('torque_offset',))
    item = Hypothesis(CATALOGUE['torque_offset'], {}, EVERY)

    def needed(rules):
        belief = SimpleNamespace(rules=rules, objection=lambda item, _others: (
            'impossible' if 2 in item.joints else None))
        return with_needed_joints(search.pool, belief, item, ()).joints

    assert needed(search.rules) == (0,)
    assert needed(replace(search.rules, named_error=0.0)) == (0, 2)


@pytest.mark.parametrize(('third', 'margin', 'true'), [
    (0.012, Rules.margin, (0,)), (0.015, Rules.margin, (0, 2)),
    (0.018, 1e3, (0,)), (0.021, 1e3, (0, 2))])
def test_a_strong_cause_is_not_lost_for_a_small_joint_that_no_machine_could_have(
        third, margin, true):
    """The joint is worth more than its price, however doubtful, but an error may gain as much.

    Held-out rows bound what is given up for it; where they would allow anything the error does.
    """
    search = search_of(('torque_offset', {'offset': (0.5, 0.0, third, 0.0)}),
                       library=('torque_offset',))
    belief = SimpleNamespace(
        rules=replace(search.rules, margin=margin),
        objection=lambda item, _others: 'impossible' if 2 in item.joints else None)
    item = Hypothesis(CATALOGUE['torque_offset'], {}, EVERY)
    assert with_needed_joints(search.pool, belief, item, ()).joints == true


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


def test_an_effect_that_comes_out_at_another_size_is_as_doubtful_as_that():
    """The bristles that the machine has bend under less torque than its Coulomb friction."""
    search = search_of(('presliding', {'distance': 0.01}), library=('presliding',))
    item, evidence = cause('presliding', distance=0.01), search.pool.evidence
    fit = solve(evidence, (item,))
    plain = effect_parameters(evidence, item, fit, 0)
    sure = with_doubt_of_size(plain, evidence, item, fit)['distance'].std
    assert sure < 1.2 * plain['distance'].std
    smaller = replace(fit, coefficients=(0.9 * fit.coefficients[0],))
    told = with_doubt_of_size(plain, evidence, item, smaller)['distance']
    assert told.std == pytest.approx(0.1 * plain['distance'].value, rel=0.1)


def of(**values):
    return {name: Parameter(value=value, std=std, unit='1')
            for name, (value, std) in values.items()}


def test_deviations_grow_by_what_two_estimates_disagree():
    one = of(torque=((1.0, 2.0), (0.3, 0.4)), phase=(3.1, 0.3))
    other = of(torque=((1.0 + 4.0 * 0.5, 2.0 - 4.0 * 0.5), (0.4, 0.3)),
               phase=(3.1 - 2.0 * np.pi + 4.0 * 0.5, 0.4))  # each by four deviations
    told = with_disagreement(one, one, other)
    np.testing.assert_allclose(told['torque'].std, 4.0 * np.array((0.3, 0.4)))
    assert told['phase'].std == pytest.approx(4.0 * 0.3)
    assert with_disagreement(one, one, one) == one
    fixed = of(exponent=(2.0, 0.0))
    assert with_disagreement(fixed, fixed, of(exponent=(3.0, 0.0))) == fixed


def test_other_rows_give_a_shape_of_their_own():
    true = {'amplitude': 0.3, 'periods': 31.0, 'phase': (0.0, 1.0, 2.0, 3.0)}
    shape = {'stribeck_velocity': 0.2}
    search = search_of(('stribeck', {'stribeck_torque': 1.0, **shape}), ('cogging', true),
                       library=('stribeck',))
    evidence = search.pool.heldout
    model = (cause('cogging', periods=31.0), cause('stribeck', stribeck_velocity=0.23))
    told = parameters_by(evidence, model, 1)['stribeck_velocity']
    np.testing.assert_allclose(told.value, 0.2, rtol=0.03)
    amplitude = parameters_by(evidence, model, 0)['amplitude'].value
    np.testing.assert_allclose(amplitude, 0.3, rtol=0.1)


def test_the_square_of_a_speed_is_no_other_law_on_other_rows():
    """With any other exponent its size is another parameter, and the two would never agree."""
    true = 0.39
    search = search_of(('nonlinear_viscous', {'torque': (true, 0.0, 0.0, 0.0), 'exponent': 2.05}))
    item = cause('nonlinear_viscous', joints=(0,), exponent=2.0)
    one, other = (parameters_by(part, (item,), 0)
                  for part in (search.pool.evidence, search.pool.heldout))
    assert other['exponent'].value == (2.0,)
    told = with_disagreement(one, one, other)['quadratic']
    assert abs(told.value[0] - true) < 0.1 * true
    assert told.std[0] < 0.1 * true
    wrong = replace(item, shape={'exponent': 1.9})
    assert 2.0 < parameters_by(search.pool.heldout, (wrong,), 0)['exponent'].value[0] < 2.1


def test_a_law_that_one_motion_shows_otherwise_is_as_doubtful_as_that():
    """Cogging of another size on the rows held out: the deviation holds both."""
    small, large = ({'amplitude': size, 'periods': 31.0, 'phase': 0.0} for size in (0.30, 0.33))
    evidence, heldout = (
        evidence_of(log_with(('cogging', values), seed=seed), REFERENCE, MODEL)
        for values, seed in ((small, 1), (large, 2)))
    item = cause('cogging', periods=31.0)
    one, other = (parameters_by(part, (item,), 0) for part in (evidence, heldout))
    told = with_disagreement(one, one, other)
    assert np.all(np.array(one['amplitude'].std) < 0.005)
    assert np.all(np.array(told['amplitude'].std) > 0.01)


def test_a_transmission_is_told_by_the_compliances_at_which_it_was_fitted():
    """Columns that are slopes are exact there only; what is beside them is fitted to the rest."""
    search = search_of(('elastic_transmission', {'stiffness': (0.0, 5e3, 0.0, 0.0)}),
                       ('torque_offset', {'offset': OFFSET}))
    evidence, effect = search.pool.evidence, CATALOGUE['elastic_transmission']
    shape = effect.expansion(np.array((0.0, 2.3e-4, 0.0, 0.0)))  # not the best one
    item = replace(cause('elastic_transmission', joints=(1,), **shape), sets=(1,))
    free = solve(evidence, (item, cause('torque_offset')))
    assert abs(free.coefficients[0][1, 0] - 2.3e-4) > 1e-5
    fit = pinned(evidence, free)
    assert fit.coefficients[0][1, 0] == pytest.approx(2.3e-4)
    state = evidence.observations.runs[0].state
    told = effect_parameters(evidence, item, fit, 0)
    torque = effect.torque(state, arrays_of(told, 4, (1,)), (1,))
    np.testing.assert_allclose(torque, np.einsum(
        'njk,k->nj', effect.columns(state, shape), fit.coefficients[0][:, 0]), atol=1e-9)
    rest = replace(evidence, target=evidence.target - evidence.columns(item)[:, 0] * 2.3e-4)
    beside = solve(rest, (cause('torque_offset'),))
    np.testing.assert_allclose(fit.base, beside.base, rtol=1e-6)
    np.testing.assert_allclose(fit.coefficients[1], beside.coefficients[0], rtol=1e-6)


def arrays_of(parameters, joints, acting):
    """Return values as effects take them, zero on joints that do not act."""
    values = {}
    for name, parameter in parameters.items():
        values[name] = np.zeros(joints)
        values[name][list(acting) if np.ndim(parameter.value) else slice(None)] = parameter.value
    return values


def test_a_cause_is_zero_where_each_of_its_sizes_is_within_its_deviations():
    """A size that a law does not have is zero without a deviation; shapes are no sizes."""
    told = Cause(CATALOGUE['stribeck'], (0, 1), {
        'stribeck_torque': Parameter(value=(-1.5, 0.0), std=(1.0, 0.0)),
        'stribeck_velocity': Parameter(value=(0.3, 0.3), std=(0.1, 0.1)),
        'exponent': Parameter(value=(1.6, 1.6), std=(0.1, 0.1))},
        (), 1.0, 0.0, 1.0, None, Gain(1.0, 0.5, 1.5))
    assert not told.is_zero_within(1.0)
    assert told.is_zero_within(2.0)


@pytest.mark.parametrize(('largest', 'joints', 'told'), [
    (1.9, 1, True), (2.1, 1, False), (2.1, 2, True), (2.4, 4, True), (2.6, 4, False)])
def test_of_many_sizes_that_are_zero_one_may_be_farther_off(largest, joints, told):
    """The largest of so many is within as often as one alone is within two deviations."""
    values = (largest, *(0.5,) * (joints - 1))
    found = Cause(CATALOGUE['torque_offset'], tuple(range(joints)), {
        'offset': Parameter(value=values, std=(1.0,) * joints)}, (), 1.0, 0.0, 1.0, None,
        Gain(1.0, 0.5, 1.5))
    assert found.may_be_zero == told


@pytest.mark.parametrize('name', sorted(CATALOGUE))
def test_a_cause_all_of_whose_sizes_are_zero_is_nothing_whatever_its_other_values(name):
    """A phase, an exponent, a range and an anchor may be anything then."""
    effect = CATALOGUE[name]
    sizes = {own.name for own in effect.parameters if own.is_size or own.vanishing}
    told = {own.name: Parameter(value=(0.01 if own.name in sizes else 2.5,) * own.size,
                                std=(0.05,) * own.size) for own in effect.parameters}
    cause = Cause(effect, (0,), told, (), 1.0, 0.0, 1.0, None, Gain(1.0, 0.5, 1.5))
    assert cause.is_nothing == bool(sizes)


def test_friction_that_builds_up_over_no_distance_is_that_of_the_direction():
    """So that a distance of less than its deviation, a tenth of a count, is no cause."""
    presliding, motion = CATALOGUE['presliding'], excitation('reference', 8.0, 5)
    state = state_of_motion(REFERENCE, motion)
    state = state.with_nominal(MODEL.nominal(state))
    least, more = (np.mean(np.abs(presliding.columns(state, {'distance': distance})))
                   for distance in (1e-9, 5e-3))
    assert least < 0.05 * more
    short, long = (Cause(presliding, (0, 1, 2, 3), {'distance': Parameter(
        value=value, std=9.6e-5)}, (), 1.0, 0.0, 1.0, None, Gain(1.0, 0.5, 1.5))
        for value in (8.3e-5, 4e-4))
    assert short.is_nothing
    assert not long.may_be_zero


@pytest.mark.parametrize(('name', 'size', 'idle'), [
    ('encoder_offset', 'offset', (2,)), ('backlash', 'gap', ())])
def test_only_a_name_that_may_act_on_some_joints_has_idle_ones(name, size, idle):
    """Gaps of all joints are one cause: no joint can be taken out of it."""
    parameter = Parameter(value=(1.0, -2.0, 0.1, 3.0), std=(0.1, 0.1, 0.2, 0.1), unit='rad')
    told = Cause(CATALOGUE[name], (0, 1, 2, 3), {size: parameter}, (), 1.0, 0.0, 1.0, None,
                 Gain(1.0, 0.5, 1.5))
    assert told.idle_joints == idle


def swinging(damping_ratio):
    effect, compliance = CATALOGUE['elastic_transmission'], np.array((0.0, 2e-4, 0.0, 0.0))
    return Hypothesis(effect, effect.expansion(compliance, {'damping_ratio': damping_ratio}), (1,),
                      (1,))


@pytest.fixture(scope='module')
def soft():
    """Return a search on a machine with a soft joint."""
    return search_of(('elastic_transmission', {'stiffness': (0.0, 5e3, 0.0, 0.0)}),
                     library=('elastic_transmission',))


def test_half_of_what_counts_made_of_a_damping_is_its_deviation(soft):
    before, told = swinging(0.1), swinging(0.04)
    fit = soft.weighing.corrected(soft.pool.solution((told,)))
    values = {name: item.model_copy(update={'std': 0.0 * np.asarray(item.value)})
              for name, item in told_values(soft.pool.evidence, told, fit, 0).items()}
    wide, = with_doubt_of_counts(soft, [SimpleCause(values)], (told,), [(before, told)])
    assert wide.parameters['damping_ratio'].std == pytest.approx(0.03)
    assert np.max(wide.parameters['stiffness'].std) < 1e-6


def test_what_counts_do_to_columns_moves_no_compliance(soft, monkeypatch):
    """Their columns are exact at their own values only; other values take what is corrected."""
    told, other = swinging(0.05), cause('torque_offset', joints=(0,))
    monkeypatch.setattr(soft.weighing, '_counts', SimpleNamespace(
        corrected=lambda evidence, fit: corrected(evidence, fit, np.full(
            len(fit.covariance), 1e4))))
    fit = soft.pool.solution((told, other))
    moved = soft.weighing.corrected(fit)
    assert moved.coefficients[0][1, 1] == pytest.approx(2e-4, rel=1e-6)
    assert abs(moved.coefficients[1][0, 0] - fit.coefficients[1][0, 0]) > 1e-3
