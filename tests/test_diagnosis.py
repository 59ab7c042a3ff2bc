"""What a diagnosis answers and what it makes of it; hidden effects are found in test_hidden."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hidden.hiders import HIDERS
from hidden.machines import Known, known_machine
from hidden.motions import draw_motion
from hidden.recording import record
from hidden.scenario import Task, draw_scenario, record_scenario
from hidden.truth import build
from measured import DWELL, excitation, log_of_machine, log_of_model
from planned import evidence_of, log_of, state_of_motion
from searches import MODEL, log_with

from par4_dynamics.model_file import read_model_file
from par4_dynamics.model_from_file import build_model, read_model, torque_model
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis import diagnosis
from par4_identification.diagnosis.diagnosis import diagnose
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.holdout import blocks_of_runs
from par4_identification.diagnosis.search.search import Journal
from par4_identification.diagnosis.verdict import settled
from par4_identification.diagnosis.verdict.answer import Unusable
from par4_identification.diagnosis.verdict.floor import deviation_of_base
from par4_identification.jobs import diagnose as jobs
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.timing import ROUNDED
from par4_kinematics.adept import adept_motion
from par4_kinematics.excitation import excitation_motion
from par4_sim.machines.machine_effects import machine_of_model
from par4_sim.machines.noise import Noise
from robots import REFERENCE, model_with

FIT, HELD_OUT = 10.0, 7.0
"""s, of the two logs of a diagnosis."""
SOFT = (4.2e-4, 7.5e-4, 3.8e-4, 1.2e-4)
"""rad/(N m), of the transmissions."""


def draw(effect: str, seed: int) -> Known:
    """Return a machine with a hidden effect; how often such effects are found is test_hidden's."""
    known = known_machine(('reference', 'other')[seed % 2])
    values = HIDERS[effect].draw(np.random.default_rng(seed), known, np.arange(4))
    return replace(known, machine=HIDERS[effect].build(known.machine, values))


def logs_of(hidden, seed):
    """Return one log to learn from and one held out."""
    return [log_of_machine(hidden.robot, hidden.machine, hidden.model, duration=duration,
                           seed=seed + offset, noise=0.05, feedforward=True)
            for duration, offset in ((FIT, 100), (HELD_OUT, 200))]


def names(diagnosis):
    return [cause.effect.name for cause in diagnosis.causes]


@pytest.fixture(scope='module')
def cogged_and_sticky():
    """Return two logs of a machine with cogging on two joints and Stribeck friction."""
    model = read_model('table1', REFERENCE)
    model = model_with(model, 'cogging', (0, 1), amplitude=0.4, periods=31.0, phase=(0, 1, 2, 3))
    model = model_with(model, 'stribeck', stribeck_torque=0.9, stribeck_velocity=0.12)
    machine = machine_of_model(REFERENCE, model)
    return [log_of_machine(REFERENCE, machine, read_model('table1', REFERENCE),
                           duration=duration, seed=seed) for duration, seed in
            ((FIT, 31), (HELD_OUT, 32))]


class SearchedError(Exception):
    """A search is done; its arguments are those of the answer."""


@pytest.fixture(scope='module')
def answered(cogged_and_sticky):
    """Return what diagnoses the two logs by some names, by all without any.

    The search is done once for the same names; what a test changes is what is made of it.
    """
    summed_up = diagnosis.summed_up

    def stop(*given):
        raise SearchedError(*given)

    @cache
    def searched(*names):
        fit, heldout = cogged_and_sticky
        library = {name: diagnosis.LIBRARY[name] for name in names or diagnosis.LIBRARY}
        with pytest.MonkeyPatch.context() as patch, pytest.raises(SearchedError) as found:
            patch.setattr(diagnosis, 'summed_up', stop)
            diagnose([fit], REFERENCE, holdout_logs=[heldout], library=library)
        return found.value.args

    def answer(*names):
        search, *others = searched(*names)
        search = copy(search)
        search.journal = Journal(list(search.journal.rejected))
        return summed_up(search, *others)

    return answer


@pytest.fixture(scope='module')
def pulled():
    """Return a robot and two logs: it moves so slowly beside a cable that its inertia is vague."""
    scenario = draw_scenario(Task('realistic', 8901401, None, True))
    hidden = (
        ('joint_friction_difference', {'coulomb': np.array((0.47, 0.30, -0.48, 0.0)),
                                       'viscous': np.array((-0.38, 0.31, -0.27, 0.0))}),
        ('joint_inertia_difference', {'actuator_inertia': np.array((0.010, 0.010, 0.008, 0.0))}),
        ('viscous_asymmetry', {'asymmetry': np.array((0.0, 0.0, 0.39, 0.0))}),
        ('cable_spring', {'stiffness': np.array((0.0, 31.0, 0.0)),
                          'anchor': np.array((0.0, -0.21, 0.0))}))
    scenario = replace(scenario, hidden=hidden,
                       machine=build(scenario.known.machine, hidden))
    return scenario.known.robot, [recording.log for recording in record_scenario(scenario)]


@pytest.mark.parametrize(('beside', 'is_shown'), [
    (('cable_spring', 'joint_friction_difference', 'viscous_asymmetry'), True),
    (('torque_offset', 'coulomb_asymmetry'), False)])
def test_data_that_show_the_inertia_beside_the_causes_found_are_not_refused(
        pulled, beside, is_shown):
    robot, (fit, heldout) = pulled
    result = diagnose([fit], robot, holdout_logs=[heldout],
                      library={name: diagnosis.LIBRARY[name] for name in beside})
    assert isinstance(result, Unusable) is not is_shown
    if is_shown:
        assert set(names(result)) == set(beside)
        inertia = result.base_after['actuator_inertia']
        assert inertia.std < 0.1 * inertia.value
    else:
        assert 'does not excite actuator_inertia' in result.reasons[0]


def test_two_effects_are_both_named(answered):
    result = answered()
    assert set(names(result)) == {'cogging', 'stribeck'}
    cogging, = (cause for cause in result.causes if cause.effect.name == 'cogging')
    assert cogging.joints == (0, 1)
    assert not any(cause.is_nothing for cause in result.causes)


def test_a_joint_that_weak_causes_may_make_zero_is_not_told(answered, monkeypatch):
    """On joints 0 and 1 there is cogging; what else may act leaves joint 1 in doubt."""
    def doubted(_search, cause, *_of):
        return replace(cause, parameters={**cause.parameters, 'amplitude': replace_std(
            cause.parameters['amplitude'], [1e3 if joint == 1 else 1e-3 for joint in cause.joints])
            })

    def replace_std(parameter, std):
        return parameter.model_copy(update={'std': tuple(std)})

    both, = answered('cogging').causes
    assert both.joints == (0, 1)
    monkeypatch.setattr(settled, 'widened', doubted)
    one, = answered('cogging').causes
    assert one.joints == (0,)


def test_a_collision_in_the_fitted_data_alone_is_not_explained(cogged_and_sticky, answered):
    """Rows held out do not show what struck the machine before."""
    fit, heldout = cogged_and_sticky
    tau = fit.tau.copy()
    tau[(fit.t > 4.0) & (fit.t < 4.3), 3] += 40.0
    free = answered('cogging', 'stribeck')
    struck = diagnose([replace(fit, tau=tau)], REFERENCE, holdout_logs=[heldout], library={
        name: diagnosis.LIBRARY[name] for name in ('cogging', 'stribeck')})
    assert (free.verdict, struck.verdict) == ('explained', 'partly_explained')
    assert set(names(struck)) == {'cogging', 'stribeck'}
    assert struck.fitted_unlike


@pytest.mark.parametrize('is_told', [True, False])
def test_causes_beside_which_the_motion_shows_the_inertia_are_told(
        cogged_and_sticky, monkeypatch, is_told):
    """The torque of a soft load, computed once more from its values, may hide what the fit shows.
    """
    started = diagnosis.start_of
    monkeypatch.setattr(diagnosis, 'start_of', lambda *given: replace(
        started(*given), unless_mended=('the motion does not show the inertia',)))
    monkeypatch.setattr(diagnosis, 'start_beside', lambda *_: None)
    monkeypatch.setattr(diagnosis, 'is_mended', lambda _: is_told)
    fit, heldout = cogged_and_sticky
    result = diagnose([fit], REFERENCE, holdout_logs=[heldout], library={
        'cogging': diagnosis.LIBRARY['cogging']})
    assert isinstance(result, Unusable) != is_told


def stribeck_within(deviations):
    """Return a doubt with which a Stribeck torque has so many times its size as its deviation."""
    def doubted(parameters, *_):
        return {name: parameter.model_copy(update={
            'std': tuple(deviations * np.abs(parameter.value)) if name == 'stribeck_torque'
            else parameter.std}) for name, parameter in parameters.items()}
    return doubted


def test_a_cause_whose_sizes_may_all_be_zero_has_no_name(answered, monkeypatch):
    """What two motions say of it may contradict each other; what it explains stays to be told."""
    monkeypatch.setattr(settled, 'with_disagreement', stribeck_within(2.0))
    result = answered('cogging', 'stribeck')
    assert names(result) == ['cogging']
    assert result.verdict == 'partly_explained'
    assert any(item.label.startswith('stribeck') and 'zero within' in item.reason
               for item in result.rejected)


def test_a_cause_of_which_the_joints_are_in_doubt_keeps_its_name(answered, monkeypatch):
    """Without its joints told it may have any size on each; that it acts is no less certain."""
    monkeypatch.setattr(settled, 'with_doubt_of_choice', stribeck_within(2.0))
    result = answered()
    told, = (cause for cause in result.causes if cause.effect.name == 'stribeck')
    size = told.parameters['stribeck_torque']
    assert np.all(np.asarray(size.std) >= (2.0 - 1e-6) * np.abs(size.value))  # fitted once more


@pytest.mark.parametrize(('margin', 'rival', 'doubt', 'is_told'), [
    (-5.0, 'a function of joint speed', 'with_disagreement', False),
    (-5.0, 'a function of joint speed', 'with_doubt_of_choice', False),
    (5.0, 'a function of joint speed', 'with_disagreement', True),
    (-5.0, 'nonlinear_viscous', 'with_disagreement', True),
    (-5.0, 'a function of joint speed', 'with_doubt_of_law', True)])
def test_a_cause_that_may_be_zero_is_told_only_if_nothing_else_explains_as_much(
        answered, monkeypatch, margin, rival, doubt, is_told):
    """Its sizes are zero within two deviations; a twin that explains as much is told with it.

    How large it is by another law says nothing against it.
    """
    judge_of = settled.judge

    def judged(search, item, model):
        found = judge_of(search, item, model)
        return found if item.effect.name != 'stribeck' else replace(
            found, margin=margin, rival=rival, twins=('nonlinear_viscous',))

    monkeypatch.setattr(settled, doubt, stribeck_within(0.7))
    monkeypatch.setattr(settled, 'judge', judged)
    result = answered('cogging', 'stribeck')
    assert ('stribeck' in names(result)) == is_told


def test_a_joint_whose_size_may_be_zero_is_not_named(answered, monkeypatch):
    """A mechanic opens the drive that is named; the name and its other joint stay."""
    def doubted(parameters, *_):
        amplitude = parameters.get('amplitude')
        if amplitude is None or np.size(amplitude.value) < 2:
            return parameters
        own, other = amplitude.std[0], 2.0 * amplitude.value[1]
        return {**parameters, 'amplitude': amplitude.model_copy(update={'std': (own, other)})}

    monkeypatch.setattr(settled, 'with_disagreement', doubted)
    result = answered('cogging', 'stribeck')
    assert {cause.effect.name: cause.joints for cause in result.causes} == {
        'cogging': (0,), 'stribeck': (0, 1, 2, 3)}


def test_an_effect_below_the_noise_is_not_named():
    hidden = draw('torque_offset', 2)
    model = model_with(hidden.model, 'torque_offset', offset=0.003)
    machine = machine_of_model(hidden.robot, model)
    fit, heldout = (log_of_machine(hidden.robot, machine, hidden.model, duration=10.0, seed=seed,
                                   noise=0.2) for seed in (51, 52))
    result = diagnose([fit], hidden.robot, holdout_logs=[heldout])
    assert names(result) == []
    assert result.verdict == 'clean'


@pytest.fixture(scope='module')
def cogged():
    """Return a machine with hidden cogging, its two logs and their diagnosis."""
    hidden = draw('cogging', 5)
    fit, heldout = logs_of(hidden, 5)
    return hidden, fit, heldout, diagnose([fit], hidden.robot, holdout_logs=[heldout])


def test_a_known_effect_in_the_baseline_is_not_named_again(cogged):
    hidden, fit, heldout, first = cogged
    again = diagnose([fit], hidden.robot, first.extended_model, [heldout])
    assert names(again) == []
    assert again.verdict == 'clean'
    assert again.holdout.baseline_rms.mean() < 1.1 * first.holdout.extended_rms.mean()


def test_full_baseline_knows_the_rods():
    model = read_model('table1_full', REFERENCE)
    fit, heldout = (log_of_model(REFERENCE, model, duration=duration, seed=seed)
                    for duration, seed in ((FIT, 61), (HELD_OUT, 62)))
    with_paper = diagnose([fit], REFERENCE, holdout_logs=[heldout])
    assert names(with_paper) == ['distributed_rods']
    with_full = diagnose([fit], REFERENCE, read_model_file('table1_full'), [heldout])
    assert names(with_full) == []
    assert with_full.verdict == 'clean'


def test_the_extended_model_helps_the_feedforward_of_the_machine(cogged):
    """The gain in the loop: tracking with feedforward from the extended model, on the machine."""
    hidden, _, heldout, result = cogged
    extended = build_model(hidden.robot, result.extended_model)

    # the extended model runs as a machine: its torque is that of the true one
    run, = runs_of_log(heldout, hidden.robot)
    state = run.state
    left = np.where(run.valid, run.tau - run.rows(extended.torque(state)), 0.0)
    assert np.sqrt(np.mean(left ** 2)) < 1.5 * np.sqrt(np.mean(result.holdout.extended_rms ** 2))
    twin = machine_of_model(hidden.robot, extended)
    again = log_of_machine(hidden.robot, twin, hidden.model, duration=HELD_OUT, seed=205,
                           feedforward=True)
    assert np.sqrt(np.mean((again.q - heldout.q) ** 2)) < 2e-4

    motion = excitation(hidden.robot.name, HELD_OUT, 205)
    start = round(DWELL / 1e-3)

    def error(model):
        log = log_of_machine(hidden.robot, hidden.machine, model, duration=HELD_OUT, seed=205,
                             feedforward=True)
        return np.sqrt(np.mean((log.q[start:start + len(motion.q)] - motion.q) ** 2))

    assert error(extended) < 0.9 * error(extended.without_effects())


@pytest.fixture(scope='module')
def sound():
    """Return two logs of TABLE 1."""
    return [log_of_model(REFERENCE, read_model('table1', REFERENCE), seed=seed)
            for seed in (71, 72)]


@pytest.mark.parametrize(('spoil', 'words'), [
    (lambda log: {'tau': -log.tau}, 'sign'),
    (lambda log: {'tau': log.tau[:, ::-1]}, 'order'),
    (lambda log: {'q': np.repeat(log.q[:1], len(log.q), axis=0)}, 'rows'),
    (lambda log: {'tau': np.random.default_rng(0).standard_normal(log.tau.shape)}, 'explain only'),
])
def test_unfit_data_are_called_unusable(sound, spoil, words):
    fit, heldout = sound
    result = diagnose([replace(fit, **spoil(fit))], REFERENCE, holdout_logs=[heldout])
    assert isinstance(result, Unusable)
    assert result.verdict == 'unusable_data'
    assert any(words in reason for reason in result.reasons)


def test_a_single_log_is_cut_and_its_last_third_held_out():
    hidden = draw('torque_offset', 3)
    log = log_of_machine(hidden.robot, hidden.machine, hidden.model, duration=12.0, seed=81)
    result = diagnose([log], hidden.robot)
    assert names(result) == ['torque_offset']
    rows_fit = sum(run.valid.any(axis=1).sum() for run in result.fit_runs)
    rows_held = sum(run.valid.any(axis=1).sum() for run in result.holdout.runs)
    assert 0.2 < rows_held / (rows_fit + rows_held) < 0.5
    last = max(run.t[run.valid.any(axis=1)].max() for run in result.fit_runs)
    first = min(run.t[run.valid.any(axis=1)].min() for run in result.holdout.runs)
    assert last < first


def test_bootstrap_interval_covers_the_gain():
    random = np.random.default_rng(3)
    t, valid = np.arange(4000) * 0.01, np.ones((4000, 2), bool)
    blocks = blocks_of_runs([t], [valid])
    after = random.standard_normal((4000, 2))
    before = after + random.standard_normal((4000, 2))
    gain = blocks.whitened_gain(before.T.ravel(), after.T.ravel())
    assert gain.low < 0.5 < gain.high
    assert gain.high - gain.low < 0.1
    nothing = blocks.whitened_gain(after.T.ravel(), random.permutation(after).T.ravel())
    assert nothing.low < 0.0 < nothing.high


def test_blocks_in_which_the_machine_rests_are_not_drawn():
    """Of a log that rests most of the time a seventh of the draws held no row, and no gain."""
    t = np.arange(0.0, 12.0, 0.01)
    valid = ((t > 3.0) & (t < 3.8))[:, None]
    blocks = blocks_of_runs([t], [valid])
    moving = blocks.counts()[:, 0] > 0.0
    assert moving.sum() == 2
    assert np.all(blocks.draws[:, moving].sum(axis=1) == 2.0)
    assert not blocks.draws[:, ~moving].any()
    noise = np.random.default_rng(1).standard_normal(len(t))
    before, after = (np.where(valid[:, 0], level * noise, 0.0) for level in (3.0, 1.0))
    assert blocks.whitened_gain(before, after).low == pytest.approx(8.0 / 9.0)


@pytest.mark.parametrize('seed', [11, 14])
def test_a_sound_machine_that_creeps_and_then_runs_is_clean(seed):
    """Friction just before a joint sticks is less than its law; no cause of a machine does that."""
    scenario = draw_scenario(Task('clean', seed, None, coloured=False))
    robot = scenario.known.robot
    fit, heldout = record_scenario(replace(
        scenario, motions=(draw_motion('slow', robot, 16.0, seed),
                           draw_motion('excitation', robot, 8.0, seed + 1)),
        noise=replace(scenario.noise, torque_noise=0.06)))
    answer = diagnose([fit.log], robot, None, [heldout.log])
    assert (answer.verdict, answer.remaining.nearest) == ('clean', None)
    # without causes the extended model is the one without
    np.testing.assert_array_equal(answer.holdout.baseline_rms, answer.holdout.extended_rms)


def test_what_slow_rows_hardly_tell_is_not_left_of_fast_ones():
    """Noise that wanders makes the inertia of a slow log uncertain, and fast rows are off by it."""
    scenario = draw_scenario(Task('clean', 34, None, coloured=True))
    robot = scenario.known.robot
    fit, heldout = record_scenario(replace(
        scenario, motions=(draw_motion('slow', robot, 16.0, 34),
                           draw_motion('excitation', robot, 8.0, 35)),
        noise=replace(scenario.noise, torque_noise=0.06, correlation_time=0.02)))
    answer = diagnose([fit.log], robot, None, [heldout.log])
    left, floor = answer.holdout.extended_rms, answer.holdout.noise_floor_rms
    assert answer.verdict == 'clean'
    assert answer.remaining.floor_excess < 0.5 * np.sqrt(np.sum(left ** 2) / np.sum(floor ** 2))


def test_base_parameters_are_off_on_another_motion_by_as_much_as_is_said():
    """The deviation is that over drawn noises, of slow rows applied to fast ones."""
    slow, fast = (excitation_motion(REFERENCE, duration, seed, **limits) for duration, seed, limits
                  in ((8.0, 901, {'slow_fraction': 0.85, 'acceleration': 8.0, 'joint_speed': 1.0}),
                      (6.0, 902, {})))
    torques = [MODEL.torque(state_of_motion(REFERENCE, motion)) for motion in (slow, fast)]
    there = evidence_of(log_of(REFERENCE, fast.t, fast.q, torques[1], 0), REFERENCE, MODEL)
    rows = there.observations
    fits = [solve(evidence_of(log_of(REFERENCE, slow.t, slow.q, torques[0], seed), REFERENCE,
                              MODEL), ()) for seed in range(1, 25)]
    told = np.concatenate([[(base @ fit.base) * run.valid for fit in fits]
                           for base, run in zip(rows.base, rows.runs)], axis=1)
    valid = np.concatenate([run.valid for run in rows.runs])
    seen = np.sqrt(told.var(axis=0, ddof=1).sum(axis=0) / valid.sum(axis=0))
    np.testing.assert_allclose(deviation_of_base(rows, fits[0]), seen, rtol=0.35)
    # and by less than half of that on rows of the motion that was fitted
    own = evidence_of(log_of(REFERENCE, slow.t, slow.q, torques[0], 0), REFERENCE, MODEL)
    assert np.all(deviation_of_base(own.observations, fits[0]) < 0.5 * seen)


def test_zeros_that_are_a_degree_off_are_told_with_nothing_beside_them():
    zeros = np.array((-13e-3, -3e-3, -12e-3, 16e-3))

    def read(seed, duration):
        motion = excitation('reference', duration, seed)
        torque = read_model('table1', REFERENCE).torque(state_of_motion(REFERENCE, motion))
        return log_of(REFERENCE, motion.t, motion.q + zeros, torque, seed, noise=0.03)

    possible = ('encoder_offset', 'geometry_error', 'theta_inertia', 'torque_offset')
    result = diagnose([read(41, 12.0)], REFERENCE, holdout_logs=[read(42, 8.0)],
                      library={name: diagnosis.LIBRARY[name] for name in possible})
    cause, = result.causes
    assert (result.verdict, cause.effect.name, cause.joints) == (
        'explained', 'encoder_offset', (0, 1, 2, 3))
    np.testing.assert_allclose(cause.parameters['offset'].value, zeros, atol=4e-4)


def test_a_stop_that_is_struck_otherwise_in_each_motion_takes_no_name_with_it():
    """How much of the stop a gain takes depends on the motion, but beside the stop the gain is one.
    """
    gains = {'relative': (-0.05, 0.03, 0.015, 0.0)}

    def stop(state):
        way = state.q - np.median(state.q, axis=0) - 0.05
        torque = 12.0 * np.maximum(way, 0.0)
        torque[:, [0, 2]] = 0.0
        return torque

    fit, heldout = (log_with(('drive_gain_error', gains), seed=seed, duration=duration, beside=stop)
                    for seed, duration in ((1, 12.0), (2, 8.0)))
    result = diagnose([fit], REFERENCE, holdout_logs=[heldout], library={
        name: diagnosis.LIBRARY[name]
        for name in ('drive_gain_error', 'torque_offset', 'joint_inertia_difference')})
    cause, = result.causes
    assert (result.verdict, cause.effect.name, cause.joints) == (
        'partly_explained', 'drive_gain_error', (0, 1, 2))
    relative = cause.parameters['relative']
    assert np.all(np.abs(np.subtract(relative.value, gains['relative'][:3]))
                  < 2.0 * np.array(relative.std))


@pytest.mark.parametrize('cycle', [{}, {'theta_swing': 0.5, 'acceleration': 80.0, 'speed': 3.0,
                                        'round_trip': None}])
def test_equal_cycles_of_a_machine_that_obeys_the_model_are_clean(cycle):
    """Its joints turn so fast that they do it between two samples, in each cycle again."""
    known = known_machine('reference')
    motion = adept_motion(known.robot, cycles=20, **cycle)
    told = record(known, known.machine, motion, fidelity='exact', noise=Noise(torque_noise=0.05),
                  seed=1, feedforward=None, wander=None, name='cycles')
    result = diagnose([told.log], known.robot)
    assert not isinstance(result, Unusable)
    assert (result.verdict, names(result)) == ('clean', [])
    friction = result.base_before['coulomb_friction'].value
    run, = result.evidence.whitener.runs
    assert np.all(run.timing_error >= 0.99 * friction * run.turning_error)
    # a joint moves its actuator and some of the platform, half as much again or twice as much
    least = ROUNDED / run.conditioning.position_cutoff_hz * 2.0 * friction / 0.4
    assert np.all((least < run.state.bend) & (run.state.bend < 0.4 / 0.113 * least))


@pytest.fixture(scope='module')
def soft_at_15_g():
    """Return the log of a machine whose arms swing so far that its friction seems to drive."""
    known = known_machine('reference')
    machine = HIDERS['elastic_transmission'].build(known.machine, {
        'compliance': np.array(SOFT), 'damping_ratio': 0.03})
    motion = adept_motion(known.robot, cycles=20, azimuth=0.1, acceleration=128.0,
                          theta_swing=0.6, round_trip=None)
    return record(known, machine, motion, fidelity='exact', noise=Noise(torque_noise=0.05), seed=3,
                  feedforward=known.model, wander=None, name='soft').log


@pytest.mark.parametrize(('library', 'is_told'), [
    ('elastic_transmission', True), ('torque_ripple', False)])
def test_a_cause_that_makes_friction_drive_is_looked_for(soft_at_15_g, library, is_told):
    """Without one beside which friction brakes the answer is what to check."""
    result = diagnose([soft_at_15_g], REFERENCE, library={library: diagnosis.LIBRARY[library]})
    assert isinstance(result, Unusable) != is_told
    if isinstance(result, Unusable):
        assert len(result.reasons) == 1
        assert 'friction comes out driving the joints' in result.reasons[0]
    else:
        stiffness = result.causes[0].parameters['stiffness']
        softest = np.multiply(stiffness.value, SOFT)[:2]
        np.testing.assert_allclose(softest, 1.0, atol=0.06)
        assert result.base_after['viscous_friction'].value == pytest.approx(2.04, rel=0.1)


def test_base_parameters_of_bodies_that_no_machine_has_end_no_diagnosis():
    """They may be so beside some of the causes; where they stay so, a remark says it."""
    file = read_model_file('table1_full')
    light = torque_model(REFERENCE, file.model_copy(update={'parameters': {
        **file.parameters, 'actuator_inertia': Parameter(value=4e-3, unit='kg m2')}}))
    logs = []
    for seed, duration in ((71, 10.0), (72, 7.0)):
        motion = excitation_motion(REFERENCE, duration, seed)
        torque = light.torque(state_of_motion(REFERENCE, motion))
        logs.append(log_of(REFERENCE, motion.t, motion.q, torque, seed))
    result = diagnose(logs[:1], REFERENCE, file, logs[1:], library={
        'cogging': diagnosis.LIBRARY['cogging']})
    assert result.verdict == 'clean'
    remark, = jobs._impossible_bodies(REFERENCE, result)
    assert 'motor inertia i_a + i_m' in remark.text
    assert jobs._impossible_bodies(REFERENCE, replace(result, extended_model=file)) == ()
