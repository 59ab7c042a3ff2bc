"""Which names hold beside causes that have none, and with which values they are told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planned import evidence_of
from searches import EVERY, MODEL, cause, log_with, names, search_of, search_on

from par4_identification.diagnosis.evidence.fit import left_by, residuals, solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.search.causes import named_of, unnamed_of
from par4_identification.diagnosis.search.requirement import torque_errors
from par4_identification.diagnosis.search.search import Rival
from par4_identification.diagnosis.verdict import settled, sure
from par4_identification.diagnosis.verdict.judgement import judge, share_of
from par4_identification.diagnosis.verdict.settled import settle
from robots import REFERENCE, model_with

FLOOR = np.full(4, 0.05)
LEG = {'arm_length': (0.0, 0.0, 0.0, 0.0), 'forearm_length': (0.0, 0.0, -0.0013, 0.0)}


def springs_that_yield(*sizes):
    """Return friction, N m, that builds up over 0.1 rad of a joint, as no effect does."""
    def torque(state):
        share = np.zeros_like(state.q)
        for row, step in enumerate(np.diff(state.q, axis=0) / 0.1, start=1):
            share[row] = (share[row - 1] + step) / (1.0 + np.abs(step))
        return np.array(sizes) * share

    return torque


@pytest.fixture(scope='module', params=[
    ('leg_length_error', LEG, 'forearm_length', (2,), (0.3, 0.0, 0.4, 0.0)),
    ('leg_length_error', LEG, 'forearm_length', (2,), (1.2, 0.0, 1.0, 0.9)),
    ('torque_offset', {'offset': (0.1, 0.0, 0.0, 0.0)}, 'offset', (0,), (0.3, 0.0, 0.4, 0.0))])
def beside_unnamed(request):
    """A name, its true value, a search beside friction that has no name, and what it found."""
    name, values, size, joints, friction = request.param
    search = search_of((name, values), library=(name,), beside=springs_that_yield(*friction))
    return name, joints, [values[size][joint] for joint in joints], size, search, settle(
        search, search.run(), FLOOR)


def test_a_name_holds_though_an_unnamed_cause_disturbs_what_it_is_without_it(beside_unnamed):
    name, joints, *_, found = beside_unnamed
    assert set(names(found.model)) == {name, 'memory'}
    told, = found.causes
    assert (told.effect.name, told.joints) == (name, joints)


def test_such_a_name_has_the_value_that_it_has_beside_the_unnamed_cause(beside_unnamed):
    _, _, true, size, _, found = beside_unnamed
    value = found.causes[0].parameters[size]
    np.testing.assert_allclose(value.value, true, rtol=0.3)
    assert np.all(np.abs(np.array(value.value) - true) < 2.0 * np.array(value.std))


RIPPLE = {'relative': (0.05, 0.03, 0.07, 0.02), 'periods': 24.0, 'phase': (0.2, 1.5, -0.7, 2.2)}


def late(state):
    """Return by how much the commands of drives lead, N m, of which joint 3 lags the most."""
    rate = np.gradient(MODEL.torque(state), state.t, axis=0)
    return rate * np.array((1.6e-3, 1.6e-3, 1.6e-3, 2.4e-3))


def lag_beside(search, *others):
    """Return the time constant that is told of a lag by a fit of the names, with some doubts."""
    named, model = (cause('torque_ripple', periods=24.0), cause('actuator_lag')), []
    model = (*named, *others)
    errors = [torque_errors(part, search.pool.solution(model), search.rules)
              for part in (search.pool.evidence, search.pool.heldout)]
    return settled._parameters(search, named[1], search.pool.solution(named), model, errors)[
        'time_constant']


def test_the_rate_of_the_torque_beside_it_puts_no_lag_in_doubt():
    """That has each joint's own lag in it, and leaves the one of all joints next to nothing."""
    rippled = model_with(MODEL, 'torque_ripple', **RIPPLE)
    search = search_on(*(evidence_of(log_with(
        ('torque_ripple', RIPPLE), seed=seed, duration=duration, beside=late), REFERENCE, rippled)
        for seed, duration in ((1, 12.0), (2, 8.0))), ('actuator_lag',))
    observations = search.pool.evidence.observations
    kinds = {kind.name: Hypothesis(kind, {}, EVERY)
             for kind in Kinds(observations).beside(observations, residuals(
                 observations, (), search.pool.solution(())))}
    alone, beside_rate = lag_beside(search), lag_beside(search, kinds['rate'])
    assert 1.6e-3 < alone.value < 2.4e-3
    assert beside_rate.value == alone.value
    assert beside_rate.std < 0.1 * alone.value


def test_a_name_with_values_below_zero_on_every_joint_falls(monkeypatch):
    """The search lets values pass that are below it by less than three deviations each."""
    search = search_of(('load_dependent_friction', {'coefficient': (-5e-4,) * 4}),
                       library=('load_dependent_friction',))
    item = cause('load_dependent_friction')
    monkeypatch.setattr(settled, 'without_replaceable_names', lambda _, model: model)
    assert settle(search, (item,), FLOOR).causes == ()
    monkeypatch.setattr(type(search.belief), 'is_on_wrong_side', lambda *_: False)
    assert len(settle(search, (item,), FLOOR).causes) == 1


def test_names_that_are_left_are_judged_together_again(monkeypatch):
    """The last of some names, whose company fell, may make the error on held-out rows larger."""
    search = search_of(('torque_offset', {'offset': (0.1, 0.0, 0.0, 0.0)}),
                       library=('torque_offset', 'stribeck'))
    model = cause('torque_offset'), cause('stribeck')
    monkeypatch.setattr(sure, '_without', lambda _search, model, *_doubts: (
        model[:1] if len(model) > 1 else model))
    monkeypatch.setattr(sure, '_doubt_of_all', lambda _search, model, _floor: (
        'no smaller' if len(model) == 1 else None))
    found = sure.without_doubtful_names(search, model, FLOOR)
    assert named_of(found) == []
    assert 'no smaller' in [item.reason for item in search.journal.rejected]


@pytest.mark.parametrize(('margin', 'wide', 'holds'), [
    (-11.0, 3.0, False), (-9.0, 3.0, True), (-11.0, 0.9, True)])
def test_a_name_told_as_nothing_falls_where_its_twin_explains_more(
        margin, wide, holds, monkeypatch):
    """On which joints it acts, and what else does, may leave nothing of its size."""
    search = search_of(('torque_offset', {'offset': (0.1, 0.0, 0.0, 0.0)}),
                       library=('torque_offset',))
    twin = 'external_force'
    monkeypatch.setattr(settled, 'judge', lambda *of: replace(
        judge(*of), margin=margin, rival=twin, twins=(twin,)))

    def widely(_, own, *__):
        offset = own.parameters['offset']
        return replace(own, parameters={'offset': offset.model_copy(
            update={'std': [wide * abs(value) for value in offset.value]})})

    monkeypatch.setattr(settled, 'widened', widely)
    told = settle(search, search.run(), FLOOR).causes
    assert [own.effect.name for own in told] == (['torque_offset'] if holds else [])


@pytest.mark.parametrize(('margin', 'wide', 'beside', 'holds'), [
    (-1.0, 0.7, 1.0, True),  # how large it is depends on a weak cause, not whether it is one
    (-1.0, 0.7, 0.001, False), (1.0, 0.7, 0.001, True),
    (7.0, 3.0, 1.0, False), (9.0, 3.0, 1.0, True)])  # it is told as nothing
def test_a_name_that_may_be_zero_beside_a_weak_cause_falls_if_that_leaves_it_nothing(
        margin, wide, beside, holds, monkeypatch):
    search = search_of(('torque_offset', {'offset': (0.1, 0.0, 0.0, 0.0)}),
                       library=('torque_offset',))
    weak, gains = cause('external_force'), search.weighing.gains
    monkeypatch.setattr(settled, 'weak_causes', lambda *_: [weak])
    monkeypatch.setattr(settled, 'judge', lambda *of: replace(
        judge(*of), margin=margin, rival='an unnamed function', twins=()))
    monkeypatch.setattr(search.weighing, 'gains', lambda item, others: tuple(
        (beside if weak in others else 1.0) * gain for gain in gains(item, others)))

    def widely(_, own, __, ___, some):
        offset = own.parameters['offset']
        return own if not some else replace(own, parameters={'offset': offset.model_copy(
            update={'std': [wide * abs(value) for value in offset.value]})})

    monkeypatch.setattr(settled, 'widened', widely)
    told = settle(search, search.run(), FLOOR).causes
    assert [own.effect.name for own in told] == (['torque_offset'] if holds else [])


def offset_beside_friction():
    """Return a search that found an offset beside friction that has no name, and what it found."""
    search = search_of(('torque_offset', {'offset': (0.1, 0.0, 0.0, 0.0)}),
                       library=('torque_offset',), beside=springs_that_yield(0.3, 0.0, 0.4, 0.0))
    model = search.run()
    assert set(names(model)) == {'torque_offset', 'memory'}
    return search, model


@pytest.mark.parametrize(('margin', 'holds'), [(0.0, True), (-1.5, False)])
def test_a_name_that_another_far_outdoes_is_told_as_it_is_without_the_unnamed_cause(
        margin, holds, monkeypatch):
    search, model = offset_beside_friction()
    others = tuple(unnamed_of(model))
    _, gain = search.weighing.gains(named_of(model)[0], others)
    monkeypatch.setattr(settled, 'judge', lambda *of: replace(judge(*of), margin=margin * gain))
    assert ('torque_offset' in names(settle(search, model, FLOOR).model)) is holds


@pytest.mark.parametrize(('more', 'holds'), [(1.0, True), (3.0, False), (0.1, False)])
def test_so_is_one_that_explains_much_less_or_much_more_beside_one(more, holds, monkeypatch):
    search, model = offset_beside_friction()
    gains = search.weighing.gains

    def alone_more(item, others):
        fit, heldout = gains(item, others)
        return (fit if unnamed_of(others) else more * fit), heldout

    monkeypatch.setattr(search.weighing, 'gains', alone_more)
    assert ('torque_offset' in names(settle(search, model, FLOOR).model)) is holds


@pytest.mark.parametrize(('share', 'twins'), [(0.1, ()), (0.9, ('base_tilt',))])
def test_twins_of_a_name_that_an_unnamed_cause_has_taken_are_twins_without_it_too(
        share, twins, monkeypatch):
    """Beside a force that has the whole law of a friction any name does as well as the friction."""
    search, model = offset_beside_friction()
    name, = named_of(model)
    alone = search.weighing.gains(name, ())
    monkeypatch.setattr(search.weighing, 'gains', lambda _, others: (
        share * alone[0] if unnamed_of(others) else alone[0], alone[1]))
    sizes = {'base_tilt': (1.0, 500.0), 'cable_spring': (500.0, 1.0)}  # beside it, without it
    monkeypatch.setattr(search, 'rivals', lambda _, others: [
        Rival(cause(name), beside, beside, True) if unnamed_of(others) else
        Rival(cause(name), without, without, True) for name, (beside, without) in sizes.items()])
    told = judge(search, name, model)
    assert told.twins == twins
    assert told.margin == 1.0


def test_the_model_with_told_values_has_the_best_base_parameters_beside_them(beside_unnamed):
    """What it leaves is what no change of a base parameter makes smaller."""
    *_, search, found = beside_unnamed
    evidence, (item,), told = search.pool.evidence, found.named, found.told
    model = search.weighing.corrected(solve(evidence, found.model))
    own = model.coefficients[found.model.index(item)]
    np.testing.assert_array_equal(told.coefficients[0], own)
    assert np.abs(solve(evidence, (item,)).coefficients[0] - own).max() > 1e-5
    left = left_by(evidence, found.named, told)
    slopes = evidence.base.T @ left
    size = np.linalg.norm(evidence.base, axis=0) * np.linalg.norm(left)
    assert np.max(np.abs(slopes) / size) < 1e-6


@pytest.mark.parametrize(('own', 'explained', 'share'), [
    (3.0, 4.0, 0.75), (3.0, 2.0, 1.0), (-3.0, 2.0, 0.0), (3.0, 0.0, 0.0), (3.0, -2.0, 0.0)])
def test_a_share_of_what_is_explained_is_one_even_where_nothing_is(own, explained, share):
    assert share_of(own, explained) == share


def late_on_one_joint(state):
    """Return what a torque of joint 1 that is read 1.2 ms late has beyond the true one, N m."""
    torque, late = MODEL.torque(state), np.zeros_like(state.q)
    late[:, 1] = np.interp(state.t - 1.2e-3, state.t, torque[:, 1]) - torque[:, 1]
    return late


def test_a_name_falls_where_a_torque_at_another_time_explains_far_more():
    """Friction that differs has a part of it where the joint turns round."""
    search = search_of(library=('joint_friction_difference',), beside=late_on_one_joint)
    assert names(search.run()) == ['rate']
    friction = cause('joint_friction_difference', (1,))
    assert names(sure._replaced(search, friction, (friction,))) == ['rate']


def test_a_delay_is_not_held_against_the_rate_of_its_own_torque():
    search = search_of(('time_offset', {'delay': 2e-3}), library=('time_offset',))
    delay, = search.run()
    assert [kind for kind, _ in sure._nameless(search, delay, ())
            if kind.effect.name == 'rate'] == []
    assert [told.effect.name for told in settle(search, (delay,), FLOOR).causes] == ['time_offset']
