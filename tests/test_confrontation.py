"""The simulation against the measurement, the model before and after; what is hidden is physics."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest
from measured import excitation, simulation_of

from par4_dynamics.model_file import EffectEntry, read_model_file, write_model_file
from par4_dynamics.model_from_file import build_model, read_model
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import state_of_joints
from par4_identification.confrontation import confrontation
from par4_identification.confrontation.closed_loop import _begun
from par4_identification.confrontation.confrontation import (
    Unsimulated,
    confront,
    confront_diagnosis,
    model_before,
)
from par4_identification.diagnosis.diagnosis import CONDITIONING, LIBRARY, diagnose
from par4_identification.diagnosis.evidence.estimates import effect_parameters
from par4_identification.diagnosis.evidence.evidence import gather
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.evidence.observations import observe, with_nominal
from par4_identification.diagnosis.evidence.whitener import flat_whitener
from par4_identification.fitting.realisable import realisable
from par4_identification.logs.log import Log, Reference
from par4_identification.logs.read_log import read_log
from par4_identification.reports.outcome.confrontation import (
    confrontation_in_words,
    remarks_of_confrontation,
    simulation_json,
)
from par4_identification.reports.outcome.outcome import over_joints
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import Simulation, build_plant, build_simulation
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.machines.noise import Noise
from robots import REFERENCE, model_with, with_drives

TABLE_FILE = read_model_file('table1')
TABLE = read_model('table1', REFERENCE)
CLEAN = machine_of_model(REFERENCE, TABLE)
SLOTS, HEIGHT = 22, 0.6
AHEAD = 0.5
"""Seconds of rest before the motion."""


def cogging(time, q, qd):  # noqa: ARG001
    """Return a torque that returns SLOTS times a turn, 0.6 N m high."""
    return HEIGHT * np.imag(np.exp(1j * (SLOTS * np.asarray(q) + np.array((0.3, 1.0, 2.0, -1.0)))))


HIDDEN = {
    'cogging': (
        replace(CLEAN, loads=(cogging,)),
        {'amplitude': (HEIGHT,) * 4, 'periods': float(SLOTS), 'phase': (0.3, 1.0, 2.0, -1.0)}),
    'stribeck': (
        replace(CLEAN, friction=replace(CLEAN.friction, stribeck_torque=np.full(4, 1.2),
                                        stribeck_velocity=np.full(4, 0.3))),
        {'stribeck_torque': 1.2, 'stribeck_velocity': 0.3})}
"""Machines and, as a model file says it, what is hidden in them."""


def extended_by(effect, values):
    parameters = {name: Parameter(value=value) for name, value in values.items()}
    return TABLE_FILE.model_copy(update={'effects': (
        EffectEntry(effect=effect, parameters=parameters),)})


def log_of(machine, *, fidelity='exact', duration=8.0, seed=0, feedforward=TABLE, name='log'):
    """Return the log, reference and feedforward included, of an excitation on a machine."""
    motion = excitation('reference', duration, seed)
    simulation = simulation_of(REFERENCE, machine, TABLE, seed, 0.05)
    if fidelity != 'exact':
        simulation = Simulation(
            REFERENCE, build_plant(machine, fidelity), 1e-3, REFERENCE.drives.torque_limit,
            holding(), machine.amplifier, machine.sensors, Noise(torque_noise=0.05), seed)
    start = simulation.time + AHEAD
    simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
    tau = None
    if feedforward is not None:
        tau = feedforward.torque(state_of_joints(REFERENCE.geometry, motion.t, motion.q, motion.qd,
                                                 motion.qdd))
        simulation.queue_effort(start + motion.t, tau)
    told = simulation.next_samples(round((duration + AHEAD) / 1e-3))
    simulation.close()
    return Log(name, REFERENCE.joint_names, 1, 1e-3, np.arange(len(told.q)) * 1e-3, told.q,
               told.effort, (slice(0, len(told.q)),),
               Reference(AHEAD + motion.t, motion.q, motion.qd, motion.qdd, tau), None)


def holding():
    still = np.zeros((1, 4))
    q = build_simulation(REFERENCE, TABLE, 'exact').q[None]
    return TABLE.torque(state_of_joints(REFERENCE.geometry, np.zeros(1), q, still, still))[0]


@pytest.fixture(scope='module')
def clean_log():
    return log_of(CLEAN)


@pytest.fixture(scope='module')
def cogged_log():
    return log_of(HIDDEN['cogging'][0], seed=3)


@pytest.mark.parametrize(('effect', 'plant', 'duration', 'length', 'nearer', 'floors'), [
    ('cogging', 'fast', 4.0, 2.5, 8.0, 1.8), ('stribeck', 'exact', 8.0, 3.5, 3.0, 1.8)])
def test_the_extended_model_brings_the_simulation_to_the_measurement(
        effect, plant, duration, length, nearer, floors):
    machine, values = HIDDEN[effect]
    log = log_of(machine, fidelity=plant, duration=duration, seed=3)
    steps = []
    found = confront(REFERENCE, TABLE_FILE, extended_by(effect, values), log, fidelity=plant,
                     length=length, progress=steps.append)
    assert found.followed == 'reference', found.why
    torque, motion = found.torque, found.motion
    assert np.all(torque.baseline > nearer * torque.extended)
    assert np.all(torque.extended < floors * torque.floor)
    assert np.all(motion.baseline > 2.0 * motion.extended)
    assert np.all(motion.extended < floors * motion.floor)
    assert any(step.startswith('simulating the old model') for step in steps)
    assert np.all(found.tracking[0] > 2.0 * found.tracking[1])
    # what is counted is what is shown
    left = np.where(found.valid, found.extended - found.measured, 0.0)
    np.testing.assert_allclose(np.sqrt((left ** 2).sum(axis=0) / found.valid.sum(axis=0)),
                               torque.extended)


def test_a_diagnosis_is_confronted_by_its_own_filters(clean_log, monkeypatch):
    """Encoders may be so coarse that rows end below the usual cut-off."""
    own = replace(CONDITIONING, torque_cutoff_hz=16.0)
    held = SimpleNamespace(name=clean_log.name, t=clean_log.t, conditioning=own,
                           valid=np.ones((len(clean_log.t), 4), dtype=bool))
    confronted = mock.Mock()
    for name, stand_in in (('confront', confronted), ('model_before', lambda _: TABLE_FILE),
                           ('model_after', lambda _: TABLE_FILE)):
        monkeypatch.setattr(confrontation, name, stand_in)
    confront_diagnosis(SimpleNamespace(holdout=SimpleNamespace(runs=[held])), REFERENCE,
                       [clean_log])
    assert own in confronted.call_args.args


def test_on_a_clean_machine_before_and_after_are_one_and_near_the_floor(clean_log):
    found = confront(REFERENCE, TABLE_FILE, TABLE_FILE, clean_log, fidelity='exact', length=3.5,
                     conditioning=replace(CONDITIONING, row_rate_hz=50.0))
    assert np.diff(found.t).min() == pytest.approx(0.02)
    assert found.same
    assert found.tracking is None
    np.testing.assert_array_equal(found.baseline, found.extended)
    assert np.all(found.torque.extended < 1.3 * found.torque.floor)
    assert np.all(found.motion.extended < 1.3 * found.motion.floor)
    text = ' '.join(remark.text for remark in remarks_of_confrontation(found))
    assert 'extended model' not in text


def test_without_reference_the_measured_motion_is_followed(cogged_log):
    log = replace(cogged_log, reference=None)
    found = confront(REFERENCE, TABLE_FILE, extended_by('cogging', HIDDEN['cogging'][1]), log,
                     fidelity='exact', length=4.0)
    assert found.followed == 'measured motion'
    assert 'no reference' in found.why
    assert found.motion is None
    assert found.deviations is None
    assert np.all(found.torque.baseline > 5.0 * found.torque.extended)
    assert np.all(found.torque.extended < 2.0 * found.torque.floor)
    assert 'only the torque is compared' in confrontation_in_words(found)


def test_a_reference_that_does_not_say_enough_is_not_followed(clean_log):
    whole = clean_log.reference
    for reference in (replace(whole, qdd=np.full_like(whole.qdd, np.nan)),
                      replace(whole, t=whole.t + 7.0)):
        found = confront(REFERENCE, TABLE_FILE, TABLE_FILE, replace(clean_log, reference=reference),
                         fidelity='exact', length=3.0)
        assert found.followed == 'measured motion'
        assert 'lacks points' in found.why
        assert not found.drives_unlike
        assert np.all(found.torque.extended < 2.0 * found.torque.floor)


@pytest.mark.parametrize('gain', ['velocity_gain', 'position_gain'])
def test_other_drives_are_noticed_and_the_motion_is_not_compared(gain, cogged_log):
    robot = with_drives(**{gain: 1.5 * getattr(REFERENCE.drives, gain)})
    found = confront(robot, TABLE_FILE, TABLE_FILE, cogged_log, fidelity='exact', length=3.0)
    assert found.followed == 'measured motion'
    assert found.drives_unlike
    assert found.motion is None
    assert any('motion was not compared' in remark.text and not remark.good
               for remark in remarks_of_confrontation(found))


def test_feedforward_that_the_bag_lacks_is_noticed(clean_log):
    log = replace(clean_log, reference=replace(clean_log.reference, effort=None))
    found = confront(REFERENCE, TABLE_FILE, TABLE_FILE, log, fidelity='exact', length=3.0)
    assert found.drives_unlike
    assert np.all(found.torque.extended < 2.0 * found.torque.floor)


def test_without_any_feedforward_the_reference_is_followed():
    found = confront(REFERENCE, TABLE_FILE, TABLE_FILE, log_of(CLEAN, feedforward=None),
                     fidelity='exact', length=3.0)
    assert found.followed == 'reference', found.why
    assert np.all(found.torque.extended < 1.6 * found.torque.floor)
    # the paths stray by far more than the two of them differ
    assert np.all(found.deviations[0].std(axis=0) > 20.0 * found.motion.extended)


def test_drives_that_cannot_follow_give_words_and_no_numbers(clean_log):
    weak = with_drives(velocity_gain=1.0, position_gain=5.0, integral_gain=0.0, torque_limit=8.0)
    with pytest.raises(InputError, match='cannot follow the measured motion'):
        confront(weak, TABLE_FILE, TABLE_FILE, replace(clean_log, reference=None),
                 fidelity='exact', length=3.0)


def test_friction_that_drifts_drifts_on_the_clock_of_the_log():
    drift = {'drop': 0.15, 'viscous_drop': 0.4, 'time_constant': 3.0}
    warm = extended_by('friction_drift', drift)
    log = log_of(machine_of_model(REFERENCE, build_model(REFERENCE, warm)), seed=3)
    found = confront(REFERENCE, TABLE_FILE, warm, log, (4.0, np.inf), 'exact', 4.0)
    assert found.start > 4.0
    assert np.all(found.torque.extended < 1.6 * found.torque.floor)
    assert np.all(found.torque.baseline > 5.0 * found.torque.extended)


def test_a_model_on_a_clock_that_begins_later_has_the_same_friction():
    """All friction of a machine that is warm already, that of the effects beside the drift, too."""
    model = model_with(TABLE, 'friction_drift', drop=0.2, viscous_drop=0.4, time_constant=3.0)
    for name, values in (
            ('coulomb_asymmetry', {'asymmetry': (0.3, -0.2, 0.1, 0.25)}),
            ('viscous_asymmetry', {'asymmetry': (0.1, -0.2, 0.05, 0.15)}),
            ('nonlinear_viscous', {'torque': (0.1, 0.05, 0.02, 0.2), 'exponent': 1.5}),
            ('load_dependent_friction', {'coefficient': (0.05, 0.02, 0.1, 0.03)}),
            ('stribeck', {'stribeck_torque': 0.4, 'stribeck_velocity': 0.2}),
            ('presliding', {'distance': 3e-3}),
            ('joint_friction_difference', {'coulomb': (0.2, -0.3, 0.1, 0.0),
                                           'viscous': (-0.1, 0.2, 0.0, 0.05)})):
        model = model_with(model, name, **values)
    motion = excitation('reference', 4.0, 5)
    early = state_of_joints(REFERENCE.geometry, motion.t, motion.q, motion.qd, motion.qdd)
    late = replace(early, t=early.t + 1.5)
    np.testing.assert_allclose(_begun(model, 1.5).torque(early), model.torque(late), atol=1e-9)
    assert np.abs(model.torque(early) - model.torque(late)).max() > 0.5


def test_a_stretch_is_calm_where_it_begins_lively_and_inside_what_is_asked(clean_log):
    found = confront(REFERENCE, TABLE_FILE, TABLE_FILE, clean_log, (2.0, 7.0), 'exact', 3.0)
    assert 2.0 <= found.start < found.end <= 7.0
    assert found.end - found.start < 3.0
    assert found.valid.mean() > 0.5
    with pytest.raises(InputError, match='give a longer bag'):
        confront(REFERENCE, TABLE_FILE, TABLE_FILE, clean_log, (2.0, 3.0), 'exact')


# ------------------------------------------------------------------------- from a diagnosis


@pytest.fixture(scope='module', params=['cogging', 'stribeck'])
def diagnosed(request):
    machine, _ = HIDDEN[request.param]
    fit = log_of(machine, duration=10.0, seed=1, name='fit')
    heldout = log_of(machine, duration=8.0, seed=2, name='held out')
    some = {name: LIBRARY[name] for name in (*HIDDEN, 'torque_offset')}
    result = diagnose([fit], REFERENCE, holdout_logs=[heldout], library=some)
    assert [cause.effect.name for cause in result.causes] == [request.param]
    return machine, result, [fit, heldout]


def test_a_diagnosis_is_confronted_on_data_held_out(diagnosed):
    _, result, logs = diagnosed
    before = model_before(result)
    assert before.effects == ()
    assert before.parameters['coulomb_friction'].value == pytest.approx(
        result.base_before['coulomb_friction'].value)
    found = confront_diagnosis(result, REFERENCE, logs, 'exact')
    assert found.log == 'held out'
    assert over_joints(found.torque.baseline) > 3.0 * over_joints(found.torque.extended)
    assert np.all(found.torque.extended < 2.0 * found.torque.floor)
    content = simulation_json(found)
    assert list(content) == ['bag', 'start', 'end', 'fidelity', 'followed', 'why', 'torque',
                             'motion', 'tracking']
    assert content['torque']['extended_rms'] == found.torque.extended.tolist()
    short = confront_diagnosis(result, REFERENCE, logs, 'exact', length=1.0)
    assert isinstance(short, Unsimulated)
    assert simulation_json(short) == {'failed': short.reason}


def test_feedforward_from_the_extended_model_helps_the_machine_that_hides_the_effect(diagnosed):
    """The machine itself, made from physics: less than half the tracking error."""
    machine, result, _ = diagnosed

    def error(model_file):
        log = log_of(machine, seed=9, feedforward=build_model(REFERENCE, model_file))
        moving = log.t > AHEAD + 1.0  # the integrals have handed over to the feedforward
        wanted = log.reference.q[:np.count_nonzero(log.t >= AHEAD - 1e-9)][-moving.sum():]
        return np.sqrt(np.mean((log.q[moving] - wanted) ** 2, axis=0))

    assert np.all(error(model_before(result)) > 2.0 * error(result.extended_model))


def test_an_axis_has_no_plant(diagnosed):
    _, result, logs = diagnosed
    axis = Axis(schema='par4/axis/1', name='slide', joint='slide', kind='linear', gain=35.0)
    assert confront_diagnosis(result, axis, logs) is None
    assert simulation_json(None) is None
    assert remarks_of_confrontation(None) == ()


def test_feedforward_is_read_from_the_bag(tmp_path):
    motion = excitation('reference', 4.0, 4)
    simulate_to_bag(build_simulation(REFERENCE, TABLE, 'exact'), motion, REFERENCE,
                    tmp_path / 'bag', TABLE)
    reference = read_log(tmp_path / 'bag', REFERENCE).reference
    expected = TABLE.torque(state_of_joints(REFERENCE.geometry, motion.t, motion.q, motion.qd,
                                            motion.qdd))
    np.testing.assert_allclose(reference.effort, expected)
    simulate_to_bag(build_simulation(REFERENCE, TABLE, 'exact'), motion, REFERENCE,
                    tmp_path / 'without')
    assert read_log(tmp_path / 'without', REFERENCE).reference.effort is None


# ------------------------------------------------- every effect that a diagnosis can name runs


@pytest.fixture(scope='module')
def evidence(clean_log):
    """Return the whitened rows of a short log, to let a fit write any effect into a model."""
    part = slice(0, 3000)
    short = replace(clean_log, t=clean_log.t[part], q=clean_log.q[part], tau=clean_log.tau[part],
                    segments=(part,))
    observations = with_nominal(observe(runs_of_log(short, REFERENCE, CONDITIONING), REFERENCE,
                                        'paper', None), TABLE)
    return gather(observations, flat_whitener(observations, np.full(4, 0.05)))


def plausible(effect, state, wanted=4):
    """Return a shape and coefficients (K, 4) that could be real, as large as they may be."""
    shapes = effect.shapes(state)
    shape = shapes[len(shapes) // 2]
    count, random = effect.columns(state, shape).shape[2], np.random.default_rng(1)
    found = []
    for size in (0.0,) if effect.fixed_coefficients else np.geomspace(100.0, 1e-6, 17):
        for draw in random.uniform(-1.0, 1.0, (30, count, 1 if effect.shared else 4)):
            coefficients = (size * draw if size else 1.0) * np.ones((count, 4))
            values = effect.values(coefficients, shape)
            exactly = {key: np.zeros_like(value) for key, value in values.items()}
            if effect.implausible(values, exactly, TABLE.values) is None:
                found.append(coefficients)
            if len(found) == wanted:
                return shape, found
    assert found, f'no plausible {effect.name}'
    return shape, found


@pytest.mark.parametrize('name', LIBRARY)
def test_every_effect_of_an_extended_model_runs_as_it_is(name, evidence, tmp_path):
    effect, state = LIBRARY[name], evidence.observations.runs[0].state
    shape, found = plausible(effect, state)
    hypothesis = Hypothesis(effect, shape, (0, 1, 2, 3))
    for coefficients in found:
        fit = replace(solve(evidence, [hypothesis]), coefficients=(coefficients,))
        entry = EffectEntry(effect=name, joints=hypothesis.joints,
                            parameters=effect_parameters(evidence, hypothesis, fit, 0))
        path = tmp_path / 'extended_model.yaml'
        write_model_file(path, realisable(TABLE_FILE.model_copy(update={'effects': (entry,)})))
        model = read_model(path, REFERENCE)
        machine_of_model(REFERENCE, model)

    # one of them in motion
    torque = model.torque(state_of_joints(REFERENCE.geometry, state.t, state.q, state.qd,
                                          state.qdd))
    assert np.isfinite(torque).all()
    for fidelity in ('exact', 'fast'):
        simulation = build_simulation(REFERENCE, model, fidelity)
        samples = [simulation.next_sample() for _ in range(3)]
        simulation.close()
        assert np.isfinite([(sample.q, sample.effort) for sample in samples]).all()
