"""Transmissions whose swing encoder counts hide in the rows: a second diagnosis below it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hidden.hiders import HIDERS
from hidden.scenario import Task, record_scenario
from short_scenarios import short_scenario

from par4_dynamics.effects.springs import Springs
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis import diagnosis as diagnosis_module
from par4_identification.diagnosis.below_resonance import (
    _share_left,
    below_resonance,
    is_better,
    resonance,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING, LIBRARY, diagnose
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.search.first_look import LOWER_BAND, first_look
from par4_identification.diagnosis.search.rules import OF_PAR4
from par4_identification.diagnosis.search.swing import Swing, swing_in
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
    """On one machine that all rows do not tell; `make blind` counts how often springs are named."""
    answer, first = both
    assert answer is not first
    causes = {cause.effect.name: cause for cause in answer.causes}
    assert set(causes) == set(SEARCHED)
    assert not answer.unnamed
    stiffness = causes['elastic_transmission'].parameters['stiffness']
    assert causes['elastic_transmission'].joints == (0, 1, 2, 3)
    np.testing.assert_allclose(stiffness.value, STIFFNESS, rtol=0.1)
    assert np.all(np.abs(np.array(stiffness.value) - STIFFNESS) < 3.0 * np.array(stiffness.std))
    # the same machine by all rows is not told in full
    assert first.verdict == 'partly_explained'
    assert first.remaining.floor_excess > 2.0 * answer.remaining.floor_excess


def test_only_a_swing_within_the_rows_asks_for_lower_filters(both):
    _, first = both
    assert 25.0 < first.swing_hz < 60.0
    narrow = below_resonance(first, CONDITIONING, OF_PAR4.floor_excess)
    assert narrow.torque_cutoff_hz == LOWER_BAND * CONDITIONING.torque_cutoff_hz
    assert narrow.row_rate_hz / narrow.torque_cutoff_hz == (
        CONDITIONING.row_rate_hz / CONDITIONING.torque_cutoff_hz)
    far = replace(first, swing_hz=4.0 * CONDITIONING.torque_cutoff_hz)
    rigid = replace(first, swing_hz=None)
    quiet = replace(first, remaining=replace(first.remaining, floor_excess=1.0))
    for other in (far, rigid, quiet):
        assert below_resonance(other, CONDITIONING, OF_PAR4.floor_excess) is None


def test_what_bounces_in_a_gap_is_not_looked_at_below_a_resonance(both):
    """Slower rows tell no bounces, and springs would take their place."""
    answer, first = both
    bounces = replace(answer.causes[0], effect=LIBRARY['backlash'], predictable=False)
    told = replace(first, causes=(bounces,))
    assert below_resonance(told, CONDITIONING, OF_PAR4.floor_excess) is None
    assert below_resonance(replace(first, causes=answer.causes), CONDITIONING,
                           OF_PAR4.floor_excess) is not None


def test_a_named_swing_is_looked_at_again_where_something_is_left(both):
    """Counts may have made a wrong minimum, however usual its damping is."""
    answer, first = both
    named = replace(first, causes=answer.causes, unnamed=())
    assert below_resonance(named, CONDITIONING, OF_PAR4.floor_excess) is not None


def springs_by_frequency(evidence):
    """Return the torque of the springs on the whitened rows, below half the rows' rate and above.
    """
    torque = project(evidence, ()).rest(np.concatenate(evidence.whitener.whiten([run.rows(
        Springs(run.state).torque(1.0 / STIFFNESS)[1][..., None])
        for run in evidence.observations.runs]))[:, 0])
    low = np.zeros_like(torque)
    for first, last in pairwise(evidence.ends):
        spectrum = np.fft.rfft(torque[first:last])
        spectrum[len(spectrum) // 2:] = 0.0
        low[first:last] = np.fft.irfft(spectrum, last - first)
    return low, torque - low


def test_a_first_look_tells_a_swing_that_counts_hide_from_a_descent(both):
    """What opposes the springs at higher frequencies hides them there, and not from the look."""
    _, first = both
    evidence, least = first.evidence, 2.0 * OF_PAR4.evidence
    true = resonance([Swing(1.0 / STIFFNESS, 0.0, 1.0 / STIFFNESS)], evidence.observations)
    assert resonance([], evidence.observations) is None
    low, high = springs_by_frequency(evidence)
    opposed = SimpleNamespace(evidence=evidence, rest=project(evidence, ()).rest,
                              residual=low - 30.0 * high)
    look = first_look(opposed)
    assert look.squares > least
    found = Swing(look.compliance, look.squares, look.compliance)
    assert resonance([found], evidence.observations) == pytest.approx(true, rel=0.2)
    assert swing_in(opposed, look, 2.0 * OF_PAR4.price).squares < 0.0


@pytest.mark.parametrize(('damping', 'std', 'share', 'is_told'), [
    (0.05, 0.0, 0.06, True), (0.15, 0.0, 0.06, True), (0.25, 0.0, 0.06, False),
    (0.3, 0.08, 0.06, True), (0.25, 0.0, 0.04, True)])
def test_springs_are_told_unless_their_damping_is_surely_large(recorded, both, damping, std, share,
                                                               is_told):
    """Below the resonance the loads hardly tell what damps them, if much is left beside them."""
    answer, first = both
    robot, _, _ = recorded
    told = [replace(cause, parameters={**cause.parameters, 'damping_ratio': Parameter(
        value=damping, std=std, unit='1')}) if cause.effect.name == 'elastic_transmission'
        else cause for cause in answer.causes]
    scale = np.sqrt(share / _share_left(answer, first, robot))
    second = replace(answer, causes=tuple(told), holdout=replace(
        answer.holdout, extended_rms=scale * answer.holdout.extended_rms))
    assert second.verdict == 'explained'
    assert is_better(second, first, robot) == is_told
    without = [cause for cause in told if cause.effect.name != 'elastic_transmission']
    assert not is_better(replace(second, causes=tuple(without)), first, robot)
    if damping == 0.25:
        left = replace(second, verdict='partly_explained')
        assert not is_better(left, first, robot)


def test_springs_that_were_named_are_told_with_no_more_unnamed_causes_than_before(recorded, both):
    answer, first = both
    robot, _, _ = recorded
    nameless, = first.unnamed
    left = replace(answer, verdict='partly_explained')
    assert 'elastic_transmission' in {cause.effect.name for cause in first.causes}
    assert is_better(replace(left, unnamed=(nameless,)), first, robot)
    assert not is_better(replace(left, unnamed=(nameless, nameless)), first, robot)
    without = [cause for cause in answer.causes if cause.effect.name != 'elastic_transmission']
    assert not is_better(replace(answer, causes=tuple(without)), first, robot)
    assert is_better(replace(answer, causes=tuple(without), swing_hz=None), first, robot)


@pytest.mark.parametrize(('share', 'is_told'), [(0.04, True), (0.06, False)])
def test_springs_that_were_not_named_must_leave_next_to_nothing(recorded, both, share, is_told):
    """Loads that bounce in a gap leave something beside the springs that they look like."""
    answer, first = both
    robot, _, _ = recorded
    unknown = replace(first, verdict='unknown', causes=())
    assert is_better(answer, unknown, robot)
    scale = np.sqrt(share / _share_left(answer, unknown, robot))
    second = replace(answer, verdict='partly_explained', holdout=replace(
        answer.holdout, extended_rms=scale * answer.holdout.extended_rms))
    assert is_better(second, unknown, robot) == is_told
    assert not is_better(replace(second, unnamed=first.unnamed), unknown, robot)


@pytest.mark.parametrize(('verdict', 'nearest', 'is_told'), [
    ('clean', 'elastic_transmission', True), ('clean', 'encoder_offset', False),
    ('unknown', 'elastic_transmission', False), ('clean', None, False)])
def test_a_sound_machine_that_springs_come_near_is_unknown(recorded, both, verdict, nearest,
                                                            is_told):
    """They are not sure enough to be named; that there is nothing is not sure, either."""
    answer, first = both
    near = replace(answer, verdict='unknown', causes=(), holdout=replace(
        answer.holdout, extended_rms=10.0 * answer.holdout.extended_rms), remaining=replace(
        answer.remaining, nearest=nearest and SEARCHED[nearest]))
    assert is_better(near, replace(first, verdict=verdict), recorded[0]) == is_told


def test_what_leaves_more_of_the_rows_is_not_told(recorded, both):
    answer, first = both
    worse = replace(answer, holdout=replace(
        answer.holdout, extended_rms=10.0 * answer.holdout.extended_rms))
    assert not is_better(worse, first, recorded[0])


def test_filters_that_a_user_sets_stay(recorded, both, monkeypatch):
    robot, fit, heldout = recorded
    answer, first = both
    assert answer.below_hz == first.swing_hz
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
    assert f'this answer rests on torques below {LOWER_BAND * 40.0:.1f} Hz' in remarks
