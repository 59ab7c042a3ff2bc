"""Axes as others measured them, simulated."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from axes import Motor, axis, held_speeds, recorded, there_and_back
from click.testing import CliRunner
from planned import log_of
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, lfilter

from par4_dynamics.base_terms import BASE_TERMS, base_columns, base_terms, torque_of_values
from par4_dynamics.effects.effect import FAST
from par4_dynamics.effects.nonlinear_viscous import NonlinearViscous
from par4_dynamics.effects.presliding import Presliding
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_dynamics.model_file import EffectEntry, ModelFile
from par4_dynamics.model_from_file import build_model
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import State, state_of_joints
from par4_identification.changes.changes import changes_between, model_of_bags
from par4_identification.commands.bag import make_bag
from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.evidence.unnamed import Kinds
from par4_identification.diagnosis.experiment.next_experiment import next_experiment
from par4_identification.diagnosis.search.search import Rejected
from par4_identification.diagnosis.verdict.sure import CHANCE
from par4_identification.fitting.axis_gravity import with_gravity_told
from par4_identification.fitting.identification import identify
from par4_identification.logs.log import Log
from par4_identification.reports.diagnosis_report import report_of_diagnosis
from par4_identification.reports.outcome.causes import source_of_order
from par4_identification.reports.outcome.changes import payload_causes_json, phrases_of_changes
from par4_identification.reports.outcome.diagnosis import (
    diagnosis_json,
    outcome_of_diagnosis,
    parameters_beside_causes,
)
from par4_identification.reports.outcome.identification import (
    outcome_of_identification,
    table_of_parameters,
)
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import low_pass
from par4_identification.signals.finer import finer
from par4_identification.signals.plateaus import plateaus_of
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import Chosen, conditioning_for
from par4_kinematics.errors import InputError
from par4_sim.report.words import with_std
from robots import REFERENCE

DRIVER = Motor(4.7e-6, 0.002, 1e-5, {72: (0.0047, -2.6), 18: (0.0010, 0.2)})
HEALTHY = replace(DRIVER, lines={})
BARE = Motor(2e-5, 0.015, 1e-3, {7: (0.048, -0.3), 14: (0.016, 3.0), 28: (0.021, 0.0),
                                 84: (0.006, 1.0)})
PENDULUM = Motor(5e-3, 0.04, 0.02, hanging=0.48)


def diagnosed(fit, heldout, machine):
    """Return the diagnosis of logs with the scales that suit them."""
    conditioning = conditioning_for([*fit, *heldout], machine, CONDITIONING)
    return diagnose(fit, machine, holdout_logs=heldout, conditioning=conditioning)


def speeds(t):
    """Return positions at about a turn a second, now faster, now slower."""
    return 5.3 * t + 1.0 * np.sin(1.1 * t)


# --------------------------------------------------------------------------------- base terms


@pytest.mark.parametrize(('kind', 'names'), [
    ('revolute', ['gravity_sine', 'gravity_cosine']), ('linear', ['gravity_load'])])
def test_a_hanging_axis_has_columns_that_sum_to_its_torque(kind, names):
    machine = axis(kind=kind, gravity='vertical')
    random = np.random.default_rng(3)
    state = State(np.arange(50.0), *random.normal(size=(3, 50, 1)), hanging=machine.hanging)
    assert [term.name for term in base_terms(state)][3:] == names
    values = {term.name: random.normal() for term in base_terms(state)}
    expected = base_columns(state) @ np.array(list(values.values()))
    np.testing.assert_allclose(torque_of_values(state, values), expected)
    # the load is a function of the pose alone, the slope of an energy
    rest = replace(state, qd=np.zeros((50, 1)), qdd=np.zeros((50, 1)))
    step = 1e-5
    energy = {'gravity_sine': lambda q: -np.cos(q), 'gravity_cosine': np.sin,
              'gravity_load': lambda q: q}
    slope = sum(values[name] * (energy[name](rest.q + step) - energy[name](rest.q - step))
                / (2.0 * step) for name in names)
    np.testing.assert_allclose(torque_of_values(rest, values), slope, atol=1e-8)


def test_columns_of_some_base_terms_are_those_of_all_without_the_others():
    random = np.random.default_rng(3)
    for state in (State(np.arange(50.0), *random.normal(size=(3, 50, 1)), hanging='turning'),
                  state_of_joints(REFERENCE.geometry, np.arange(50.0),
                                  *(0.02 * random.normal(size=(3, 50, 4))))):
        terms = base_terms(state)
        some = terms[2:0:-1]
        np.testing.assert_array_equal(base_columns(state, some),
                                      base_columns(state)[..., [2, 1]])
        np.testing.assert_array_equal(base_columns(state, terms), base_columns(state))


def test_a_robot_refuses_the_load_of_an_axis():
    numbers = {name: {'value': 1.0} for name in (
        'actuator_inertia', 'platform_mass_1', 'platform_mass_2', 'arm_gravity',
        'coulomb_friction', 'viscous_friction', 'gravity_sine')}
    model = ModelFile.model_validate({'schema': 'par4/model/1', 'parameters': numbers})
    with pytest.raises(InputError, match='gravity_sine is of a single axis'):
        build_model(REFERENCE, model)


@pytest.mark.parametrize(('kind', 'load', 'said'), [
    ('linear', 'gravity_cosine', 'gravity_cosine is no load of a sliding axis'),
    ('revolute', 'gravity_load', 'gravity_load is no load of a turning axis')])
def test_an_axis_refuses_the_load_of_one_of_another_kind(kind, load, said):
    model = ModelFile.model_validate({'schema': 'par4/model/1', 'parameters': {
        name: {'value': 1.0} for name in (
            'actuator_inertia', 'coulomb_friction', 'viscous_friction', load)}})
    with pytest.raises(InputError, match=said):
        build_model(axis(kind=kind), model)


@pytest.fixture(scope='module')
def pendulum():
    """Return the log of a servo that swings a weight."""
    return recorded(PENDULUM, lambda t: 0.9 * np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t), 12.0, 500.0,
                    noise=2e-3, stiffness=30.0)


def test_the_data_tell_whether_an_axis_hangs(pendulum):
    machine = axis(gravity='unknown')
    conditioning = conditioning_for([pendulum], machine, Conditioning())
    told = with_gravity_told(machine, [pendulum], conditioning)
    assert told.gravity == 'vertical'
    found = identify([pendulum], told, conditioning=conditioning)
    assert found.parameters['gravity_sine'].value == pytest.approx(PENDULUM.hanging, rel=0.02)
    assert abs(found.parameters['gravity_cosine'].value) < 0.01
    weightless = build_model(axis(), found.model_file({}))
    weightless = replace(weightless, values={name: value for name, value in
                                             weightless.values.items() if 'gravity' not in name})
    rows = {row.name: row for row in table_of_parameters(found, told, weightless)}
    assert rows['gravity_sine'].true == 0.0
    assert rows['actuator_inertia'].true == found.parameters['actuator_inertia'].value
    level = recorded(replace(PENDULUM, hanging=0.0), lambda t: 0.9 * np.sin(2.0 * t)
                     + 0.4 * np.sin(5.3 * t), 12.0, 500.0, noise=2e-3, stiffness=30.0)
    assert with_gravity_told(machine, [level], conditioning).gravity == 'none'


def sliding(force, seed, noise=0.3, wander=0.0, period=1e-3):
    """Return the log of a slide with friction and a force (n, 1) of its position and time.

    Noise that wanders for a tenth of a second may be added.
    """
    t = np.arange(0.0, 18.0, period)
    rates = 2.0 * np.pi * np.array((0.11, 0.29, 0.53))
    waves = np.array((0.2, 0.06, 0.03)) * np.exp(1j * (rates * t[:, None] + float(seed)))
    q, qd, qdd = ((part * waves).sum(axis=1, keepdims=True).real
                  for part in (1.0, 1j * rates, -rates ** 2))
    tau = 8.0 * qdd + 20.0 * np.sign(qd) + 30.0 * qd + force(q)
    slow = lfilter([1.0], [1.0, -0.99], np.random.default_rng((seed, 1)).standard_normal(q.shape),
                   axis=0)
    return log_of(axis(kind='linear'), t, q, tau + wander * slow / np.std(slow), seed, noise)


@pytest.mark.usefixtures('unrendered')
def test_a_slide_has_one_order_though_it_is_no_whole_number():
    """2 pi over the pitch; whole numbers would need several for it."""
    pitch = 0.0241
    fit, heldout = (sliding(lambda q: 9.0 * np.sin(2.0 * np.pi * q / pitch + 0.4), seed,
                            period=2e-3) for seed in (1, 2))
    machine = axis(kind='linear')
    found = diagnosed([fit], [heldout], machine)
    cause, = found.causes
    assert cause.effect.name == 'cogging'
    assert cause.parameters['periods'].number == pytest.approx(2.0 * np.pi / pitch, rel=1e-3)
    assert cause.parameters['amplitude'].value == pytest.approx((9.0,), rel=0.02)
    outcome = outcome_of_diagnosis(found, machine)
    assert f'N of cogging force with a pitch of {1e3 * pitch:.1f} mm' in outcome.sentence
    line, = parameters_beside_causes(found, machine)
    value, std = with_std(found.base_after['coulomb_friction'].number,
                          found.base_after['coulomb_friction'].deviation)
    assert line.startswith('Beside this cause the parameters are actuator inertia ')
    assert f'Coulomb friction {value} ± {std} N' in line
    page = report_of_diagnosis(found, outcome, machine, [], {})
    assert f'within a pitch of {1e3 * pitch:.1f} mm' in page
    assert 'periods a turn' not in page
    told = diagnosis_json(found, machine, None)['causes'][0]['parameters']
    assert {name: item['unit'] for name, item in told.items()} == {
        'amplitude': 'N', 'periods': 'rad/m', 'phase': 'rad'}


@pytest.mark.parametrize('unit', [1e-2, 50.0], ids=['cm', '20 mm'])
def test_the_names_of_a_slide_do_not_depend_on_its_length(unit):
    """What is logged is the same machine in another unit: no length is a turn."""
    pitch = 0.02
    fit, heldout = (sliding(lambda q: 8.0 * np.sin(2.0 * np.pi * q / pitch) + 60.0 * q, seed,
                            period=2e-3) for seed in (1, 2))
    found = diagnosed(*([replace(log, q=unit * log.q)] for log in (fit, heldout)),
                      axis(kind='linear'))
    causes = {cause.effect.name: cause.parameters for cause in found.causes}
    assert set(causes) == {'cogging', 'position_torque'}
    assert causes['cogging']['periods'].number == pytest.approx(
        2.0 * np.pi / (unit * pitch), rel=1e-3)
    slope = causes['position_torque']
    low, high = (float(np.ravel(end)[0]) for end in slope['range'].value)
    assert 2.0 * np.ravel(slope['coefficients'].value)[1] / (high - low) == pytest.approx(
        60.0 / unit, rel=0.02)


def test_orders_of_a_slide_are_those_that_all_its_rows_tell_apart():
    """Not those of its first piece, which may be a short one."""
    log = sliding(lambda q: 0.0 * q, 1, period=2e-3)
    log = replace(log, segments=(slice(0, 700), slice(800, len(log.t))))
    observations = diagnosed([log], [log], axis(kind='linear')).evidence.observations
    runs, ranges = observations.runs, Kinds(observations).ranges
    assert np.ptp(runs[0].state.q) < 0.8 * np.ptp(log.q)
    told = max(np.ptp(np.concatenate([run.state.q for run in runs])), 1e-9)
    assert ranges.step == pytest.approx(2.0 * np.pi / (4.0 * told))
    moved = runs[0].state.moved(runs[0].state.q, runs[0].state.qd, runs[0].state.qdd)
    assert moved.slides


def test_a_constant_force_beside_another_cause_is_no_force_that_follows_the_position():
    """A series that is constant explains as much, with a coefficient more."""
    fit, heldout = (sliding(lambda q: 12.0 + 8.0 * np.sin(2.0 * np.pi * q / 0.02), seed,
                            period=2e-3) for seed in (1, 2))
    found = diagnosed([fit], [heldout], axis(kind='linear'))
    sizes = {cause.effect.name: cause.parameters for cause in found.causes}
    assert set(sizes) == {'cogging', 'torque_offset'}
    assert sizes['torque_offset']['offset'].value == pytest.approx((12.0,), rel=0.02)


def test_beside_a_weight_a_spring_takes_none_of_it():
    """The constant of a series would be the weight once more, and each would get a half."""
    fit, heldout = (sliding(lambda q: 200.0 + 60.0 * q, seed, period=2e-3) for seed in (1, 2))
    machine = axis(kind='linear', gravity='vertical')
    found = diagnosed([fit], [heldout], machine)
    cause, = found.causes
    first, slope = np.ravel(cause.parameters['coefficients'].value)
    low, high = cause.parameters['range'].value
    assert (cause.effect.name, first) == ('position_torque', 0.0)
    assert slope == pytest.approx(60.0 * 0.5 * (high - low), rel=0.02)
    weight = found.base_after['gravity_load']
    assert weight.value == pytest.approx(200.0 + 60.0 * 0.5 * (high + low), rel=1e-3)
    extended = build_model(machine, found.extended_model)
    run = found.holdout.runs[0]
    torque = run.rows(extended.torque(run.state))
    assert np.std((run.tau - torque)[run.valid]) < 1.5 * found.holdout.noise_floor_rms[0]


def test_friction_that_changes_with_each_turn_of_a_screw_is_no_ripple_of_its_motor():
    """Its order, 628 rad/m, is far above those of an arm; no effect of the library is like it."""
    def bent(q):
        return 6.0 * np.sign(np.gradient(q, axis=0)) * np.sin(2.0 * np.pi * q / 0.01)

    fit, heldout = (sliding(bent, seed, period=2e-3) for seed in (1, 2))
    found = diagnosed([fit], [heldout], axis(kind='linear'))
    assert (found.verdict, found.causes) == ('unknown', ())
    assert found.unnamed[0].kind == 'uneven'


@pytest.mark.parametrize(('chance', 'names'), [(1.0, ['cogging']), (CHANCE, [])])
def test_names_that_lower_no_error_are_not_told(chance, names, monkeypatch):
    """A wave of 1.2 N under 6 N of noise that wanders: likelihood knows it, the error does not."""
    monkeypatch.setattr('par4_identification.diagnosis.verdict.sure.CHANCE', chance)
    fit, heldout = (sliding(lambda q: 1.2 * np.sin(400.0 * q), seed, noise=6.0, wander=6.0)
                    for seed in (1, 2))
    found = diagnosed([fit], [heldout], axis(kind='linear'))
    assert [cause.effect.name for cause in found.causes] == names


@pytest.mark.parametrize(('lines', 'told'), [
    ({19.2: 0.0047, 134.4: 0.004, 268.8: 0.002},
     ('19.200 periods a turn, a turn of the motor',
      "134.40 periods a turn, the motor's pole pairs",
      "268.80 periods a turn, 2 times the motor's pole pairs")),
    # two lines of which the gear makes one and the joint the other
    ({44.8: 0.004, 45.0: 0.004}, ('44.800 periods a turn', '45 periods a turn'))])
def test_behind_a_gear_the_orders_of_a_motor_are_no_whole_numbers(lines, told):
    """A ratio of 19.2: the torque of the motor is the same again only after five turns."""
    motor = Motor(2.4e-4, 0.01, 1e-4, {order: (size, 0.1 * order)
                                       for order, size in lines.items()})
    fit, heldout = (recorded(motor, lambda t, first=first: 1.5 * t + 0.6 * np.sin(0.9 * t + first),
                             24.0, 1000.0, noise=3e-4, seed=first) for first in (1, 2))
    machine = axis(gear_ratio=19.2, pole_pairs=7)
    found = diagnosed([fit], [heldout], machine)
    cause, = found.causes
    assert cause.effect.name == 'cogging'
    np.testing.assert_allclose(cause.parameters['periods'].value, list(lines), rtol=3e-4)
    np.testing.assert_allclose(np.ravel(cause.parameters['amplitude'].value), list(lines.values()),
                               rtol=0.03)
    sentence = outcome_of_diagnosis(found, machine).sentence
    assert all(words in sentence for words in told)
    for gears, unseen in ((19.2, False), (5000.0, True)):
        remarks = outcome_of_diagnosis(found, axis(gear_ratio=gears)).remarks
        assert any('5000 and 10000 periods a turn of the joint is too quick' in remark.text
                   for remark in remarks) == unseen


# --------------------------------------------------------------------------- scales of the data


@pytest.mark.parametrize('usual', [CONDITIONING, Conditioning()])
def test_a_par4_keeps_its_filters(usual):
    # whatever its torque holds
    assert conditioning_for([recorded(DRIVER, speeds, 1.0, 1000.0)], REFERENCE, usual) == usual


def test_a_line_above_the_usual_filter_is_let_through():
    fast = recorded(DRIVER, speeds, 6.0, 1000.0)
    still = recorded(HEALTHY, speeds, 6.0, 1000.0)
    line = 72 * 5.3 / (2.0 * np.pi)
    assert conditioning_for([fast], axis(), CONDITIONING).torque_cutoff_hz > 1.2 * line
    assert conditioning_for([still], axis(), CONDITIONING).torque_cutoff_hz == pytest.approx(40.0)


def test_what_a_user_sets_rules_and_what_samples_do_not_carry_is_refused():
    log = recorded(HEALTHY, speeds, 3.0, 500.0)
    own = conditioning_for([log], axis(), CONDITIONING, Chosen(20.0, 80.0, 0.3))
    assert (own.torque_cutoff_hz, own.row_rate_hz, own.low_speed) == (20.0, 80.0, 0.3)
    with pytest.raises(InputError, match='--cutoff 150 Hz asked of samples at 500 Hz'):
        conditioning_for([log], axis(), CONDITIONING, Chosen(cutoff_hz=150.0))
    with pytest.raises(InputError, match='--rows'):
        conditioning_for([log], axis(), CONDITIONING, Chosen(row_rate_hz=50.0))


@pytest.mark.parametrize(('chosen', 'told', 'other'), [
    (Chosen(low_speed=1e9), '--low-speed 1e+09: joint 0', 'lower'),
    (Chosen(cutoff_hz=0.2), '--cutoff 0.2: joint 0', 'higher'),
    (Chosen(cutoff_hz=1e-9), '--cutoff 1e-09: joint 0', 'higher'),  # remembers thirty years
    (Chosen(cutoff_hz=0.2, row_rate_hz=100.0), '--cutoff 0.2: joint 0', 'higher'),
    (Chosen(cutoff_hz=40.0, low_speed=50.0), '--low-speed 50: joint 0', 'lower'),
])
def test_an_option_that_leaves_no_rows_is_named(chosen, told, other):
    """A longer motion would not help."""
    log = recorded(HEALTHY, lambda t: 2.0 * np.sin(2.0 * t), 5.0, 500.0)
    with pytest.raises(InputError, match=re.escape(told) + ' has 0 usable rows .* and [0-9]+ '
                       f'without; give a {other} number'):
        conditioning_for([log], axis(), Conditioning(), chosen)
    still = replace(log, q=0.0 * log.q)  # has none without options either
    assert conditioning_for([still], axis(), Conditioning(), chosen)


def test_an_axis_that_moves_too_little_is_not_sent_to_a_tool_for_robots():
    log = recorded(HEALTHY, lambda t: np.sin(2.0 * t) + 0.5 * np.sin(5.3 * t), 6.0, 500.0)
    found = identify([log], axis())
    poor = replace(found, estimate=replace(found.estimate, condition_number=500.0))
    outcome = outcome_of_identification(poor, found.estimate.rms, axis(), [
        replace(log, accounts=SimpleNamespace(findings=lambda: [], duration=6.0))])
    advice = ' '.join(outcome.advice)
    assert 'Record a richer motion: slow and fast, both ways, over the whole range.' in advice
    assert 'par4_excite' not in advice


def test_a_negative_inertia_has_the_unit_of_the_axis():
    log = recorded(HEALTHY, lambda t: np.sin(2.0 * t) + 0.5 * np.sin(5.3 * t), 6.0, 500.0)
    spring = replace(log, tau=log.q.copy())
    found = identify([spring], axis(kind='linear'))
    with pytest.raises(InputError, match='actuator_inertia identified as -[0-9.]+ kg, which is'):
        found.model_file({}, axis(kind='linear'))
    with pytest.raises(InputError, match='actuator_inertia identified as -[0-9.]+ kg m2, which'):
        found.model_file({}, axis())
    reasons = diagnose([spring], axis(kind='linear'), holdout_logs=[spring]).reasons
    assert not any('kg m2' in reason for reason in reasons)


# --------------------------------------------------------------------------------------- names


def test_cogging_of_a_driver_is_named_with_its_size_and_phase():
    found = diagnosed([recorded(DRIVER, speeds, 8.0, 1000.0)],
                      [recorded(DRIVER, lambda t: 4.6 * t, 5.0, 1000.0, seed=1)], axis())
    assert [cause.effect.name for cause in found.causes] == ['cogging']
    parameters = found.causes[0].parameters
    orders = parameters['periods'].value
    assert 72.0 in orders
    assert 18.0 in orders
    assert len(orders) <= 4
    for order, (size, phase) in DRIVER.lines.items():
        place = orders.index(order)
        assert parameters['amplitude'].value[place] == pytest.approx(size, rel=0.1)
        turned = np.angle(np.exp(1j * (parameters['phase'].value[place] - phase)))
        assert abs(np.degrees(turned)) < 10.0
    # the model file says the same torque
    model = build_model(axis(), found.extended_model)
    q = np.linspace(0.0, 2.0 * np.pi, 400)[:, None]
    state = State(np.arange(400.0), q, np.zeros_like(q), np.zeros_like(q))
    own = model.effects[-1].torque(state)[:, 0]
    assert np.linalg.norm(own - DRIVER.cogging(q[:, 0])) < 0.1 * np.linalg.norm(own)


def test_the_same_driver_without_cogging_is_not_accused():
    found = diagnosed([recorded(HEALTHY, speeds, 8.0, 1000.0)],
                      [recorded(HEALTHY, lambda t: 4.6 * t, 5.0, 1000.0, seed=1)], axis())
    assert found.verdict in ('clean', 'unusable_data')
    assert not getattr(found, 'causes', ())


def test_a_torque_that_is_mostly_cogging_is_no_junk():
    first = recorded(BARE, there_and_back, 24.0, 500.0, counts=8192, noise=1e-3)
    second = recorded(BARE, lambda t: there_and_back(1.3 * t + 2.0), 18.0, 500.0, counts=8192,
                      noise=1e-3, seed=1)
    machine = axis(pole_pairs=7)
    found = diagnosed([first], [second], machine)
    assert [cause.effect.name for cause in found.causes] == ['cogging']
    assert set(BARE.lines) <= {int(order) for order in found.causes[0].parameters['periods'].value}
    before, after = found.holdout.baseline_rms[0], found.holdout.extended_rms[0]
    assert after < 0.2 * before
    sentence = outcome_of_diagnosis(found, machine).sentence
    assert '84 periods a turn, 12 times the motor\'s pole pairs' in sentence


def test_noise_is_still_junk():
    log = recorded(BARE, there_and_back, 12.0, 500.0, counts=8192)
    noise = 0.05 * np.random.default_rng(0).standard_normal(log.tau.shape)
    found = diagnosed([replace(log, tau=noise)], [], axis())
    assert found.verdict == 'unusable_data'
    assert any('inertia, friction and weight explain only' in reason for reason in found.reasons)


def test_the_log_of_one_joint_of_an_arm_is_told_that_others_move_it():
    """The weight of what hangs on it goes with the angles of joints that the axis does not know."""
    log = recorded(PENDULUM, lambda t: 0.4 * np.sin(1.3 * t), 20.0, 200.0)
    other = 3.0 * np.sin(0.9 * log.t) + 2.0 * np.sin(2.3 * log.t)
    arm = replace(log, tau=log.tau + other[:, None])
    for facts in ({}, {'gravity': 'vertical'}):
        found = diagnosed([arm], [], axis(**facts))
        assert found.verdict == 'unusable_data'
        assert not any('order' in reason or 'rigid bodies' in reason for reason in found.reasons)
        assert any('whether other joints moved' in reason for reason in found.reasons)
    with pytest.raises(InputError, match='which is impossible; .*whether other joints moved'):
        identify([replace(log, tau=-log.tau)], axis()).model_file({}, axis())


@pytest.mark.parametrize('seed', range(2))
def test_a_controller_that_answers_disturbances_is_no_friction(seed):
    """Something shakes a joint that is held at one speed: the torque is all that the drive says."""
    period, random = 0.01, np.random.default_rng(seed)
    shaken = lfilter(*butter(2, 6.0 * period), random.standard_normal(1200))
    speed = 9.0 + 2.5 * shaken / shaken.std()
    q = cumulative_trapezoid(speed, dx=period, initial=0.0)
    torque = 0.04 - 0.0146 * (speed - 9.0) + 2e-3 * random.standard_normal(len(q))
    log = Log('governed', ('motor',), 1, period, period * np.arange(len(q)), q[:, None],
              torque[:, None], (slice(0, len(q)),), None, None)
    found = diagnosed([log], [], axis())
    assert found.verdict == 'unusable_data'
    reason, = found.reasons
    assert 'as where a controller answers a speed that something else disturbs' in reason


def test_no_time_is_right_for_a_torque_that_no_time_explains():
    log = recorded(BARE, there_and_back, 24.0, 500.0, counts=8192)
    findings = [item.finding for item in check_setup([log], axis()).findings]
    assert 'delay' not in findings
    assert 'clock_drift' not in findings


@pytest.mark.parametrize(('order', 'facts', 'words'), [
    (7.0, {'pole_pairs': 7}, 'the motor\'s pole pairs'),
    (12.0, {'pole_pairs': 7}, 'as of the motor\'s slots'),
    (202.0, {'gear_ratio': 101.0}, '2 in a turn of the motor, as of its slots'),
    (101.0, {'gear_ratio': 101.0}, 'a turn of the motor'),
    (707.0, {'gear_ratio': 101.0, 'pole_pairs': 7}, 'the motor\'s pole pairs'),
    (150.0, {'gear_ratio': 101.0}, 'of the gear or the encoder behind it'),
    (72.0, {}, None)])
def test_the_nameplate_tells_where_an_order_comes_from(order, facts, words):
    assert source_of_order(order, axis(**facts)) == words


def test_friction_never_builds_up_where_a_joint_only_jerks_back():
    t = np.arange(0.0, 20.0, 1e-3)
    still = np.zeros((len(t), 1))
    one_way = (0.3 * t + 2e-3 * np.sin(40.0 * t))[:, None]
    both = np.sin(t)[:, None]
    assert Presliding().shapes(State(t, one_way, still, still)) == ()
    assert len(Presliding().shapes(State(t, both, still, still))) > 5


def trapezoids(speeds, lasting=2.0):
    """Return positions that go there and back at one speed after the other."""
    def reference(t):
        share = t % lasting / lasting
        course = np.tanh(12.0 * share) * np.tanh(12.0 * (0.5 - share)) * np.tanh(
            12.0 * (1.0 - share))
        return np.cumsum(np.array(speeds)[(t // lasting).astype(int) % len(speeds)] * course) * (
            t[1] - t[0])
    return reference


@pytest.mark.parametrize(('other', 'names'), [(1e-3, ['viscous_asymmetry']), (1e-2, [])])
def test_a_law_that_holds_but_for_some_percents_keeps_its_name(other, names):
    """Little noise shows by how little; what is no law of the library has no name."""
    motor, logs = Motor(5e-3, 0.04, 0.02), []
    for seed, some in enumerate(((3.0, 1.2, 2.0), (2.2, 2.8, 1.0))):
        log = recorded(motor, trapezoids(some), 12.0, 500.0, counts=200000, noise=1e-3,
                       stiffness=40.0, seed=seed)
        speed = np.gradient(log.q, log.period, axis=0)
        logs.append(replace(log, tau=log.tau + 8e-3 * np.abs(speed) + other * np.sin(3.0 * speed)))
    found = diagnosed(logs[:1], logs[1:], axis())
    assert [cause.effect.name for cause in found.causes] == names
    assert names or found.unnamed


# -------------------------------------------------------------------- torque over the position


@pytest.mark.usefixtures('unrendered')
@pytest.mark.parametrize('held', [
    lambda q: 0.05 * q + 0.06 * q ** 3,  # a spring that hardens
    lambda q: 0.08 * math.tanh(4.0 * (q - 0.3)),  # a magnet with two sides
], ids=['spring', 'magnet'])
def test_what_holds_an_axis_is_named_with_its_course(held):
    motor = replace(HEALTHY, inertia=2e-4, coulomb=0.01, held=held)
    first = recorded(motor, lambda t: 0.9 * np.sin(1.7 * t) + 0.3 * np.sin(4.1 * t), 16.0, 500.0,
                     noise=1e-3, stiffness=40.0)
    second = recorded(motor, lambda t: 0.8 * np.sin(1.3 * t) + 0.3 * np.sin(5.0 * t), 10.0, 500.0,
                      noise=1e-3, stiffness=40.0, seed=1)
    found = diagnosed([first], [second], axis())
    assert [cause.effect.name for cause in found.causes] == ['position_torque']
    model = build_model(axis(), found.extended_model)
    q = np.linspace(-0.8, 0.8, 100)
    still = np.zeros((len(q), 1))
    told = model.effects[-1].torque(State(q, q[:, None], still, still))[:, 0]
    truth = np.array([held(place) for place in q])
    assert np.max(np.abs(told - truth)) < 0.05 * np.ptp(truth)
    outcome = outcome_of_diagnosis(found, axis())
    assert 'torque that follows the position' in outcome.sentence
    assert 'coefficients' in report_of_diagnosis(found, outcome, axis(), [], {})


@pytest.mark.parametrize(('effect', 'values', 'said'), [
    ('position_torque', {'coefficients': (0.0, 1.0), 'range': (1.0, 1.0)}, 'the lower one first'),
    ('position_torque', {'coefficients': (0.0, 1.0), 'range': (1.0, -1.0)}, 'found 1, -1'),
    ('position_torque', {'coefficients': (0.0, 1.0), 'range': 1.0}, 'expected 2 numbers'),
    ('stribeck', {'stribeck_torque': 1.0, 'stribeck_velocity': 0.0}, 'more than 0 rad/s'),
    ('stribeck', {'stribeck_torque': 1.0, 'stribeck_velocity': 0.1, 'exponent': -1.0},
     'exponent: expected more than 0, found -1'),
    ('friction_drift', {'drop': 0.3, 'time_constant': 0.0}, 'expected more than 0 s, found'),
    ('presliding', {'distance': 0.0}, 'distance: expected more than 0 rad'),
    ('nonlinear_viscous', {'torque': 1.0, 'exponent': -0.5}, 'exponent: expected more than 0'),
    ('elastic_transmission', {'stiffness': 1e4, 'damping_ratio': -0.1},
     'damping_ratio: expected 0 or more, found -0.1')])
def test_numbers_that_make_no_law_are_refused(effect, values, said):
    base = {term.name: Parameter(value=1.0) for term in BASE_TERMS if not term.needs_platform}
    entry = EffectEntry(effect=effect, parameters={
        name: Parameter(value=value) for name, value in values.items()})
    with pytest.raises(InputError, match=said):
        build_model(axis(), ModelFile(schema='par4/model/1', parameters=base, effects=(entry,)))


# ---------------------------------------------------------------------------- coarse and slow logs


def test_an_encoder_that_does_not_resolve_the_acceleration_does_not_hide_the_inertia():
    """Torque that reaches far lets much of the noise of counts into the second difference."""
    motor = replace(HEALTHY, inertia=2e-3, coulomb=0.02, viscous=2e-3)
    log = recorded(motor, lambda t: 1.2 * np.sin(4.0 * t), 10.0, 1000.0, counts=16384,
                   stiffness=20.0)
    rattling = 0.01 * np.sin(2.0 * np.pi * 90.0 * log.t) * np.sign(np.sin(7.1 * log.t))
    log = replace(log, tau=log.tau + rattling[:, None])
    conditioning = conditioning_for([log], axis(), Conditioning())
    assert conditioning.torque_cutoff_hz > 80.0
    assert conditioning.position_cutoff_hz < conditioning.torque_cutoff_hz
    found = identify([log], axis(), conditioning=conditioning).parameters['actuator_inertia']
    assert found.value == pytest.approx(motor.inertia, rel=0.03)
    blind = replace(conditioning, position_cutoff_hz=2.0 * conditioning.torque_cutoff_hz)
    assert identify([log], axis(), conditioning=blind).parameters[
        'actuator_inertia'].value < 0.8 * motor.inertia


def test_friction_changes_its_sign_between_the_samples_of_a_slow_log():
    motor = replace(HEALTHY, inertia=1e-4, coulomb=0.02)
    slow = recorded(motor, lambda t: 2.0 * np.sin(5.0 * t), 8.0, 100.0, counts=65536,
                    stiffness=40.0)
    fine = finer(slow, axis())
    assert fine.period == pytest.approx(1e-3)
    np.testing.assert_allclose(fine.q[::10], slow.q, atol=1e-9)
    conditioning = conditioning_for([slow], axis(), Conditioning())
    found = identify([slow], axis(), conditioning=conditioning).parameters
    assert found['coulomb_friction'].value == pytest.approx(motor.coulomb, rel=0.01)


def test_a_bag_of_a_few_samples_is_read_and_twins_of_an_axis_need_no_motion(tmp_path):
    t = np.arange(40) / 4.0
    rows = np.column_stack((t, 0.8 * t, np.full(40, 0.03)))
    np.savetxt(tmp_path / 'slow.csv', rows, delimiter=',', header='t,q,tau', comments='')
    made = CliRunner().invoke(make_bag, [
        str(tmp_path / 'slow.csv'), '--columns', 'time=t:s position=q:rad torque=tau:Nm',
        '--joints', 'motor', '--output', str(tmp_path / 'bag')], catch_exceptions=False)
    assert made.exit_code == 0, made.output
    rising = diagnosed(held_speeds(screw(1.2e-3, 1.0), SPEEDS, 1e-4, 1), [], axis())
    assert any(cause.twins for cause in rising.causes)
    assert next_experiment(rising, axis()) is None


def test_stretches_that_the_filters_leave_no_rows_of_are_left_out():
    """A slow log has slow filters: a second between two gaps is too short for them."""
    log = recorded(BARE, there_and_back, 24.0, 100.0, counts=8192, noise=1e-3)
    conditioning = conditioning_for([log], axis(), CONDITIONING, Chosen(cutoff_hz=1.5))
    short, long = slice(0, 110), slice(120, len(log.t))
    assert len(runs_of_log(replace(log, segments=(short, long)), axis(), conditioning)) == 1
    with pytest.raises(InputError, match='no uninterrupted stretch of at least 2.4 s'):
        runs_of_log(replace(log, segments=(short,)), axis(), conditioning)


@pytest.mark.parametrize('speed', [0.2, 80.0])
def test_quadratic_friction_is_judged_at_the_speeds_of_the_axis(speed):
    effect, friction = NonlinearViscous(), 2e-3
    values = {'quadratic': np.array([0.5 * friction / speed ** 2]), 'torque': np.zeros(1),
              'exponent': np.full(1, 2.0)}
    std = {name: np.zeros(1) for name in values}
    base = {'coulomb_friction': np.array([friction]), 'viscous_friction': np.zeros(1),
            FAST: np.array([speed])}
    assert effect.implausible(values, std, base) is None
    driving = {**values, 'quadratic': -3.0 * values['quadratic']}
    assert 'drive' in effect.implausible(driving, std, base)


def test_a_loop_that_gives_way_to_cogging_is_no_late_torque():
    soft = replace(DRIVER, inertia=2.5e-3, coulomb=0.13, viscous=1e-2,
                   lines={23: (0.05, 1.3), 46: (0.025, -1.0)})
    log = recorded(soft, lambda t: 6.0 * np.sin(1.1 * t) + np.sin(3.1 * t), 10.0, 200.0,
                   noise=3e-3, stiffness=25.0)
    assert 'delay' not in {item.finding for item in check_setup([log], axis()).findings}
    even = recorded(replace(soft, lines={}), lambda t: 6.0 * np.sin(1.1 * t) + np.sin(3.1 * t),
                    10.0, 200.0, noise=3e-3, stiffness=25.0)
    late = replace(even, t=even.t[:-10], q=even.q[10:], tau=even.tau[:-10],
                   segments=(slice(0, len(even.t) - 10),))
    assert 'delay' in {item.finding for item in check_setup([late], axis()).findings}


# ------------------------------------------------------------------------------ two groups of bags


@pytest.mark.parametrize('kind', ['revolute', 'linear'])
def test_a_payload_on_an_axis_is_told_between_two_groups_of_bags(kind):
    """A point of 0.3 kg at 0.12 m on a pendulum, or 0.3 kg on an upright slide of 3 kg."""
    mass, lever = 0.3, 0.12
    if kind == 'revolute':
        before = PENDULUM
        after = replace(before, hanging=before.hanging + 9.81 * mass * lever,
                        inertia=before.inertia + mass * lever ** 2)
    else:
        before = Motor(3.0, 8.0, 4.0, held=lambda _q: 3.0 * 9.81)
        after = replace(before, inertia=3.0 + mass, held=lambda _q: (3.0 + mass) * 9.81)
    machine = axis(kind=kind, gravity='vertical')

    def moved(t):
        return 0.9 * np.sin(2.0 * t) + 0.4 * np.sin(5.3 * t)

    logs = [recorded(motor, moved, 10.0, 500.0, counts=200000, noise=1e-3, stiffness=30.0,
                     seed=seed) for seed, motor in enumerate((before, before, after, after))]
    conditioning = conditioning_for(logs, machine, CONDITIONING)
    old = model_of_bags(logs[:1], machine, None, conditioning)

    def changed(log):
        found = diagnose([log], machine, old, conditioning=conditioning,
                         library={TorqueOffset.name: TorqueOffset()})
        return changes_between(found, machine, logs[:1], old, 'before', conditioning)

    assert not changed(logs[1]).read
    changes = changed(logs[2])
    cause, = payload_causes_json(changes, machine)
    assert cause['parameters']['mass']['value'] == pytest.approx(mass, rel=0.05)
    said = ' '.join(phrases_of_changes(changes, machine))
    if kind == 'revolute':
        assert cause['parameters']['distance']['value'] == pytest.approx(lever, rel=0.05)
        assert 'kg at 0.12 m from its axis' in said
    else:
        assert 'a payload of 0.30 kg' in said


# --------------------------------------------------------------------------------- steady speeds

SPEEDS = [side * speed for speed in (0.2, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 13.0, 16.0,
                                     20.0) for side in (1.0, -1.0)]


def screw(rise: float, exponent: float = 2.0, asymmetry: float = 0.0):
    """Return the friction of a screw that lifts a weight, with a rise towards standstill."""
    def friction(speed):
        level = 2.6e-3 + rise * math.exp(-abs(speed / 4.0) ** exponent)
        return 3e-4 + (level + asymmetry * speed) * math.copysign(1.0, speed) + 5e-5 * speed
    return friction


@pytest.mark.parametrize(('seed', 'exponent', 'rise'), [(0, 2.0, 6e-4), (1, 1.0, 1.2e-3),
                                                        (2, 1.0, 1.2e-3)])
def test_friction_that_rises_towards_standstill_shows_at_steady_speeds(seed, exponent, rise):
    """An exponential rise over two decades of speed looks much like a power of the speed."""
    found = diagnosed(held_speeds(screw(rise, exponent), SPEEDS, 1e-4, seed), [], axis())
    assert found.verdict == 'explained'
    causes = {cause.effect.name: cause for cause in found.causes}
    offset = causes.pop('torque_offset')
    assert offset.parameters['offset'].value[0] == pytest.approx(3e-4, rel=0.1)
    (name, cause), = causes.items()
    assert 'stribeck' in (name, *cause.twins)
    if name == 'stribeck':
        velocity = cause.parameters['stribeck_velocity']
        assert abs(velocity.value[0] - 4.0) < 3.0 * velocity.std[0]
    else:
        assert exponent != 2.0
    assert found.left_out == ('actuator_inertia',)


@pytest.mark.parametrize('seed', [101, 104])
def test_deviations_hold_the_law_of_a_rise_that_the_data_do_not_tell(seed):
    """An exponential is told as the usual Gaussian, whose velocity is another."""
    found = diagnosed(held_speeds(screw(6e-4, 1.0), SPEEDS, 1e-4, seed), [], axis())
    parameters = next(cause for cause in found.causes
                      if cause.effect.name == 'stribeck').parameters
    exponent, velocity = parameters['exponent'], parameters['stribeck_velocity']
    assert exponent.value[0] == 2.0
    assert abs(exponent.value[0] - 1.0) < 2.0 * exponent.std[0]
    assert velocity.std[0] > 0.3 * velocity.value[0]
    told = diagnosed(held_speeds(screw(2.4e-3, 2.0), SPEEDS, 1e-5, seed), [], axis())
    velocity = next(cause for cause in told.causes
                    if cause.effect.name == 'stribeck').parameters['stribeck_velocity']
    assert velocity.std[0] < 0.15 * velocity.value[0]


def whirring(speed, power, seed):
    """Return a log of an axis with friction that is a power of the speed, at speeds of any size."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, 24.0, 0.002)
    size = speed * np.array((0.6, 0.3, 0.1))[:, None]
    rate = (np.array((0.9, 1.7, 3.1)) * random.uniform(0.8, 1.2, 3))[:, None]
    angle = rate * t + 6.0 * random.random((3, 1))
    q, qd, qdd = ((size * wave).sum(axis=0) for wave in (
        np.sin(angle) / rate, np.cos(angle), -rate * np.sin(angle)))
    friction = np.sign(qd) * (0.02 + 0.1 * np.abs(qd / speed) ** power)
    return log_of(axis(), t, q[:, None], (0.03 / speed * qdd + friction)[:, None], seed, 1e-3)


@cache
def whirred(speed, power):
    """Return the diagnosis of two such logs."""
    return diagnosed([whirring(speed, power, 1)], [whirring(speed, power, 2)], axis())


@pytest.mark.parametrize(('power', 'speed'), [(0.5, 100.0), (0.8, 0.5), (2.0, 0.5), (2.0, 100.0)])
def test_friction_may_be_a_power_of_the_speed_and_little_else(power, speed):
    """It is several times the linear friction, and at 1 rad/s it may be anything."""
    found = whirred(speed, power)
    cause, = found.causes
    assert cause.effect.name == 'nonlinear_viscous'
    assert cause.parameters['exponent'].value[0] == pytest.approx(power, abs=0.05)
    assert found.holdout.extended_rms[0] < 1.2 * found.holdout.noise_floor_rms[0]


def test_a_noise_floor_is_no_louder_than_what_is_left():
    """Of a log whose torque is loud above the filter everywhere, and quiet below it."""
    random = np.random.default_rng(5)
    logs = []
    for seed in (1, 2):
        log = whirring(10.0, 1.0, seed)
        white = random.normal(scale=0.05, size=log.tau.shape)
        logs.append(replace(log, tau=log.tau + white - low_pass(white, 85.0, log.period, order=8)))
    found = diagnosed(logs[:1], logs[1:], axis())
    floor = runs_of_log(logs[1], axis(), found.fit_runs[0].conditioning)[0].noise_floor[0]
    left = found.holdout.extended_rms[0]
    assert floor > 3.0 * left
    assert found.holdout.noise_floor_rms[0] <= left * (1.0 + 1e-9)


@pytest.mark.usefixtures('unrendered')
@pytest.mark.parametrize('kind', ['revolute', 'linear'])
def test_reasons_of_rejected_names_have_the_units_of_the_machine(kind):
    told = replace(whirred(0.5, 0.8), rejected=(Rejected('stribeck', 'found -0.3 N m at 2 rad/s'),))
    machine = axis(kind=kind)
    page = report_of_diagnosis(told, outcome_of_diagnosis(told, machine), machine, [], {})
    assert ('0.3 N at 2 m/s' in page) == (kind == 'linear')
    assert ('0.3 N m at 2 rad/s' in page) == (kind == 'revolute')


@pytest.mark.parametrize('seed', range(3))
def test_friction_as_the_root_of_the_speed_shows_at_steady_speeds(seed):
    speeds = [sign * speed for speed in np.linspace(8.0, 120.0, 12) for sign in (1.0, -1.0)]
    logs = held_speeds(lambda speed: math.copysign(0.0127 * math.sqrt(abs(speed)), speed), speeds,
                       1e-3, seed)
    cause, = diagnosed(logs, [], axis()).causes
    assert cause.effect.name == 'nonlinear_viscous'
    assert cause.parameters['exponent'].value[0] == pytest.approx(0.5, abs=0.1)


@pytest.mark.usefixtures('unrendered')
@pytest.mark.parametrize('seed', range(3))
def test_steady_speeds_of_plain_friction_are_clean(seed):
    def plain(speed):
        return math.copysign(4.7e-3, speed) + 3e-5 * speed
    logs = held_speeds(plain, SPEEDS, 1.5e-4, seed)
    found = diagnosed(logs, [], axis())
    assert found.verdict == 'clean'
    page = report_of_diagnosis(found, outcome_of_diagnosis(found, axis()), axis(), [], {})
    assert 'Mean torque over speed' in page
    assert 'Sample by sample' not in page


def test_one_log_may_hold_several_speeds():
    parts = held_speeds(screw(6e-4), SPEEDS[8:], 1e-4)
    rate = 0.02
    t = rate * np.arange(round(4.0 * len(parts) / rate))
    speed = np.array(SPEEDS[8:])[np.minimum((t // 4.0).astype(int), len(parts) - 1)]
    q = np.cumsum(speed) * rate
    tau = np.array([screw(6e-4)(one) for one in speed])
    log = replace(parts[0], period=rate, t=t, q=q[:, None], tau=tau[:, None],
                  segments=(slice(0, len(t)),))
    speeds = [plateau.speed for plateau in plateaus_of(log)]
    np.testing.assert_allclose(speeds, SPEEDS[8:], rtol=1e-3)
    assert conditioning_for([log], axis(), CONDITIONING).steady
    assert not conditioning_for([log], axis(), CONDITIONING, Chosen(cutoff_hz=5.0)).steady


@pytest.mark.parametrize('reference', [there_and_back, speeds, lambda t: 4.6 * t])
def test_a_motion_that_changes_its_speed_or_has_one_alone_is_no_set_of_steady_speeds(reference):
    log = recorded(DRIVER, reference, 12.0, 1000.0)
    assert not conditioning_for([log], axis(), CONDITIONING).steady


def held_in_turn(speeds, each):
    """Return positions at one speed after the other, each held for a time."""
    def reference(t):
        number = np.minimum((t / each).astype(int), len(speeds) - 1)
        return np.cumsum(np.array(speeds)[number]) * (t[1] - t[0])
    return reference


@pytest.mark.parametrize(('motor', 'speeds', 'facts'), [
    (Motor(1e-3, 0.07, 1e-3, {6: (0.05, -2.9), 3: (0.013, -1.9)}),
     [sign * speed for sign in (1, -1) for speed in (1.2, 1.5, 1.9, 2.3, 2.8, 3.3, 2.5, 1.6)], {}),
    (PENDULUM, [sign * speed for speed in (0.2, 0.3, 0.4, 0.6) for sign in (1, -1)] * 2,
     {'gravity': 'vertical'})])
def test_steady_speeds_do_not_hide_a_torque_that_follows_the_position(motor, speeds, facts):
    """Means over a speed would leave cogging out, and the weight of an arm."""
    log = recorded(motor, held_in_turn(speeds, 2.5), 2.5 * len(speeds), 100.0, noise=5e-3)
    smooth = replace(motor, lines={}, hanging=0.0)
    flat = recorded(smooth, held_in_turn(speeds, 2.5), 2.5 * len(speeds), 100.0, noise=5e-3)
    assert conditioning_for([flat], axis(), CONDITIONING).steady
    assert not conditioning_for([log], axis(), CONDITIONING).steady
    found = diagnosed([log], [], axis(**facts))
    told = {cause.effect.name: cause for cause in found.causes}
    assert set(told) == ({'cogging'} if motor.lines else set())
    if motor.lines:
        assert {3.0, 6.0} <= set(told['cogging'].parameters['periods'].value)


def strokes(places, rate):
    """Return times, positions and speeds of an axis that goes from place to place, 2.5 s each."""
    t = np.arange(0.0, 2.5 * (len(places) - 1), 1.0 / rate)
    which = np.minimum((t // 2.5).astype(int), len(places) - 2)
    return t, np.interp(t, 2.5 * np.arange(len(places)), places), np.diff(places)[which] / 2.5


def there_and_back_between(reach, count=25):
    """Return places as far as `reach` to either side of zero, each well away from the last."""
    rng, places = np.random.default_rng(5), [0.0]
    while len(places) < count:
        place = rng.uniform(-reach, reach)
        if abs(place - places[-1]) > 0.2 * reach:
            places.append(place)
    return np.array(places)


SHORT, LONG = there_and_back_between(1.4), there_and_back_between(9.0)
ONE_WAY = np.cumsum(np.random.default_rng(6).uniform(2.0, 9.0, 25))


@pytest.mark.parametrize(('places', 'torque'), [
    (SHORT, lambda _q, _side: 0.0), (LONG, lambda _q, _side: 0.0), (ONE_WAY, lambda _q, _side: 0.0),
    (SHORT, lambda q, _side: 0.5 * q), (LONG, lambda q, _side: 0.1 * q),
    (SHORT, lambda q, side: 1.5 * side * np.exp(-((q - 0.4) / 0.3) ** 2)),
    (ONE_WAY, lambda q, _side: 0.5 * np.sin(3.0 * q))])
def test_steady_speeds_do_not_hide_what_follows_the_place_in_strokes_of_any_length(places, torque):
    """Each stroke has its own middle, and a mean torque that has most of a spring in it."""
    t, q, speed = strokes(places, 100.0)
    side = np.sign(speed)
    tau = (6.0 * side + 1.5 * speed + torque(q, side)
           + np.random.default_rng(7).normal(0.0, 0.1, len(t)))
    log = log_of(axis(), t, q[:, None], tau[:, None], 1, 0.1)
    assert conditioning_for([log], axis(), CONDITIONING).steady == (torque(1.0, 1.0) == 0.0)


def test_steady_speeds_identify_friction_and_leave_the_inertia_out():
    logs = held_speeds(lambda speed: math.copysign(4.7e-3, speed) + 3e-5 * speed, SPEEDS, 3e-4)
    conditioning = conditioning_for(logs, axis(), Conditioning())
    found = identify(logs, axis(), conditioning=conditioning)
    values = {name: parameter.value for name, parameter in found.parameters.items()}
    assert values == {'coulomb_friction': pytest.approx(4.7e-3, rel=0.02),
                      'viscous_friction': pytest.approx(3e-5, rel=0.15)}
    assert [term.name for term in found.left_out] == ['actuator_inertia']
    assert found.model_file({}).parameters['actuator_inertia'].value == 0.0
    with pytest.raises(InputError, match='holds no speed for 2 s'):
        identify([replace(logs[0], t=logs[0].t[:5], q=logs[0].q[:5], tau=logs[0].tau[:5],
                          segments=(slice(0, 5),))], axis(), conditioning=conditioning)


@pytest.mark.usefixtures('unrendered')
def test_one_steady_speed_alone_is_said_to_be_too_little():
    alone = held_speeds(screw(6e-4), SPEEDS[:1], 3e-4)
    found = diagnosed(alone, [], axis())
    assert found.verdict == 'unusable_data'
    assert 'Mean torque' not in report_of_diagnosis(found, outcome_of_diagnosis(found, axis()),
                                                    axis(), [], {})
    with pytest.raises(InputError, match='1 usable rows'):
        identify(alone, axis(), conditioning=conditioning_for(alone, axis(), Conditioning()))


def test_a_few_steady_speeds_are_too_few():
    found = diagnosed(held_speeds(screw(6e-4), SPEEDS[:8], 3e-4), [], axis())
    assert found.verdict == 'unusable_data'
    assert any('steady speeds are fitted, 10 are needed' in reason for reason in found.reasons)


def test_six_speeds_both_ways_of_a_fast_log_are_no_measurement_of_steady_speeds():
    """Twelve plateaus leave eight to fit and four to hold out: the log was refused."""
    speeds = np.array([rate * way for rate in (0.4, 0.8, 1.6, 2.4, 3.2, 4.0) for way in (1, -1)])
    t = np.arange(0.0, 4.0 * len(speeds), 1e-3)
    which = np.minimum((t // 4.0).astype(int), len(speeds) - 1)
    edge = np.clip((t % 4.0) / 0.4, 0.0, 1.0)
    smooth = edge ** 2 * (3.0 - 2.0 * edge)
    before = np.concatenate(([0.0], speeds[:-1]))
    speed = before[which] + smooth * (speeds[which] - before[which])
    q = np.cumsum(speed) * 1e-3
    sound = 0.02 * np.gradient(speed, 1e-3) + 0.2 * np.tanh(speed / 1e-3) + 0.03 * speed
    found = []
    for tau in (sound, sound + 0.05 * np.sin(24.0 * q + 0.3)):
        log = log_of(axis(), t, q[:, None], tau[:, None], 1, 0.01)
        conditioning = conditioning_for([log], axis(), CONDITIONING)
        assert not conditioning.steady
        found.append(diagnose([log], axis(), conditioning=conditioning))
    assert found[0].verdict == 'clean'
    cause, = found[1].causes
    assert (cause.effect.name, cause.parameters['periods'].number) == ('cogging', 24.0)
