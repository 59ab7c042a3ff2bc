"""Compliances of transmissions whose loads swing, from torque written down on its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hidden.hiders import HIDERS
from hidden.machines import known_machine
from hidden.motions import draw_motion
from hidden.recording import record
from hidden.scenario import Task, draw_scenario, record_scenario
from hidden.study import diagnosis_of
from planned import evidence_of, log_of
from searches import MODEL as ON_MODEL
from searches import cause, log_with, search_on, springs_in

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.effects.springs import DAMPING_RATIO, FIRST, USUAL, Drive, Springs
from par4_dynamics.effects.transmission import MOTOR_SHARE
from par4_dynamics.model_file import ModelFile
from par4_dynamics.model_from_file import build_model
from par4_dynamics.state import State
from par4_identification.diagnosis.diagnosis import LIBRARY, diagnose
from par4_identification.diagnosis.evidence.dithered import dithered
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.projection import project
from par4_identification.diagnosis.search import candidates as candidates_module
from par4_identification.diagnosis.search.candidates import PROMISED, Candidate, Candidates
from par4_identification.diagnosis.search.first_look import Look, first_look
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.search.search import Search
from par4_identification.diagnosis.search.swing import (
    ALIKE,
    RIGID,
    WIDE,
    Swing,
    _descended,
    _Twisting,
    stiffnesses_of,
    swing_in,
    without_rigid,
)
from par4_identification.diagnosis.verdict import swinging_loads
from par4_identification.diagnosis.verdict.swinging_loads import unbiased, without_count_bias
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.robot import Axis
from par4_sim.machines.noise import Noise
from robots import REFERENCE

AXIS = Axis(schema='par4/axis/1', name='arm', joint='arm', kind='revolute', gain=1.0)
INERTIA, COULOMB, VISCOUS = 0.2, 1.5, 0.8
LOAD = (1.0 - MOTOR_SHARE) * INERTIA
MODEL = build_model(AXIS, ModelFile(schema='par4/model/1', parameters={
    'actuator_inertia': {'value': INERTIA}, 'coulomb_friction': {'value': COULOMB},
    'viscous_friction': {'value': VISCOUS}}))
T = np.arange(0.0, 12.0, 1e-3)
RATES = 2.0 * np.pi * np.array((0.4, 1.1, 2.3, 4.1, 6.7, 9.8, 13.1, 17.3, 21.7))
FADE = 1.5
SIZES = 0.3 / (1.0 + (RATES / 6.0) ** 2)
LEAST = 2.0 * Rules().evidence


def evidence_of_axis(compliance, seed=1, noise=0.05, damping_ratio=DAMPING_RATIO,
                     motor_share=MOTOR_SHARE, pieces=1):
    """Return rows of an axis whose load hangs on a spring, its log in so many pieces."""
    q, tau = motion_of_axis(compliance, damping_ratio, motor_share)
    log = log_of(AXIS, T, q, tau, seed, noise)
    length = len(T) // pieces
    log = replace(log, segments=tuple(slice(first, first + length)
                                      for first in range(0, len(T), length)))
    return evidence_of(log, AXIS, MODEL, noise)


def motion_of_axis(compliance, damping_ratio=DAMPING_RATIO, motor_share=MOTOR_SHARE):
    """Return positions and torque (n, 1) of an axis whose load hangs on a spring.

    They are those of its Fourier series.

    Of each sine of the motor the load makes (1 + 2 i d r) / (1 - r^2 + 2 i d r), r the frequency
    over that of the load on its spring, d the damping ratio of the load against a resting motor.
    The axis is at rest before and after.
    """
    phase = np.random.default_rng(7).uniform(0.0, 2.0 * np.pi, len(RATES))
    fades = np.minimum(1.0, np.minimum(T, T[-1] - T) / FADE)
    spectrum = np.fft.rfft(np.sin(0.5 * np.pi * fades) ** 4
                           * (SIZES * np.cos(RATES * T[:, None] + phase)).sum(axis=1), 2 * len(T))
    rates = 2.0 * np.pi * np.fft.rfftfreq(2 * len(T), T[1])
    load = (1.0 - motor_share) * INERTIA
    r = rates * np.sqrt(load * compliance)
    loss = 2j * np.sqrt(motor_share) * damping_ratio * r
    follows = (1.0 + loss) / (1.0 - r ** 2 + loss)

    def in_time(part):
        return np.fft.irfft(part * spectrum)[:len(T)]

    q, qd = in_time(1.0), in_time(1j * rates)
    tau = (in_time(-rates ** 2 * (INERTIA - load + load * follows))
           + COULOMB * np.sign(qd) + VISCOUS * qd)
    return q[:, None], tau[:, None]


@pytest.mark.parametrize('resonance', [17.0, 22.0, 35.0, 60.0, 100.0])
def test_the_compliance_of_a_swinging_axis_comes_out(resonance):
    """Its load swings within the band of the motion, at its edge or far above."""
    true = 1.0 / (LOAD * (2.0 * np.pi * resonance) ** 2)
    found = springs_in(project(evidence_of_axis(true), []))
    assert found.compliance[0] == pytest.approx(true, rel=0.05)
    assert found.squares > LEAST


@pytest.mark.parametrize('damping_ratio', [0.01, 0.02])
def test_a_load_that_rings_is_found(damping_ratio):
    """A little off its compliance it swings against the truth, so that a first look needs more."""
    true = 1.0 / (LOAD * (2.0 * np.pi * 19.0) ** 2)
    found = springs_in(project(evidence_of_axis(true, damping_ratio=damping_ratio), []))
    assert found.compliance[0] == pytest.approx(true, rel=0.02)
    assert found.told['damping_ratio'] < 0.03


@pytest.mark.parametrize('damping_ratio', [0.02, 0.15, 0.3])
def test_the_damping_comes_out_where_it_is_not_the_usual_one(damping_ratio):
    true = 1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2)
    evidence = evidence_of_axis(true, damping_ratio=damping_ratio)
    found = springs_in(project(evidence, []))
    assert found.told['damping_ratio'] == pytest.approx(damping_ratio, rel=0.1)
    assert found.compliance[0] == pytest.approx(true, rel=0.02)


@pytest.mark.parametrize('told', [0.3, None])
def test_damping_that_is_none_of_a_transmission_is_not_told(told):
    """Nor is it where an earlier search told one and the descent runs to the bound from there."""
    true = 1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2)
    projection = project(evidence_of_axis(true, damping_ratio=0.6), [])
    known = () if told is None else (replace(
        springs_in(projection), told={'damping_ratio': told}),)
    assert 'damping_ratio' not in springs_in(projection, known).told


@pytest.mark.parametrize('damping_ratio', [DAMPING_RATIO, 0.15])
@pytest.mark.parametrize('motor_share', [0.2, 0.76])
def test_the_share_of_the_motor_comes_out_where_it_is_not_one_half(motor_share, damping_ratio):
    """A softer spring under less load swings at the same frequency, but by another torque."""
    true = 1.0 / ((1.0 - motor_share) * INERTIA * (2.0 * np.pi * 22.0) ** 2)
    evidence = evidence_of_axis(true, damping_ratio=damping_ratio, motor_share=motor_share)
    found = springs_in(project(evidence, []))
    assert found.told['motor_share'] == pytest.approx(motor_share, rel=0.03)
    assert found.compliance[0] == pytest.approx(true, rel=0.03)
    assert found.told.get('damping_ratio', DAMPING_RATIO) == pytest.approx(damping_ratio, rel=0.05)


@pytest.mark.parametrize('damping_ratio', [0.02, 0.15])
def test_a_log_in_pieces_that_begin_in_motion_tells_the_same(damping_ratio):
    """Loads taken to begin each piece at rest on their springs seem to be damped more."""
    true = 1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2)
    evidence = evidence_of_axis(true, damping_ratio=damping_ratio, pieces=8)
    assert len(evidence.observations.runs) == 8
    found = springs_in(project(evidence, []))
    assert found.told['damping_ratio'] == pytest.approx(damping_ratio, rel=0.1)
    assert found.compliance[0] == pytest.approx(true, rel=0.02)


@pytest.mark.parametrize('every', [1, 3])
def test_a_load_swings_on_as_the_first_torques_tell(every):
    """It does where what was before is not known, or what follows would ring for a second."""
    compliance, drive = np.array((1.0 / (LOAD * (2.0 * np.pi * 15.0) ** 2),)), Drive(0.03)
    q, tau = motion_of_axis(compliance[0], drive.damping_ratio)
    log = log_of(AXIS, T, q, tau, seed=1, noise=0.05)
    begun = replace(log, t=T[5000:8000], q=q[5000:8000], tau=log.tau[5000:8000],
                    segments=(slice(0, 3000),))
    state, = (run.state for run in runs_of_log(begun, AXIS))
    known = replace(state, nominal=MODEL.nominal(state))
    told, unknown = (own.nominal.torque + Springs(own).torque(compliance, drive, every)[1]
                     for own in (known, replace(known, measured=None)))
    moving = np.abs(state.qd) > 0.1  # where friction has one sign
    later = slice(round(FIRST / T[1]), 800)
    wrong, ringing = (np.abs((own - tau[5000:8000])[later][moving[later]]).max()
                      for own in (told, unknown))
    assert ringing > 1.0
    assert wrong < 0.15 * ringing


def test_rows_that_follow_from_what_was_before_a_log_do_not_count():
    q, tau = motion_of_axis(1e-4)
    log = log_of(AXIS, T, q, tau, seed=1)
    log = replace(log, segments=(slice(0, 5000), slice(5000, 6200), slice(6200, len(T))))
    at_rest, short, moving = runs_of_log(log, AXIS)
    assert at_rest.remembered(2.0) is at_rest
    for run, memory in ((short, 0.6), (moving, 2.0)):
        kept = run.remembered(2.0)
        np.testing.assert_array_equal(
            kept.valid, run.valid & (run.t >= run.state.t[0] + memory - 1e-9)[:, None])
        assert 0 < kept.valid.sum() < run.valid.sum()


def test_a_share_of_one_half_is_not_freed():
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2))
    assert 'motor_share' not in springs_in(project(evidence, [])).told


def test_a_share_of_the_motor_beyond_what_is_believed_is_not_told():
    """A search that ends at a bound fits something else."""
    motor_share = 0.985
    true = 1.0 / ((1.0 - motor_share) * INERTIA * (2.0 * np.pi * 22.0) ** 2)
    evidence = evidence_of_axis(true, motor_share=motor_share)
    assert 'motor_share' not in springs_in(project(evidence, [])).told


def test_a_later_search_tells_what_an_earlier_one_could_not():
    """Beside other causes, or with a better nominal torque, data tell more."""
    motor_share = 0.76
    true = 1.0 / ((1.0 - motor_share) * INERTIA * (2.0 * np.pi * 22.0) ** 2)
    projection = project(evidence_of_axis(true, motor_share=motor_share), [])
    anew = springs_in(projection)
    known = Swing(0.6 * anew.compliance, 0.0, anew.first_look)
    again = springs_in(projection, (known,))
    assert again.told['motor_share'] == pytest.approx(motor_share, rel=0.03)


def test_a_damping_that_the_motion_does_not_show_is_the_usual_one():
    """The resonance lies far above the band of the torque."""
    true = 1.0 / (LOAD * (2.0 * np.pi * 100.0) ** 2)
    evidence = evidence_of_axis(true, damping_ratio=0.1)
    assert springs_in(project(evidence, [])).told == {}


@pytest.mark.parametrize(('told_hz', 'is_told'), [(25.0, False), (60.0, True)])
def test_a_damping_that_encoders_do_not_tell_is_the_usual_one(told_hz, is_told):
    """Beyond what they tell nothing swings, which looks like damping."""
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2), damping_ratio=0.15)
    run, = evidence.observations.runs
    coarse = replace(run, state=replace(run.state, told_hz=told_hz))
    evidence = replace(evidence, observations=replace(evidence.observations, runs=(coarse,)))
    found = springs_in(project(evidence, []))
    assert ('damping_ratio' in found.told) == is_told


def test_a_share_is_told_where_encoders_do_not_tell_the_resonance():
    """Below it the load swings with more torque than the spring's stiffness alone would make."""
    motor_share = 0.8
    true = 1.0 / ((1.0 - motor_share) * INERTIA * (2.0 * np.pi * 35.0) ** 2)
    evidence = evidence_of_axis(true, motor_share=motor_share)
    run, = evidence.observations.runs
    coarse = replace(run, state=replace(run.state, told_hz=40.0))
    evidence = replace(evidence, observations=replace(evidence.observations, runs=(coarse,)))
    found = springs_in(project(evidence, []))
    assert list(found.told) == ['motor_share']
    assert found.told['motor_share'] == pytest.approx(motor_share, rel=0.05)
    assert found.compliance[0] == pytest.approx(true, rel=0.1)


def test_the_resonance_is_that_of_the_load_on_its_spring():
    evidence = evidence_of_axis(0.0)
    springs = Springs(evidence.observations.runs[0].state)
    compliance = np.array((1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2),))
    np.testing.assert_allclose(springs.resonances(compliance), 22.0, rtol=1e-6)
    assert springs.resonances(np.zeros(1)) == np.inf


@pytest.mark.parametrize(('over_weight', 'holds'), [(1.5, True), (0.9, False)])
def test_a_spring_that_does_not_hold_its_load_up_twists_nothing(over_weight, holds):
    """The load of an axis stands upside down; on a softer spring than its weight it falls over."""
    weight = 40.0
    model = build_model(AXIS.model_copy(update={'gravity': 'vertical'}), ModelFile(
        schema='par4/model/1', parameters={
            'actuator_inertia': {'value': INERTIA}, 'coulomb_friction': {'value': COULOMB},
            'viscous_friction': {'value': VISCOUS}, 'gravity_sine': {'value': -weight},
            'gravity_cosine': {'value': 0.0}}))
    q = 0.05 * np.sin(3.0 * T[:, None])
    state = State(T, q, 0.15 * np.cos(3.0 * T[:, None]), -0.45 * np.sin(3.0 * T[:, None]),
                  hanging='turning')
    springs = Springs(replace(state, nominal=model.nominal(state)))
    compliance = np.array([1.0 / (over_weight * weight)])
    change = springs.torque(compliance)[1]
    assert np.any(change) == holds
    assert np.any(springs.slopes(compliance)) == holds
    assert np.abs(change).max() < 3.0 * weight * 0.05


def slope_errors(state, compliance, drive):
    """Return the rms of slopes less differences of torques, over that of these, of each value."""
    springs = Springs(state)
    slopes, step, errors = springs.slopes(compliance, drive), 1e-4, []
    for value in (*np.flatnonzero(compliance > 0.0), -2, -1):
        ends = []
        for side in (-step, step):
            moved = compliance * np.exp(side * (np.arange(len(compliance)) == value))
            ends.append(springs.torque(moved, Drive(
                drive.damping_ratio * np.exp(side * (value == -2)),
                drive.motor_share * np.exp(side * (value == -1))))[1])
        difference = (ends[1] - ends[0]) / (2.0 * step)
        errors.append(np.std(slopes[..., value] - difference) / np.std(difference))
    rigid = compliance <= 0.0
    assert not slopes[..., :-2][..., rigid].any()
    return errors


@pytest.mark.parametrize('motor_share', [0.5, 0.8])
def test_slopes_are_those_of_the_torque(motor_share):
    """Of an axis exactly, of a mechanism but for what the first order misses."""
    axis = evidence_of_axis(0.0).observations.runs[0].state
    compliance = np.array((1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2),))
    assert max(slope_errors(axis, compliance, Drive(0.1, motor_share))) < 1e-5
    known = known_machine('reference')
    motion = draw_motion('circles', known.robot, 8.0, 7)
    log = log_of(known.robot, motion.t, motion.q, np.zeros_like(motion.q), 1, 0.0)
    run, = runs_of_log(log, known.robot)
    state = replace(run.state, nominal=known.model.nominal(run.state))
    soft = np.array((1e-4, 0.0, 5e-5, 3e-4))
    assert max(slope_errors(state, soft, Drive(0.05, motor_share))) < 0.06


def test_a_search_that_goes_on_from_another_one_ends_where_it_would():
    true = 1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2)
    projection = project(evidence_of_axis(true, damping_ratio=0.15), [])
    anew = springs_in(projection)
    near = Swing(1.2 * anew.compliance, 0.0, anew.first_look, {'damping_ratio': 0.1})
    # in another basin: it is begun anew
    far = Swing(np.array([30.0 * true]), 0.0, np.array([30.0 * true]), {'damping_ratio': 0.1})
    for known in (near, far):
        found = springs_in(projection, (known,))
        np.testing.assert_allclose(found.compliance, anew.compliance, rtol=0.01)
        assert found.told['damping_ratio'] == pytest.approx(anew.told['damping_ratio'], rel=0.05)


@pytest.mark.parametrize(('share', 'is_anew'), [(0.9 * ALIKE, False), (1.1 * ALIKE, True)])
def test_a_search_whose_first_look_is_alike_is_not_begun_anew(monkeypatch, share, is_anew):
    """It goes on from the last one found before whose first look is most like this one."""
    projection = project(evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2),
                                          damping_ratio=0.15, motor_share=0.7), [])
    anew = springs_in(projection)
    alike = replace(anew, first_look=(1.0 + share) * anew.first_look)
    far = Swing(30.0 * anew.compliance, 0.0, 30.0 * anew.first_look)
    stale = replace(alike, compliance=far.compliance)
    descents = []
    monkeypatch.setattr('par4_identification.diagnosis.search.swing._descended',
                        lambda *asked: descents.append(asked) or _descended(*asked))
    found = springs_in(projection, (far, stale, alike, far))
    assert (len(descents) > 1) == is_anew
    np.testing.assert_allclose(found.compliance, anew.compliance, rtol=1e-3)


@pytest.mark.parametrize('beside', [0.0, 1e-9])
def test_a_descent_that_begins_at_a_bound_goes_on(beside):
    """A step that ends at a bound just ahead must not end the search."""
    start, believed = np.array((beside, 0.0)), np.array(((0.0, -5.0), (5.0, 5.0)))
    found = _descended(lambda x: x - (-1.0, 3.0), lambda _: np.eye(2), start, believed)
    np.testing.assert_allclose(found, (0.0, 3.0), atol=1e-6)


def test_a_damping_at_the_bound_of_what_is_believed_is_not_told():
    """So much of it leaves no resonance; a search that ends there fits something else."""
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2), damping_ratio=0.8)
    assert springs_in(project(evidence, [])).told == {}


def test_a_later_search_begins_where_an_earlier_one_ended(monkeypatch):
    begun = []
    monkeypatch.setattr(candidates_module, 'swing_in', noted(begun))
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2))
    effect, known = CATALOGUE['elastic_transmission'], Swing(
        np.array([1e-4]), 0.0, np.array([1e-4]), {'damping_ratio': 0.1})
    candidates = Candidates({effect.name: effect}, evidence, Rules(), (known,))
    candidates.best(effect, project(evidence, []))
    found = candidates.swings[-1]
    candidates.best(effect, project(evidence, [cause('stribeck', (0,), stribeck_velocity=0.1)]))
    assert [asked[3] for asked in begun] == [[known], [known, found]]


def noted(followed):
    """Return a descent that notes what it was asked and finds what the first look promises."""
    def descent(projection, look, price, known=()):
        followed.append((projection, look, price, list(known)))
        return Swing(np.array([1e-4]), look.squares, look.compliance)
    return descent


def test_springs_are_followed_where_they_promise_a_share_of_what_is_wanted(monkeypatch):
    """What is wanted is what another effect gains, unless less is asked for."""
    followed = []
    monkeypatch.setattr(candidates_module, 'swing_in', noted(followed))
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2))
    effect, projection = CATALOGUE['elastic_transmission'], project(evidence, [])
    promised = 0.5 * first_look(projection).squares
    candidates = Candidates({effect.name: effect}, evidence, Rules())
    most = promised / PROMISED
    assert candidates.best(effect, projection, 1.01 * most) is None
    assert candidates.swings == []
    assert candidates.best(effect, projection, 0.99 * most).gain == pytest.approx(promised)
    # what was followed once is known, whatever is wanted
    assert candidates.best(effect, projection).gain == pytest.approx(promised)
    assert candidates.best(effect, projection, 1.01 * most).gain == pytest.approx(promised)
    assert len(followed) == len(candidates.swings) == 1


@pytest.mark.parametrize(('resonance', 'is_looked_at'), [(22.0, True), (np.inf, False)])
def test_springs_are_looked_at_where_their_first_order_explains_something(monkeypatch, resonance,
                                                                          is_looked_at):
    """The measured torque, by which the look goes, has noise and other causes in it."""
    looked = []
    monkeypatch.setattr(candidates_module, 'first_look', lambda projection: (
        looked.append(projection), Look(np.zeros(1), 0.0))[1])
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * resonance) ** 2))
    effect, projection = CATALOGUE['elastic_transmission'], project(evidence, [])
    assert Candidates({effect.name: effect}, evidence, Rules()).best(effect, projection) is None
    assert looked == [projection] * is_looked_at


def test_orders_are_weighed_against_what_is_quicker_unless_less_is_wanted(monkeypatch):
    """What the noise model must not take for noise is sought in full, however little it is."""
    def best(_self, effect, **asked_for):
        asked[effect.name] = asked_for['wanted']
        return Candidate(Hypothesis(effect, {}, (0,)), {'stribeck': 7.0, 'cogging': 9.0}.get(
            effect.name, 1.0), 1)

    monkeypatch.setattr(Candidates, 'best', best)
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2))
    library = {name: CATALOGUE[name] for name in ('elastic_transmission', 'cogging', 'stribeck')}
    candidates, projection = Candidates(library, evidence, Rules()), project(evidence, [])
    for wanted, found in (({}, (7.0, 9.0)), ({'wanted': 0.0}, (0.0, 0.0))):
        asked = {}
        candidates.all_of(projection, set(), **wanted)
        assert asked == {'stribeck': 0.0, 'cogging': found[0], 'elastic_transmission': found[1]}


def test_springs_are_weighed_against_the_best_of_the_other_effects(monkeypatch):
    followed, asked, twisting = [], [], Candidates._twisting
    monkeypatch.setattr(candidates_module, 'swing_in', noted(followed))
    monkeypatch.setattr(Candidates, '_twisting', lambda self, effect, projection, wanted: (
        asked.append(wanted), twisting(self, effect, projection, wanted))[1])
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2))
    library = {name: CATALOGUE[name] for name in ('elastic_transmission', 'time_offset',
                                                  'stribeck')}
    projection = project(evidence, [])

    def found(**wanted):
        candidates = Candidates(library, evidence, Rules())
        return {item.hypothesis.effect.name: item.gain
                for item in candidates.all_of(projection, set(), **wanted)}

    gains = found()
    springs = gains.pop('elastic_transmission')
    assert asked == [pytest.approx(max(gains.values()))]
    assert found(wanted=1.01 * springs / PROMISED).keys() == gains.keys()
    assert 'elastic_transmission' in found(wanted=0.0)
    assert len(followed) == 2


def test_springs_are_looked_at_again_where_a_better_candidate_is_refused(monkeypatch):
    """Beside it they promised too little to be followed."""
    fit, heldout = (evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2), seed)
                    for seed in (1, 2))
    search = search_on(fit, heldout, ('elastic_transmission', 'torque_offset'))
    springs = CATALOGUE['elastic_transmission']

    def best(_self, effect, projection, wanted=0.0):
        assert projection.hypotheses == ()
        if effect is not springs:
            return Candidate(Hypothesis(effect, {}, (0,)), 1e6, 1)
        return None if wanted > 1e5 else Candidate(
            Hypothesis(effect, effect.expansion(np.array([1e-4])), (0,)), 1e3, 1)

    monkeypatch.setattr(Candidates, 'best', best)
    monkeypatch.setattr(Search, '_trimmed', lambda _self, item, _model: (
        item.gain, item.hypothesis))
    monkeypatch.setattr(Search, '_is_confirmed', lambda _self, item, _others: (
        item.effect is springs))
    assert [item.effect for item in search._with_a_name((), set())] == [springs]


def test_numbers_in_common_are_told_where_compliances_alone_leave_more_than_none():
    """Damped more than usual, two joints promise much and leave more than rigid ones at first."""
    projection = project(evidence_of_machine((3500.0, 0.0, 0.0, 4200.0), damping_ratio=0.25), [])
    assert springs_in(projection, price=np.inf).squares < 0.0
    found = springs_in(projection)
    assert found.told['damping_ratio'] == pytest.approx(0.25, rel=0.01)
    assert found.squares > first_look(projection).squares


def evidence_of_machine(stiffness, seed=1, **common):
    """Return rows of the reference robot with some soft joints."""
    return evidence_of(log_with(('elastic_transmission', {'stiffness': stiffness, **common}),
                                seed=seed, duration=6.0), REFERENCE, ON_MODEL)


def residual_and_change(counts, compliance, damping_ratio, motion='circles', feedforward=True,
                        all_of_it=False):
    """Return what a rigid model leaves of a soft last joint's torque, and what springs change.

    `all_of_it` swings them with all that encoders read.
    """
    known = known_machine('reference')
    drives = known.robot.drives.model_copy(update={'encoder_counts': counts})
    known = replace(known, robot=known.robot.model_copy(update={'drives': drives}))
    soft = {'compliance': np.array((0.0, 0.0, 0.0, compliance)), 'damping_ratio': damping_ratio}
    machine = HIDERS['elastic_transmission'].build(known.machine, soft)
    log = record(known, machine, draw_motion(motion, known.robot, 8.0, 7), fidelity='exact',
                 noise=Noise(), seed=7, feedforward=known.model if feedforward else None,
                 wander=None, name='soft').log
    run, = runs_of_log(log, known.robot)
    state = replace(run.state, nominal=known.model.nominal(run.state))
    springs = Springs(replace(state, told_hz=np.inf) if all_of_it else state)
    _, change = springs.torque(soft['compliance'], Drive(soft['damping_ratio']))
    rigid = run.tau - run.rows(known.model.torque(state))
    moving = run.valid[:, 3]
    return rigid[moving, 3], run.rows(change)[moving, 3]


@pytest.mark.parametrize(('compliance', 'damping_ratio', 'motion', 'left'), [
    (6e-4, 0.02, 'circles', 0.22),  # a quarter without the velocity's terms
    (2e-4, 0.05, 'cycles', 0.007),  # 0.012 to first order in the twist
    (3e-4, 0.05, 'excitation', 0.008)])  # 0.010 so
def test_a_soft_joint_of_a_machine_swings_as_its_own_values_say(
        compliance, damping_ratio, motion, left):
    """The plant is made another way."""
    rigid, change = residual_and_change(2 ** 24, compliance, damping_ratio, motion)
    assert np.std(rigid) > 0.1
    assert np.std(rigid - change) < left * np.std(rigid)


def test_what_encoders_misread_does_not_swing_the_load():
    """Loops answer 131,072 counts a turn, and the resonance lies at 46 Hz.

    Springs of that alone make ten times the torque that is there.
    """
    case = 131072, 4.8e-5, 0.05, 'excitation', False
    for all_of_it in (False, True):
        rigid, change = residual_and_change(*case, all_of_it)
        share = change @ rigid / (change @ change)
        assert share < 0.15 if all_of_it else 0.5 < share < 1.2


def test_the_damping_of_a_load_is_not_that_of_what_encoders_misread():
    """At its resonance a load swings with the counts, which least squares damp away."""
    true = 0.05
    known = known_machine('reference')
    drives = known.robot.drives.model_copy(update={'encoder_counts': 131072})
    known = replace(known, robot=known.robot.model_copy(update={'drives': drives}))
    compliance = np.array((0.0, 0.0, 0.0, 4e-5))
    machine = HIDERS['elastic_transmission'].build(
        known.machine, {'compliance': compliance, 'damping_ratio': true})
    log = record(known, machine, draw_motion('cycles', known.robot, 8.0, 7), fidelity='exact',
                 noise=Noise(), seed=7, feedforward=known.model, wander=None, name='soft').log
    evidence = evidence_of(log, known.robot, known.model, 0.03)
    projection, effect = project(evidence, []), CATALOGUE['elastic_transmission']
    found = springs_in(projection)
    assert found.told['damping_ratio'] > 2.0 * true
    soft = without_rigid(found.compliance, evidence.observations.runs[0].state)
    cause = Hypothesis(effect, effect.expansion(soft, found.told), (0, 1, 2, 3))
    told = unbiased(cause, projection,
                    dithered(evidence.observations).with_nominal(known.model))
    assert abs(np.log(told.shape['damping_ratio'] / true)) < 0.6 * np.log(
        found.told['damping_ratio'] / true)
    assert effect.exact_at(told.shape, 4)[3] == pytest.approx(4e-5, rel=0.03)


@pytest.mark.parametrize(('told_hz', 'is_told'), [(45.0, True), (9.8, False)])
def test_values_that_explain_little_of_what_a_cause_does_are_not_told(monkeypatch, told_hz,
                                                                      is_told):
    """A correction for counts that lets loads swing with the motion has run away."""
    effect = CATALOGUE['elastic_transmission']
    soft, other = (Hypothesis(effect, effect.expansion(np.array(
        [1.0 / (LOAD * (2.0 * np.pi * hertz) ** 2)]), {}), (0,)) for hertz in (46.0, told_hz))
    fit, heldout = (evidence_of_axis(effect.exact_at(soft.shape, 1)[0], seed) for seed in (1, 2))
    search = search_on(fit, heldout, (effect.name,))
    monkeypatch.setattr(type(search.belief), 'objection', lambda *_: None)
    monkeypatch.setattr(swinging_loads, 'unbiased', lambda *_: other)
    model, changed = without_count_bias(search, (soft,))
    assert (model, changed) == (((other,), [(soft, other)]) if is_told else ((soft,), []))


@pytest.mark.parametrize('resonance', [35.0, 40.0, 45.0])
def test_the_springs_take_all_but_the_noise_from_the_target(resonance):
    """Which leaves about one square a row."""
    true = 1.0 / (LOAD * (2.0 * np.pi * resonance) ** 2)
    projection = project(evidence_of_axis(true, noise=0.5), [])
    ratio = springs_in(projection).squares
    before = float(projection.residual @ projection.residual)
    assert before > 2.0 * projection.evidence.rows
    assert before - ratio == pytest.approx(projection.evidence.rows, rel=0.2)


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_a_rigid_axis_has_none_worth_a_name(seed):
    found = springs_in(project(evidence_of_axis(0.0, seed), []))
    assert found is None or found.squares < LEAST


def test_a_load_that_swings_the_other_way_is_no_spring():
    true = 1.0 / (LOAD * (2.0 * np.pi * 35.0) ** 2)
    evidence = evidence_of_axis(true)
    assert springs_in(project(evidence, [])) is not None
    other = project(replace(evidence, target=-evidence.target), [])
    assert springs_in(other) is None
    # followed all the same it ends stiffer than any spring that is believed, and is none
    found = swing_in(other, Look(np.array([true]), 0.0), 2.0 * Rules().price)
    assert found.compliance > 0.0
    assert without_rigid(found.compliance, evidence.observations.runs[0].state) == [0.0]


def test_a_joint_as_stiff_as_any_is_no_part_of_a_candidate(monkeypatch):
    evidence = evidence_of_axis(1.0 / (LOAD * (2.0 * np.pi * 22.0) ** 2))
    effect, projection = CATALOGUE['elastic_transmission'], project(evidence, [])
    _, stiff = stiffnesses_of(evidence.observations.runs[0].state)
    rigid = np.array([RIGID / stiff])
    for compliance, told in ((rigid, 0.0), (1.01 * rigid, 1.01 * rigid[0])):
        monkeypatch.setattr(candidates_module, 'swing_in',
                            lambda *_, found=compliance: Swing(found, 1e6, found))
        candidate = Candidates({effect.name: effect}, evidence, Rules()).best(effect, projection)
        assert effect.exact_at(candidate.hypothesis.shape, 1) == pytest.approx([told])


@pytest.fixture(scope='module')
def machine():
    """Return a machine with swinging arms, made from its physics, and its diagnosis."""
    scenario = draw_scenario(Task('single', 30031, 'elastic_transmission', False))
    scenario = replace(scenario, motions=tuple(
        draw_motion('excitation', scenario.known.robot, duration, seed)
        for seed, duration in ((1, 9.0), (2, 6.5))))
    return scenario, diagnosis_of(scenario, *record_scenario(scenario))


def test_soft_joints_of_the_machine_come_out_with_their_stiffness(machine):
    """Of one machine; `make blind` counts how often springs are named."""
    scenario, diagnosis = machine
    assert [cause.effect.name for cause in diagnosis.causes] == ['elastic_transmission']
    cause, true = diagnosis.causes[0], scenario.hidden[0][1]['compliance']
    assert cause.twins == ()
    stiffness = np.full(4, np.inf)
    stiffness[list(cause.joints)] = cause.parameters['stiffness'].value
    soft = true > 0.1 * true.max()
    assert soft.sum() >= 2
    np.testing.assert_allclose(stiffness[soft], 1.0 / true[soft], rtol=0.1)
    # a joint that hardly twists comes out as one that hardly does
    assert np.all(stiffness[~soft] > 5.0 * stiffness[soft].max())
    assert diagnosis.holdout.explained_fraction > 0.9


def test_the_rigid_machine_of_the_same_seed_has_no_springs(machine):
    scenario = replace(machine[0], machine=machine[0].known.machine, hidden=())
    diagnosis = diagnosis_of(scenario, *record_scenario(scenario))
    assert diagnosis.causes == ()
    assert diagnosis.verdict == 'clean'
    found = springs_in(project(diagnosis.evidence, []))
    assert found is None or found.squares < LEAST


def test_a_lossy_log_of_a_machine_that_rings_tells_its_springs():
    """Each piece begins with a swing that nothing before it explains: it was `unknown`."""
    known = known_machine('reference')
    soft = HIDERS['elastic_transmission'].build(known.machine, {
        'compliance': np.full(4, 1.0 / 5000.0), 'damping_ratio': 0.04})
    logs = []
    for seed, duration in ((1, 8.0), (2, 6.5)):
        log = record(known, soft, draw_motion('excitation', known.robot, duration, seed),
                     fidelity='exact', noise=Noise(), seed=seed, feedforward=known.model,
                     wander=None, name=f'soft {seed}').log
        logs.append(replace(log, segments=tuple(
            slice(first, first + 1550) for first in range(900, len(log.t) - 1600, 1600))))
    found = diagnose([logs[0]], known.robot, holdout_logs=[logs[1]], library={
        name: LIBRARY[name] for name in ('elastic_transmission', 'actuator_lag', 'cogging')})
    assert found.verdict == 'explained'
    named, = found.causes
    assert (named.effect.name, named.joints) == ('elastic_transmission', (0, 1, 2, 3))
    np.testing.assert_allclose(named.parameters['stiffness'].value, 5000.0, rtol=0.05)
    assert found.holdout.explained_fraction > 0.9
    for run in (*found.evidence.observations.runs, *found.holdout.runs):
        assert not run.valid[run.t < run.state.t[0] + FIRST].any()
        assert run.valid[run.t < run.state.t[0] + 2.0 * FIRST].any()


def test_a_descent_tells_what_the_exact_torque_leaves():
    """What the first order misses is not computed at each step of it, but where it ends."""
    evidence = evidence_of_machine((0.0, 2500.0, 0.0, 0.0))
    projection = project(evidence, [])
    found = springs_in(projection)
    run, = evidence.observations.runs
    springs = Springs(run.state)

    def left(missed):
        _, torque = springs.torque(found.compliance, replace(USUAL, **found.told), missed=missed)
        rows = projection.residual - projection.rest(evidence.whitened([run.rows(torque)]))
        return rows @ rows

    assert found.squares == pytest.approx(
        projection.residual @ projection.residual - left(None), rel=1e-9)
    assert left(np.zeros_like(run.state.q)) > 1.2 * left(None)
    assert 1.0 / found.compliance[1] == pytest.approx(2500.0, rel=1e-4)
    assert not without_rigid(found.compliance, run.state)[[0, 2, 3]].any()


def test_no_number_in_common_is_sought_twice_from_the_same_springs(monkeypatch):
    begun = []

    def noted(self, start, *drive, descended=_Twisting.descended):
        begun.append((tuple(start.compliance), tuple(start.told.items()), *drive))
        return descended(self, start, *drive)

    monkeypatch.setattr(_Twisting, 'descended', noted)
    springs_in(project(evidence_of_machine((0.0, 2500.0, 0.0, 0.0)), []))
    assert [[name for name, _ in told] for _, told, *_ in begun if told] == [
        ['damping_ratio'], ['motor_share']]


def test_a_joint_that_an_earlier_search_took_for_rigid_begins_as_the_look_has_it():
    stiffness = np.array((0.0, 2500.0, 4000.0, 0.0))
    projection = project(evidence_of_machine(tuple(stiffness)), [])
    look = first_look(projection).compliance
    known = Swing(np.array((0.0, 1.0 / 2500.0, 0.0, 0.0)), 0.0, look)
    found = springs_in(projection, (known,)).compliance[1:3]
    np.testing.assert_allclose(1.0 / found, stiffness[1:3], rtol=1e-3)


def test_narrow_resonances_are_not_tried_where_wide_ones_leave_more_than_none(monkeypatch):
    projection = project(evidence_of_machine((0.0, 2500.0, 0.0, 0.0)), [])
    look = first_look(projection)
    drives = []

    def noted(self, start, drive=USUAL, descended=_Twisting.descended):
        drives.append(drive)
        return descended(self, start, drive)

    monkeypatch.setattr(_Twisting, 'descended', noted)
    assert swing_in(projection, look, 2.0 * Rules().price).squares > 0.0
    assert USUAL in drives
    drives.clear()
    other = project(replace(projection.evidence, target=0.05 * projection.evidence.target), [])
    found = swing_in(other, Look(look.compliance[::-1], look.squares), 2.0 * Rules().price)
    assert found.squares < 0.0
    assert drives == [WIDE]


@pytest.mark.parametrize(('stiffness', 'seed'), [
    ((0.0, 0.0, 2837.0, 0.0), 4), ((0.0, 13367.0, 4914.0, 0.0), 8), ((0.0, 0.0, 0.0, 2747.0), 1),
    ((0.0, 10761.0, 2709.0, 3082.0), 50)])
def test_springs_beside_rigid_joints_leave_little_more_than_noise(stiffness, seed):
    """Rigid joints may swing much as soft ones do; from elsewhere a descent ends in between."""
    projection = project(evidence_of_machine(stiffness, seed), [])
    assert projection.squares - springs_in(projection).squares < 1e-3 * projection.squares
