"""Recordings that differ among themselves, and changes beside causes without a name.

The machines are made from their physics.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hidden.hiders import HIDERS
from hidden.machines import known_machine
from hidden.motions import draw_motion
from hidden.recording import record

from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_file import EffectEntry
from par4_dynamics.parameters import Parameter
from par4_identification.changes import between_logs
from par4_identification.changes.between_logs import differences_between_logs
from par4_identification.changes.changes import (
    changes_between,
    changes_since_model,
    model_of_bags,
)
from par4_identification.changes.explanation import MOST
from par4_identification.changes.joint_values import fitted_values
from par4_identification.changes.readings import Added, FrictionFactor, GainFactor
from par4_identification.diagnosis.diagnosis import CONDITIONING, LIBRARY, _alike, diagnose
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import observe, with_nominal
from par4_identification.diagnosis.search.rules import rules_of_no_cause
from par4_identification.jobs import diagnose as jobs
from par4_identification.jobs.recorded import Recorded
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.rows import runs_of_log
from par4_sim.machines.noise import Noise

KNOWN = known_machine('reference')
COGGING = {'amplitude': np.array((0.0, 0.35, 0.0, 0.0)), 'periods': 30.0, 'phase': np.zeros(4)}
SEARCHED = {name: LIBRARY[name] for name in ('cogging', 'torque_offset', 'theta_friction')}


def recorded(machine, name, seed, kind='excitation'):
    return record(KNOWN, machine, draw_motion(kind, KNOWN.robot, 8.0, seed), fidelity='exact',
                  noise=Noise(), seed=seed, feedforward=KNOWN.model, wander=None, name=name).log


def cold(machine, factor=1.2):
    friction = machine.friction
    return replace(machine, friction=replace(
        friction, coulomb=factor * friction.coulomb, viscous=factor * friction.viscous))


@pytest.fixture(scope='module')
def cogging():
    return HIDERS['cogging'].build(KNOWN.machine, COGGING)


def diagnosed(fitted, kept, **more):
    return diagnose(fitted, KNOWN.robot, holdout_logs=kept, library=SEARCHED, **more)


def test_a_cold_recording_is_told_and_the_cause_named_without_it(cogging):
    logs = [recorded(cold(cogging), 'cold', 1), recorded(cogging, 'warm', 2)]
    kept = [recorded(cogging, 'later', 3)]
    first = diagnosed(logs, kept)
    assert first.verdict == 'partly_explained'
    found = differences_between_logs(first, KNOWN.robot, None)
    item, = found.of_logs
    assert item.log == 'cold'
    read, = item.explanation.read
    assert read.reading == FrictionFactor(None, ('coulomb_friction', 'viscous_friction'))
    assert read.size == pytest.approx(0.2, abs=0.02)
    assert found.share > 0.9
    again = diagnosed(logs, kept, apart=found.apart)
    assert [cause.effect.name for cause in again.causes] == ['cogging']
    assert again.verdict == 'explained'


def test_a_held_out_recording_may_be_the_one_that_differs(cogging):
    logs = [recorded(cogging, 'one', 1), recorded(cogging, 'two', 2)]
    kept = [recorded(cold(cogging), 'cold', 3)]
    found = differences_between_logs(diagnosed(logs, kept), KNOWN.robot, None)
    assert [item.log for item in found.of_logs] == ['cold']


def with_gain(machine, joint):
    relative = np.zeros(4)
    relative[joint] = 0.05
    return HIDERS['drive_gain_error'].build(machine, {'relative': relative})


def loaded(machine, payload):
    return replace(machine, bodies=replace(
        machine.bodies, platform_mass_1=machine.bodies.platform_mass_1 + payload))


def readings_of(between):
    return {(item.log, read.reading): read.size for item in between.of_logs
            for read in item.explanation.read}


def with_offset(machine, offset):
    return HIDERS['torque_offset'].build(machine, {'offset': np.array((0.0, offset, 0.0, 0.0))})


@pytest.mark.parametrize('of_all', [0.0, 0.4])
def test_an_offset_of_one_recording_is_no_weight_of_an_arm(cogging, of_all):
    """What all have is still a cause."""
    usual, drifted = (with_offset(cogging, of_all + more) for more in (0.0, -0.6))
    logs = [recorded(usual, 'usual', 1), recorded(drifted, 'drifted', 2)]
    kept = [recorded(usual, 'later', 3)]
    found = differences_between_logs(diagnosed(logs, kept), KNOWN.robot, None)
    assert readings_of(found) == {
        ('drifted', Added(1, 'torque_offset')): pytest.approx(-0.6, abs=0.02)}
    again = diagnosed(logs, kept, apart=found.apart)
    assert again.verdict == 'explained'
    told = {cause.effect.name: cause for cause in again.causes}
    assert set(told) == {'cogging', *(['torque_offset'] if of_all else [])}
    if of_all:
        assert told['torque_offset'].parameters['offset'].value == (
            pytest.approx(of_all, abs=0.02),)
        beside = differences_between_logs(diagnosed(logs, kept), KNOWN.robot, None, alike=again,
                                          before=found)
        assert beside.is_like(found)


def test_no_load_carries_the_offset_of_a_recording():
    run, = runs_of_log(recorded(KNOWN.machine, 'usual', 1), KNOWN.robot)
    apart = replace(KNOWN.model, apart={'torque_offset': np.full(4, 0.6)})
    np.testing.assert_array_equal(apart.body_torque(run.state), KNOWN.model.body_torque(run.state))


def test_a_wrong_gain_of_all_recordings_scales_the_payload_of_one():
    """It was read as a gain and a friction of that joint that had changed, beside the payload."""
    machine = with_gain(KNOWN.machine, 3)
    logs = [recorded(machine, 'bare', 1), recorded(loaded(machine, 0.4), 'loaded', 2)]
    kept = [recorded(machine, 'later', 3)]
    library = {'drive_gain_error': LIBRARY['drive_gain_error']}
    whole = diagnose(logs, KNOWN.robot, holdout_logs=kept, library={},
                     rules=rules_of_no_cause(of_axis=False))
    before = differences_between_logs(whole, KNOWN.robot, None)
    assert len(readings_of(before)) > 1
    alike = diagnose(logs, KNOWN.robot, holdout_logs=kept, library=library, apart=before.apart)
    between = differences_between_logs(whole, KNOWN.robot, None, alike=alike, before=before)
    assert readings_of(between) == {
        ('loaded', Added(None, 'platform_mass_1')): pytest.approx(0.4, abs=0.003)}
    again = diagnose(logs, KNOWN.robot, holdout_logs=kept, library=library, apart=between.apart)
    cause, = again.causes
    assert (cause.effect.name, cause.joints) == ('drive_gain_error', (3,))
    assert cause.parameters['relative'].value == (pytest.approx(0.05, abs=0.002),)


def test_a_load_in_one_recording_is_taken_out_before_causes_are_looked_for(monkeypatch):
    """There was no end of causes, each of which explained some of what the load did."""
    logs = [recorded(KNOWN.machine, 'bare', 1), recorded(loaded(KNOWN.machine, 0.6), 'loaded', 2)]
    check = check_setup(logs, KNOWN.robot, None)
    searched = []

    def watched(*args):
        library, apart = args[4], args[8]
        searched.append((library, set(apart)))
        return diagnose(*args[:4], SEARCHED if library is None else library, *args[5:])

    monkeypatch.setattr(jobs, 'diagnose', watched)
    measured = Recorded(check, 1, CONDITIONING, None, None, False)
    found, between = jobs._diagnosis(measured, lambda _step: None)
    assert readings_of(between) == {
        ('loaded', Added(None, 'platform_mass_1')): pytest.approx(0.6, abs=0.005)}
    assert searched == [({}, set()), (None, {'loaded'})]
    assert found.verdict in ('clean', 'explained')


def test_what_a_recording_has_alone_is_taken_out_of_rows_and_samples():
    """Loads on springs swing at first as the samples of the torque tell."""
    log = recorded(loaded(KNOWN.machine, 0.4), 'loaded', 2)
    log = replace(log, segments=(slice(0, 4000), slice(4000, len(log.t))))
    at_rest, run = runs_of_log(log, KNOWN.robot)
    assert at_rest.state.measured is None
    alike = _alike(run, {'platform_mass_1': np.full(4, 0.4)})
    lighter = run.state.measured - alike.state.measured
    assert np.abs(lighter).max() > 1.0
    np.testing.assert_allclose(run.rows(lighter), run.tau - alike.tau, atol=1e-9)


def test_a_gain_of_the_held_out_recording_alone_is_told_whatever_the_verdict(cogging):
    """What it leaves there was called noise that wanders: a model that leaves so much was clean."""
    logs = [recorded(cogging, 'one', 1), recorded(cogging, 'two', 2)]
    found = diagnosed(logs, [recorded(with_gain(cogging, 2), 'gain', 3)])
    for verdict in ('clean', 'explained', 'unknown'):
        between = differences_between_logs(replace(found, verdict=verdict), KNOWN.robot, None)
        item, = between.of_logs
        assert item.log == 'gain'
        read, = item.explanation.read
        assert read.reading == GainFactor(2)
        assert read.size == pytest.approx(0.05, abs=0.005)


def test_the_recordings_are_compared_with_the_one_that_takes_fewest_readings(cogging, monkeypatch):
    """Not with the only one that has a wrong gain, which would be told of all others."""
    logs = [recorded(with_gain(cogging, 3), 'gain', 1),
            recorded(loaded(cogging, 0.2), 'loaded', 2),
            recorded(cogging, 'bare', 4)]
    found = diagnosed(logs, [recorded(cogging, 'later', 3)])
    monkeypatch.setattr(between_logs, '_most_alike', list)  # the wrong gain first
    between = differences_between_logs(found, KNOWN.robot, None)
    assert set(readings_of(between)) == {
        ('gain', GainFactor(3)), ('loaded', Added(None, 'platform_mass_1'))}


def test_a_difference_that_no_reading_tells_counts_as_more_than_all_that_are_told():
    """The others would be compared with the log that nothing explains, and nothing be told."""
    def differing(*readings):
        return [SimpleNamespace(explanation=SimpleNamespace(read=read)) for read in readings]

    told = differing(('payload', 'gain', 'friction'), ('gain',))
    assert between_logs._readings(told) == 4
    assert between_logs._readings(differing(())) > between_logs._readings(
        differing(tuple(range(MOST))))


def test_rods_that_the_model_lumps_are_no_change_between_a_slow_and_a_fast_recording():
    """Lumped rods make other masses of a slow motion: the payload came out 40 % too large."""
    rods = HIDERS['distributed_rods'].build(KNOWN.machine, {'rod_mass': 0.08, 'bar_mass': 0.05})
    logs = [recorded(rods, 'one', 1), recorded(rods, 'two', 2, 'cycles')]
    found = diagnosed(logs, [recorded(loaded(rods, 0.1), 'loaded', 3, 'slow')])
    item, = differences_between_logs(found, KNOWN.robot, None).of_logs
    read, = item.explanation.read
    assert (item.log, read.reading) == ('loaded', Added(None, 'platform_mass_1'))
    assert read.size == pytest.approx(0.1, abs=0.005)


def test_a_force_without_a_name_is_no_difference_between_recordings():
    """It moves the parameters of a slow motion otherwise than those of a fast one."""
    force = HIDERS['cable_spring'].build(KNOWN.machine, {
        'stiffness': np.full(3, 60.0), 'anchor': np.array((0.3, 0.0, -0.3))})
    logs = [recorded(force, 'cycles', 1, 'cycles'), recorded(force, 'excitation', 2)]
    found = diagnosed(logs, [recorded(force, 'circles', 3, 'circles')])
    assert found.verdict in ('unknown', 'partly_explained')
    assert differences_between_logs(found, KNOWN.robot, None) is None


def test_a_recording_with_values_that_no_machine_has_is_not_compared():
    """A law of friction that is missing makes viscous friction negative where a motion is slow."""
    stribeck = HIDERS['stribeck'].build(KNOWN.machine, {
        'stribeck_torque': np.full(4, 1.2), 'stribeck_velocity': 0.4})
    for machine, is_compared in ((KNOWN.machine, True), (stribeck, False)):
        rows = observe(runs_of_log(recorded(machine, 'slow', 2, 'slow'), KNOWN.robot),
                       KNOWN.robot, 'paper', None)
        assert (between_logs._values(rows, ()) is not None) == is_compared


def test_joints_carry_what_was_taken_out_of_a_recording():
    run, = runs_of_log(recorded(loaded(KNOWN.machine, 0.4), 'loaded', 2), KNOWN.robot)
    rows = observe([_alike(run, {'platform_mass_1': np.full(4, 0.4)})], KNOWN.robot, 'paper', None)
    bare, = with_nominal(rows, KNOWN.model).runs
    heavier = replace(KNOWN.model, values={
        **KNOWN.model.values, 'platform_mass_1': KNOWN.model.values['platform_mass_1'] + 0.4})
    known, expected = bare.state.known, heavier.nominal(run.state)
    np.testing.assert_allclose(known.load, expected.load, atol=1e-9)
    np.testing.assert_allclose(bare.state.torque_by_qdd, replace(
        run.state, nominal=expected).torque_by_qdd, atol=1e-9)
    assert np.abs(known.torque - expected.torque).max() > 1.0  # which the rows do not have


def model_with_gain(content, joint, relative):
    """Return a model file that knows the gain of a joint."""
    return content.model_copy(update={'effects': (*content.effects, EffectEntry(
        effect='drive_gain_error', joints=(joint,),
        parameters={'relative': Parameter(value=(relative,), unit='1')}))})


def test_what_a_model_knows_follows_masses_that_it_does_not_know(model_file):
    """A known gain scaled the old masses: a payload left a mass beside the arm of that joint."""
    machine = loaded(with_gain(KNOWN.machine, 1), 0.5)
    known = model_with_gain(model_file, 1, 0.05)
    logs = [recorded(machine, 'one', 1)], [recorded(machine, 'two', 2)]
    found = diagnose(logs[0], KNOWN.robot, known, logs[1], library={
        name: LIBRARY[name] for name in ('arm_mass_offset', 'torque_offset')})
    assert (found.causes, found.unnamed) == ((), ())
    changes = changes_since_model(found, KNOWN.robot, known, 'M')
    assert not changes.beyond_readings
    read, = changes.read
    assert read.reading == Added(None, 'platform_mass_1')
    assert read.size == pytest.approx(0.5, abs=0.003)


def test_a_gain_that_nobody_knew_is_no_change_beside_a_payload():
    """It scales the payload: torques of that joint seemed to have grown by 0.5 %."""
    machine = with_gain(KNOWN.machine, 1)
    earlier = [recorded(machine, 'was', 5)]
    baseline = model_of_bags(earlier, KNOWN.robot, None)
    now = loaded(machine, 0.5)
    found = diagnose([recorded(now, 'one', 1)], KNOWN.robot, baseline, [recorded(now, 'two', 2)],
                     library={'drive_gain_error': LIBRARY['drive_gain_error']})
    assert [(cause.effect.name, cause.joints) for cause in found.causes] == [
        ('drive_gain_error', (1,))]
    changes = changes_between(found, KNOWN.robot, earlier, baseline, 'was')
    read, = changes.read
    assert read.reading == Added(None, 'platform_mass_1')
    assert read.size == pytest.approx(0.5, abs=0.003)


def test_the_same_is_told_where_it_stays_within_its_deviation():
    def differences(size, reading=None, log='loaded'):
        read = SimpleNamespace(reading=reading or Added(None, 'platform_mass_1'), size=size,
                               std=0.01)
        return between_logs.LogDifferences((), (SimpleNamespace(
            log=log, other='bare', explanation=SimpleNamespace(read=(read,))),), 0.9)

    first = differences(0.4)
    assert differences(0.409).is_like(first)
    assert not differences(0.411).is_like(first)
    assert not differences(0.4, GainFactor(None)).is_like(first)
    assert not differences(0.4, log='other').is_like(first)


def test_a_diagnosis_mends_what_leaves_a_quarter_of_the_squares():
    def leaving(fitted, heldout):
        return SimpleNamespace(fitted_rms=fitted, holdout=SimpleNamespace(
            extended_rms=np.full(4, heldout), noise_floor_rms=np.full(4, 0.1)))

    whole = leaving(1.0, 1.0)
    assert between_logs.mends(leaving(0.4, 0.4), whole)
    assert between_logs.mends(leaving(0.1, 0.1), leaving(0.1, 1.0))
    assert not between_logs.mends(leaving(0.6, 0.6), whole)
    assert not between_logs.mends(leaving(1.0, 0.1), whole)


def test_what_leaves_nothing_unexplained_is_not_compared(cogging):
    found = diagnosed([recorded(cogging, 'one', 1)], [recorded(cogging, 'two', 2)])
    assert found.verdict == 'explained'
    assert differences_between_logs(found, KNOWN.robot, None) is None


def test_a_cause_that_has_some_columns_of_its_effect_is_fitted_beside_parameters(cogging):
    """The values of all columns were looked for among those of some, which ended in an error."""
    found = diagnosed([recorded(cogging, 'one', 1)], [recorded(cogging, 'two', 2)])
    rods = Hypothesis(CATALOGUE['distributed_rods'], {}, (0, 1, 2, 3), (1,))
    values = fitted_values(found.evidence.observations, (rods,))
    assert np.all(values.std > 0.0)


@pytest.fixture(scope='module')
def hose():
    """Return a machine whose platform drags something along that no name of `SEARCHED` is."""
    return HIDERS['cable_spring'].build(KNOWN.machine, {
        'stiffness': np.full(3, 30.0), 'anchor': np.array((0.4, 0.1, -0.3))})


@pytest.fixture(scope='module')
def model_file():
    return model_of_bags([recorded(KNOWN.machine, 'sound', 7)], KNOWN.robot, None)


@pytest.mark.parametrize('payload', [0.0, 0.2])
def test_what_an_unnamed_force_makes_of_base_parameters_is_no_change(hose, model_file, payload):
    """Fitted without it, weights and friction of single joints seem to have changed."""
    machine = loaded(hose, payload)
    found = diagnosed([recorded(machine, 'one', 1)], [recorded(machine, 'two', 2)])
    assert found.unnamed
    assert len(found.unnamed_hypotheses) == len(found.unnamed)
    without = replace(found, unnamed_hypotheses=())
    before = changes_since_model(without, KNOWN.robot, model_file, 'M')
    true = {Added(None, 'platform_mass_1')} if payload else set()
    assert before.beyond_readings or {item.reading for item in before.read} != true
    changes = changes_since_model(found, KNOWN.robot, model_file, 'M')
    assert not changes.beyond_readings
    assert {item.reading for item in changes.read} == true
    assert all(item.size == pytest.approx(payload, abs=0.02) for item in changes.read)
