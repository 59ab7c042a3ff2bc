"""Transmissions whose swing encoder counts hide in the rows: a second diagnosis below it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hidden.hiders import HIDERS
from hidden.scenario import Task, record_scenario
from short_scenarios import short_scenario

from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis import diagnosis as diagnosis_module
from par4_identification.diagnosis.below_resonance import (
    NARROWER,
    below_resonance,
    hidden_resonance,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING, LIBRARY, diagnose
from par4_identification.diagnosis.search.rules import OF_PAR4
from par4_identification.reports.outcome.diagnosis import outcome_of_diagnosis

STIFFNESS = np.array([7020.0, 6530.0, 7920.0, 5960.0])
"""N m/rad; the loads swing at some 40 Hz, the rows reach as far."""
SEARCHED = {name: LIBRARY[name] for name in ('elastic_transmission', 'encoder_offset')}
SHARPLY = {'damping_ratio': 0.03, 'motor_share': 0.5}


@pytest.fixture(scope='module')
def recorded():
    """Return the robot and two logs of a machine with soft transmissions and wrong zeros."""
    scenario = short_scenario(Task('single', 106, 'encoder_offset', True))
    soft = HIDERS['elastic_transmission'].build(
        scenario.machine, {'compliance': 1.0 / STIFFNESS, **SHARPLY})
    fit, heldout = record_scenario(replace(scenario, machine=soft))
    return scenario.known.robot, fit.log, heldout.log


@pytest.fixture(scope='module')
def both(recorded):
    """Return the answer, and the one of the first diagnosis alone."""
    robot, fit, heldout = recorded
    answers, made = [], diagnosis_module._diagnosed_logs

    def kept(*arguments):
        answers.append(made(*arguments))
        return answers[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosis_module, '_diagnosed_logs', kept)
        answer = diagnose([fit], robot, None, [heldout], library=SEARCHED)
    return answer, answers[0]


def test_springs_that_counts_hide_are_named_with_what_is_beside_them(both):
    answer, first = both
    assert answer is not first
    causes = {cause.effect.name: cause for cause in answer.causes}
    assert set(causes) == set(SEARCHED)
    assert not answer.unnamed
    stiffness = causes['elastic_transmission'].parameters['stiffness']
    assert causes['elastic_transmission'].joints == (0, 1, 2, 3)
    np.testing.assert_allclose(stiffness.value, STIFFNESS, rtol=0.1)
    assert np.all(np.abs(np.array(stiffness.value) - STIFFNESS) < 3.0 * np.array(stiffness.std))
    # the same machine by all rows is not told
    assert first.unnamed


def test_only_a_hidden_swing_asks_for_lower_filters(both):
    answer, first = both
    assert answer.hidden_hz is None
    assert 25.0 < first.hidden_hz < 60.0
    narrow = below_resonance(first, CONDITIONING, OF_PAR4.floor_excess)
    assert narrow.torque_cutoff_hz == NARROWER * CONDITIONING.torque_cutoff_hz
    assert narrow.row_rate_hz / narrow.torque_cutoff_hz == (
        CONDITIONING.row_rate_hz / CONDITIONING.torque_cutoff_hz)
    far = replace(first, hidden_hz=4.0 * CONDITIONING.torque_cutoff_hz)
    quiet = replace(first, remaining=replace(first.remaining, floor_excess=1.0))
    for other in (answer, far, quiet):
        assert below_resonance(other, CONDITIONING, OF_PAR4.floor_excess) is None


@pytest.mark.parametrize(('damping', 'std', 'hides'), [
    (0.05, 0.0, False), (0.17, 0.09, False), (0.3, 0.05, True)])
def test_a_damping_hides_something_only_if_it_is_surely_large(both, damping, std, hides):
    """Below the resonance the loads hardly tell what damps them."""
    answer, _ = both
    springs = next(cause for cause in answer.causes if cause.effect.name == 'elastic_transmission')
    told = replace(springs, parameters={**springs.parameters, 'damping_ratio': Parameter(
        value=damping, std=std, unit='1')})
    swing = SimpleNamespace(told={'damping_ratio': damping}, compliance=1.0 / STIFFNESS)
    found = hidden_resonance([swing], answer.evidence.observations, replace(
        answer, causes=(told,)))
    assert (found is not None) == hides
    beside = replace(answer, causes=(told,), unnamed=(SimpleNamespace(),))
    assert hidden_resonance([swing], answer.evidence.observations, beside) is not None


def test_filters_that_a_user_sets_stay(recorded, both, monkeypatch):
    robot, fit, heldout = recorded
    answer, first = both
    assert answer.below_hz == first.hidden_hz
    asked = []
    monkeypatch.setattr(diagnosis_module, '_diagnosed_logs',
                        lambda *arguments: asked.append(arguments[6]) or first)
    assert diagnose([fit], robot, None, [heldout], conditioning=CONDITIONING,
                    as_set=True) is first
    assert asked == [CONDITIONING]


def test_the_report_says_by_which_rows_it_answers(recorded, both):
    answer, _ = both
    remarks = ' '.join(remark.text for remark in outcome_of_diagnosis(
        answer, recorded[0], None).remarks)
    assert f'this answer rests on torques below {NARROWER * 40.0:.1f} Hz' in remarks
