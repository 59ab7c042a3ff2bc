"""A cause of one size everywhere is told apart from what only resembles it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hidden.motions import draw_motion
from planned import evidence_of, log_of, state_of_motion
from scipy.signal import lfilter
from searches import BELT, COGGING, EVERY, LOADED, MODEL, cause, names, search_of, search_on

from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.search.causes import named_of, unnamed_of
from par4_identification.diagnosis.search.rules import OF_AXIS, OF_PAR4
from par4_identification.diagnosis.verdict import constancy, sure
from par4_identification.diagnosis.verdict.constancy import followed_by
from par4_identification.diagnosis.verdict.sure import without_replaceable_names
from robots import REFERENCE


def jumped(state):
    """Return the torque of a cable on joint 3 that jumps off its guide after 5 s."""
    torque = np.zeros_like(state.q)
    torque[state.t - state.t[0] > 5.0, 3] = -0.75
    return torque


def slack(state):
    """Return the torque of a hose that pulls the platform where it is not slack, at x > 0."""
    force = np.zeros_like(state.platform.x)
    force[:, 0] = -60.0 * np.maximum(state.platform.x[:, 0], 0.0)
    return -state.torque_of_force(force)


def sprung(state):
    """Return the torque of a spring along x that never slackens."""
    force = np.zeros_like(state.platform.x)
    force[:, 0] = -30.0 * (state.platform.x[:, 0] + 0.1)
    return -state.torque_of_force(force)


def test_a_cable_that_jumped_is_no_constant_torque():
    search = search_of(library=('torque_offset', 'coulomb_asymmetry'), beside=jumped)
    offset = cause('torque_offset', (3,))
    assert followed_by(search, offset, ()) == 'time'
    model = without_replaceable_names(search, (offset,))
    assert not named_of(model)
    assert 'time' in names(unnamed_of(model))
    assert any('changes with time' in item.reason for item in search.journal.rejected)


def test_what_is_no_constant_torque_is_something_else(monkeypatch):
    """No unnamed cause passes by itself, as where the noise of the rows wanders as much."""
    search = search_of(library=('torque_offset',), beside=jumped)
    search.run()
    monkeypatch.setattr(search, 'with_nameless', lambda model: model)
    monkeypatch.setattr(sure, '_replaced', lambda *_: None)
    left, = without_replaceable_names(search, (cause('torque_offset', (3,)),))
    assert unnamed_of((left,))


@pytest.mark.parametrize(('beside', 'what'), [
    (slack, 'the position of the platform along x'), (sprung, None)])
def test_a_spring_has_one_stiffness_in_all_of_the_workspace(beside, what):
    search = search_of(library=('cable_spring',), beside=beside)
    assert followed_by(search, cause('cable_spring'), ()) == what


def churned(state):
    """Return the torque of a slanted seal on joint 0, N m, whose grease thickens as it is churned.

    What it was churned by is forgotten within half a second.
    """
    kept = np.exp(-(state.t[1] - state.t[0]) / 0.5)
    stirred = lfilter([1.0 - kept], [1.0, -kept], np.abs(state.qd[:, 0]))
    torque = np.zeros_like(state.q)
    torque[:, 0] = 0.6 * (1.0 + 2.0 * stirred)
    return torque


def drifting(state):
    """Return the torque of an amplifier on joint 0 whose offset drifts all the time, N m."""
    torque = np.zeros_like(state.q)
    torque[:, 0] = 0.6 + 0.1 * (state.t - state.t[0])
    return torque


def slow_then_fast(seed, duration, beside):
    """Return evidence of a motion that begins slowly and ends fast."""
    motion = draw_motion('slow then fast', REFERENCE, duration, seed)
    state = state_of_motion(REFERENCE, motion)
    torque = MODEL.torque(state) + beside(state)
    return evidence_of(log_of(REFERENCE, motion.t, motion.q, torque, seed), REFERENCE, MODEL)


@pytest.mark.parametrize(('beside', 'what'), [
    (churned, None), (lambda state: 4.0 * jumped(state)[:, ::-1], 'time'), (drifting, 'time')])
def test_what_follows_how_lively_the_motion_is_does_not_follow_time(beside, what):
    search = search_on(slow_then_fast(31, 14.0, beside), slow_then_fast(32, 10.0, beside),
                       ('torque_offset',))
    assert followed_by(search, cause('torque_offset', (0,)), ()) == what


def attracted(state):
    """Return the torque (n, 4) against the pull of a magnet beside the workspace, N m."""
    away = np.array([0.4, 0.1, -0.9]) - state.platform.x[:, :3]
    pull = 0.02 * away / np.linalg.norm(away, axis=1)[:, None] ** 3
    return -state.torque_of_force(np.column_stack((pull, np.zeros(len(pull)))))


def test_a_strong_name_stays_beside_a_force_that_could_imitate_it():
    """What is left of its worth beside that force is little; beside other names it is all."""
    search = search_of(('theta_friction', BELT), beside=attracted, library=('theta_friction',))
    search.run()  # scales the kinds of unnamed causes
    theta = cause('theta_friction')
    wrench, = (Hypothesis(kind, {}, EVERY) for kind in search._kinds if kind.name == 'wrench')
    assert theta in without_replaceable_names(search, (theta, wrench))


def test_causes_of_one_size_are_told_whatever_is_unknown_beside_them():
    search = search_of(('cogging', COGGING), LOADED, beside=lambda state: 0.1 * slack(state),
                       library=('cogging', 'load_dependent_friction'))
    model = search.run()
    told = named_of(without_replaceable_names(search, model))
    assert set(names(told)) == {'cogging', 'load_dependent_friction'}
    assert unnamed_of(model)
    assert all(item.joints == EVERY for item in told)


@pytest.mark.parametrize(('name', 'share', 'of_par4', 'of_axis'), [
    ('stribeck', 0.04, None, None), ('stribeck', 0.09, 'speed', None),
    ('stribeck', 0.2, 'speed', 'speed'), ('cogging', 0.04, None, None),
    ('cogging', 0.06, 'speed', None), ('cogging', 0.09, 'speed', 'speed'),
    ('position_torque', 0.09, 'speed', 'speed')])
def test_an_axis_may_follow_its_laws_less_closely(monkeypatch, name, share, of_par4, of_axis):
    """The screw of EMPS has 0.06 in its directions; encoders that err in waves 0.2 to 0.4.

    A series over the position has no law that an axis may follow less closely.
    """
    monkeypatch.setattr(constancy, '_shares', lambda *_: {'time': 0.0, 'speed': share})
    pool = SimpleNamespace(evidence=None, heldout=None, width=lambda _: 1)
    assert [constancy.followed_by(SimpleNamespace(rules=rules, pool=pool), cause(name), ())
            for rules in (OF_PAR4, OF_AXIS)] == [of_par4, of_axis]
