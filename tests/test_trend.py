"""A machine over its life: when series step and drift, bags as tasks, what is kept, bad bags."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from browser import check_in_browser
from report_pages import checked_page
from test_commands import run
from year import DRY, FLOWING, NAMES, YEAR, drawn_year

from par4_dynamics.base_terms import base_terms
from par4_dynamics.effects.catalogue import CATALOGUE
from par4_dynamics.model_file import EffectEntry, ModelFile, read_model_file, write_model_file
from par4_dynamics.model_from_file import build_model
from par4_dynamics.parameters import Parameter
from par4_dynamics.state import GRAVITY, State
from par4_identification.changes.readings import Added
from par4_identification.commands import trend
from par4_identification.diagnosis.evidence.hypothesis import Hypothesis
from par4_identification.diagnosis.verdict.rattle import WIDTH_ERROR
from par4_identification.logs.log import Log
from par4_identification.reports.outcome.trend import outcome_of_life, sentence_of_event
from par4_identification.trend import tasks
from par4_identification.trend.bag_values import (
    EARLIEST,
    BagValues,
    EffectSize,
    sizes_of_effect,
    values_of_bag,
)
from par4_identification.trend.channels import channels_of
from par4_identification.trend.course import course_of
from par4_identification.trend.kept import FOLDER, Kept
from par4_identification.trend.life import FALSE_ALARMS, life_of, mean_of
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.files import write_yaml
from par4_kinematics.robot import Axis
from par4_kinematics.stamps import SECOND
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation
from robots import REFERENCE

STD = np.array([2e-4, 8e-4, 8e-4, 3e-3, 3e-3, 2e-3])
"""Of the parameters of a joint, about those of a bag of 20 s."""
COVARIANCE = np.diag(np.tile(STD ** 2, 4))
SLIDE = Axis(schema='par4/axis/1', name='slide', joint='the joint', kind='linear', gain=1.0)
DAY_NS = 86_400 * SECOND
SECONDS = 1_772_000_000
"""25 February 2026."""


def noisy(values, seed, std=1.0):
    return values + std * np.random.default_rng(seed).normal(size=np.shape(values))


# ---------------------------------------------------------------------------------- courses


def test_a_step_is_found_where_it_is():
    t = np.arange(60.0)
    course = course_of(t, noisy(np.where(t >= 23, 8.0, 0.0), 1), np.ones(60), 1e-4)
    assert [(item.kind, item.index) for item in course.changes] == [('step', 23)]
    found = course.changes[0]
    assert abs(found.step - 8.0) < 4.0 * found.std[0]


def test_a_drift_is_found_where_it_begins():
    t = np.arange(80.0)
    found = [course_of(t, noisy(np.maximum(t - 30.0, 0.0), seed), np.ones(80), 1e-4).changes
             for seed in range(20)]
    assert all(len(changes) == 1 for changes in found)
    for change, in found:
        assert change.slope == pytest.approx(1.0, abs=4.5 * change.std[1])
    assert sum(abs(change.index - 30) <= 2 for change, in found) >= 16


def test_one_odd_value_is_no_change():
    t = np.arange(50.0)
    values = noisy(np.zeros(50), 3)
    values[20] += 30.0
    course = course_of(t, values, np.ones(50), 1e-4)
    assert course.changes == ()
    assert [(item.kind, item.index) for item in course.breaks] == [('odd', 20)]


def test_a_drift_that_ends_is_no_row_of_odd_values():
    # eight strong values between flat ones, as wear that a repair ends leaves them
    t = np.arange(48.0)
    values = noisy(np.where((t >= 12) & (t < 20), 20.0 * (t - 11.0), 0.0), 4)
    course = course_of(t, values, np.ones(48), 1e-5)
    assert all(item.kind != 'odd' for item in course.breaks)
    assert {item.index for item in course.changes} <= {11, 12, 20}
    assert len(course.changes) == 2


@pytest.mark.parametrize('stated', [1.0, 0.3])
def test_false_alarms_are_as_rare_as_asked_for(stated):
    # also where values scatter more than their deviations say
    series, length, chance = 300, 40, 2e-3
    alarms = sum(len(course_of(np.arange(length, dtype=float), noisy(np.zeros(length), seed),
                               np.full(length, stated), chance).breaks)
                 for seed in range(series))
    assert alarms <= series * length * chance  # 24 are expected at most


def test_seasons_are_no_change():
    t = np.sort(np.random.default_rng(5).uniform(0.0, YEAR, 150))
    values = noisy(20.0 * np.sin(2.0 * np.pi * t / YEAR), 5)
    assert course_of(t, values, np.ones(150), 1e-4, yearly=True).breaks == ()
    assert course_of(t, values, np.ones(150), 1e-4).breaks  # without them it would be


def test_few_values_say_nothing():
    assert course_of(np.arange(4.0), np.array([0.0, 0.0, 9.0, 9.0]), np.ones(4), 1e-3).breaks == ()


def test_values_in_no_doubt_are_a_constant():
    course = course_of(np.arange(8.0), np.full(8, 2.0), np.zeros(8), 1e-4)
    assert course.breaks == ()
    assert course.fitted.tolist() == [2.0] * 8
    assert course.scatter == 0.0


# -------------------------------------------------------------------------------------- life


def test_weather_moves_what_is_common_and_wear_what_is_one_joints():
    year = drawn_year(1, bags=60, eventful=False)
    values = year.values.copy()
    values[30:, 2, NAMES.index('viscous_friction')] *= 1.2
    bags = [BagValues(str(number), number, 20.0, NAMES, own, COVARIANCE)
            for number, own in enumerate(values)]
    found = {channel.name: channel.values for channel in channels_of(bags)}
    jump = {joint: np.median(found[f'viscous_friction[{joint}]'][30:])
            / np.median(found[f'viscous_friction[{joint}]'][:30]) for joint in range(4)}
    assert jump[2] == pytest.approx(1.2)
    assert [jump[joint] for joint in (0, 1, 3)] == pytest.approx([1.0] * 3, abs=1e-9)
    assert np.ptp(found['viscous_friction']) > 0.05  # the seasons


@pytest.mark.parametrize(('kind', 'before', 'added', 'told'), [
    ('revolute', (3.0, 0.5), (1.0, 1.0 / 6.0), 'the load that hangs on the joint a third larger'),
    ('linear', (50.0,), (GRAVITY,), 'a payload of 1.0 kg on the joint')])
def test_the_load_of_an_axis_that_lifts_it_is_followed(kind, before, added, told):
    axis = Axis(schema='par4/axis/1', name='lift', joint='the joint', kind=kind, gain=1.0,
                gravity='vertical')
    terms = base_terms(State(*np.zeros((4, 1, 1)), hanging=axis.hanging))
    old = np.array((2.0, 3.0, 4.0, *before))
    new = old + np.array((float(kind == 'linear'), 0.0, 0.0, *added))  # a mass is moved, too
    std = np.full(len(terms), 1e-3)
    bags = [BagValues(str(number), EARLIEST + number * 7 * DAY_NS, 20.0,
                      tuple(term.name for term in terms),
                      noisy(new if number >= 6 else old, number, std)[None], np.diag(std ** 2))
            for number in range(12)]
    life = life_of(bags)
    event, = life.events
    assert event.index == 6
    assert outcome_of_life(life, {}, axis).sentence == f'On 12 February {told}.'


def test_a_year_is_told():
    year = drawn_year(7, bags=120)
    life = life_of(year.bags(COVARIANCE, np.random.default_rng(7)))
    places = [int(np.searchsorted(year.t, item.day)) for item in year.happened]
    told = [event.index for event in life.events]
    for place in places:
        assert min(abs(index - place) for index in told) <= 2
    for index in told:
        assert min(abs(index - place) for place in places) <= 2
    wear = next(event for event in life.events if any(
        part.item.slope > 0.0 and life.channels[part.channel].name
        == f'viscous_friction[{year.joint}]' for part in event.happenings))
    sentence = sentence_of_event(life, wear, REFERENCE)
    assert f'viscous friction of joint {year.joint} began to rise on ' in sentence
    slope = next(part.item for part in wear.happenings if part.item.slope).slope
    assert 7.0 * slope == pytest.approx(year.rate, rel=0.1)
    load = next(event for event in life.events if any(
        life.channels[part.channel].name.startswith('platform') and part.item.step > 0.0
        for part in event.happenings))
    assert 'a payload of ' in sentence_of_event(life, load, REFERENCE)
    assert 'half plate' in outcome_of_life(life, {}, REFERENCE).sentence or len(told) > 4


def test_a_quiet_year_is_quiet():
    year = drawn_year(8, bags=120, eventful=False)
    life = life_of(year.bags(COVARIANCE, np.random.default_rng(8)))
    assert life.events == ()
    assert outcome_of_life(life, {}, REFERENCE).sentence.startswith('Nothing changed')


@pytest.mark.parametrize(('weather', 'seed'), [(0.0, 0), (0.0, 1), (1.5, 0)])
def test_what_the_seasons_and_the_weather_do_is_no_part_of_an_event(weather, seed):
    # an event in spring, when the temperature rises by 5 K in the five weeks between the bags
    # before and after it: the friction of all joints falls as well, by no reading of this event
    t = 7.0 * np.arange(53)
    temperature = 8.0 * np.sin(2.0 * np.pi * t / YEAR) + noisy(np.zeros(53), seed, weather)
    values = np.tile(np.array([1.0, 1.0, 2.0, 3.0, 3.0, 2.0]), (53, 4, 1))
    values[26:, 2, NAMES.index('viscous_friction')] += 0.2
    for name, share in (('coulomb_friction', DRY), ('viscous_friction', FLOWING)):
        values[..., NAMES.index(name)] *= (1.0 + share * temperature)[:, None]
    life = life_of([
        BagValues(str(number), EARLIEST + round(day * DAY_NS), 20.0, NAMES, own, COVARIANCE)
        for number, (day, own) in enumerate(zip(t, noisy(values / STD, seed) * STD))])
    event, = life.events
    assert event.index == 26
    read, = event.read
    assert read.reading == Added(2, 'viscous_friction')
    assert read.size == pytest.approx(0.2, abs=0.02)


def test_a_phase_near_half_a_turn_does_not_jump():
    phase = 3.1 + 0.1 * np.random.default_rng(2).normal(size=20)
    wrapped = np.remainder(phase + np.pi, 2.0 * np.pi) - np.pi
    assert np.ptp(wrapped) > 6.0
    year = drawn_year(1, bags=20, eventful=False)
    bags = [replace(bag, effects=(EffectSize('cogging.phase[1]', float(angle), 0.1, 'rad'),))
            for bag, angle in zip(year.bags(COVARIANCE, np.random.default_rng(3)), wrapped)]
    channel, = (item for item in channels_of(bags) if item.name == 'cogging.phase[1]')
    turns = (channel.values - phase) / (2.0 * np.pi)
    assert turns == pytest.approx(np.round(turns[0]), abs=1e-9)


def bags_of(values, covariance):
    """Return bags that tell values (n, J, p) with one covariance."""
    return [BagValues(str(number), number, 20.0, NAMES, own, covariance)
            for number, own in enumerate(values)]


@pytest.mark.parametrize('weather', [0.0, 3.0])
def test_the_mean_of_bags_is_as_certain_as_it_says(weather):
    # alone the covariance of the bags counts; what they scatter beyond it comes to that
    random = np.random.default_rng(11)
    moved = weather * np.tile(STD * [0.0, 0.0, 0.0, 0.0, 1.0, 1.0], 4)  # friction of all joints
    noise = noisy(np.zeros((1000, 5, 24)), 12) * np.tile(STD, 4)
    values = noise + random.normal(size=(1000, 5, 1)) * moved
    found = [mean_of(bags_of(part.reshape(5, 4, 6), COVARIANCE)) for part in values]
    means = np.array([mean.ravel() for mean, _ in found])
    told = np.mean([covariance for _, covariance in found], axis=0)
    ratio = np.diag(told) / means.var(axis=0)
    assert np.all((ratio > 0.85) & (ratio < 1.5))  # 2 if the covariance counts twice
    least = min(np.linalg.eigvalsh(covariance / np.outer(*[np.tile(STD, 4)] * 2))[0]
                for _, covariance in found[:50])
    assert least > 0.19  # a fifth of the covariance of a bag, whatever the scatter is
    if weather:
        shared = told[4::6, 4::6] / told[4, 4]
        assert np.all(shared > 0.7)  # of one temperature


def test_a_bag_alone_is_as_certain_as_it_says():
    mean, covariance = mean_of(bags_of(np.ones((1, 4, 6)), COVARIANCE))
    np.testing.assert_array_equal(mean, np.ones((4, 6)))
    np.testing.assert_array_equal(covariance, COVARIANCE)


@pytest.mark.parametrize('worn', [0.0, 1.5])
def test_series_of_friction_scatter_as_they_say(worn):
    # a joint is part of the common factor, against which it is told
    values = np.tile(np.array([1.0, 1.0, 2.0, 3.0, 3.0, 2.0]), (2000, 4, 1))
    values = noisy(values / STD, 13) * STD
    values[1000:, 2, NAMES.index('coulomb_friction')] += worn
    for channel in channels_of(bags_of(values, COVARIANCE)):
        if channel.name.startswith('coulomb_friction'):
            for half in (slice(0, 1000), slice(1000, 2000)):
                assert np.mean(channel.std[half]) == pytest.approx(
                    np.std(channel.values[half]), rel=0.1)


def test_no_joint_alone_is_what_is_common():
    # of two in the middle the first alone was near enough, and then in no doubt against itself
    values = np.ones((9, 4, 6))
    values[4, :, NAMES.index('coulomb_friction')] = (0.95, 1.05, 0.5, 1.5)
    covariance = COVARIANCE.copy()
    covariance[4, 4] = (2.0 * STD[4]) ** 2
    found = {channel.name: channel for channel in channels_of(bags_of(values, covariance))}
    assert found['coulomb_friction'].values == pytest.approx(1.0)
    for joint in range(4):
        channel = found[f'coulomb_friction[{joint}]']
        assert channel.values[4] == pytest.approx(values[4, joint, 4], rel=1e-6)
        assert np.all(channel.std > 1e-3)


# ---------------------------------------------------------------------------------- command


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Return seven short bags, a payload on the last three, a week apart."""
    folder = tmp_path_factory.mktemp('bags')
    year = drawn_year(9, bags=7, eventful=False)
    year.values[4:, :, NAMES.index('platform_mass_1')] += 0.5
    motion = excitation_motion(REFERENCE, 4.0, 3)
    for number in range(7):
        model = build_model(REFERENCE, year.model_file(number, 'paper'))
        simulation = build_simulation(REFERENCE, model, 'exact', seed=number, torque_noise=0.05)
        simulate_to_bag(simulation, motion, REFERENCE, folder / f'bag_{number}',
                        began=(SECONDS + 604_800 * number) * SECOND)
    undated = build_simulation(REFERENCE, model, 'exact', seed=99)
    simulate_to_bag(undated, motion, REFERENCE, folder / 'undated')
    return folder


def test_a_payload_is_dated_and_bad_bags_are_said_one_by_one(bags, tmp_path, monkeypatch):
    (tmp_path / 'broken').mkdir()
    shutil.copytree(bags / 'bag_1', tmp_path / 'copy')
    good = [str(bags / f'bag_{number}') for number in range(7)]
    bad = [str(bags / 'undated'), str(tmp_path / 'broken'), str(tmp_path / 'nowhere'),
           str(tmp_path / 'copy')]
    monkeypatch.setattr(tasks, 'FEW', 100)  # in this process
    output = tmp_path / 'life'
    done = run(trend, *good, *bad, good[0], bad[0], '--robot', 'reference', '--output', output)
    assert done.code == 0, done.err
    assert f'not used: {good[0]}: given twice; it counts once' in done.out
    assert done.out.count('not used: ') == len(bad) + 1  # the date that is missing goes first
    assert ('so it has no date; record with the wall clock, give par4_bag times with dates, or '
            'simulate with par4_simulate --date'
            in ' '.join(done.out.split()))
    result = json.loads((output / 'trend.json').read_text(encoding='utf-8'))
    assert result['schema'] == 'par4/trend/1'
    assert [item['bag'] for item in result['bags']] == good
    assert {item['bag'] for item in result['refused']} == {*bad, good[0]}
    assert all(item['bag'] in item['reason'] for item in result['refused'])
    assert result['false_alarms_per_bag'] == FALSE_ALARMS
    event, = result['changes']
    assert event['bag'] == good[4]
    assert event['date'].startswith('2026-03-25')
    assert 'a payload of 0.50 kg at half plate 1' in event['sentence']
    assert result['sentence'].startswith('On 25 March a payload of 0.50 kg')
    checked_page(output / 'report.html', 1)
    check_in_browser(output / 'report.html', 1)
    # what was seen is not computed again
    monkeypatch.setattr('par4_identification.jobs.trend.results_of', lambda _, left, __: iter(
        [(bag, {'error': 'computed again'}) for bag in left]))
    assert run(trend, *good, '--robot', 'reference', '--output', output).code == 0
    again = json.loads((output / 'trend.json').read_text(encoding='utf-8'))
    assert again['changes'] == result['changes']
    assert again['refused'] == []


def test_what_was_kept_of_a_bag_and_is_damaged_counts_as_not_kept(tmp_path):
    kept = Kept(tmp_path, REFERENCE, None, None)
    assert kept.read('bag') is None
    result = BagValues('a', 7, 20.0, NAMES, np.ones((4, len(NAMES))),
                       np.eye(4 * len(NAMES))).to_json()
    kept.write('bag', result)
    assert kept.read('bag') == result
    others = ([1, 2], {}, None, {'stamp': 1}, {**result, 'stamp': float('nan')},
              {**result, 'stamp': float('inf')}, {**result, 'values': [[1.0], [2.0, 3.0]]},
              {**result, 'values': [1.0]}, {**result, 'covariance': [[1.0]]},
              {**result, 'terms': []}, {**result, 'effects': [{'label': 'a'}]},
              {**result, 'effects': 1})
    for damage in (b'{"stamp"', b'\xff\x00', b'[' * 100_000,
                   *(json.dumps(other).encode() for other in others)):
        (tmp_path / FOLDER / 'bag.json').write_bytes(damage)
        assert kept.read('bag') is None


def test_another_version_computes_a_bag_anew(tmp_path, monkeypatch):
    def key():
        return Kept(tmp_path, REFERENCE, None, None).key('a bag')

    monkeypatch.setattr('par4_identification.trend.kept.bag_sha256', lambda _: 'its content')
    this = key()
    assert key() == this
    monkeypatch.setattr('par4_identification.trend.kept.version', lambda _: 'the next one')
    assert key() != this


def with_effects(model_file, **effects):
    """Return a model with effects, by name the parameters with their units and the joints."""
    return model_file.model_copy(update={'effects': tuple(
        EffectEntry(effect=name, joints=joints, parameters={
            key: Parameter(value=value, unit=unit) for key, (value, unit) in parameters.items()})
        for name, (joints, parameters) in effects.items())})


@pytest.mark.usefixtures('unrendered')
def test_sizes_of_effects_in_the_model_are_followed(tmp_path, monkeypatch):
    # of the machine that makes the bags cogging of joint 2 doubles in size at the fourth
    table = read_model_file('table1')
    known = with_effects(table, cogging=((2,), {
        'periods': (24.0, '1/turn'), 'amplitude': (0.3, 'N m'), 'phase': (3.1, 'rad')}))
    for number in range(6):
        model_file = with_effects(table, cogging=((2,), {
            'periods': (24.0, '1/turn'), 'amplitude': (0.3 if number < 3 else 0.6, 'N m'),
            'phase': (3.1, 'rad')}))
        simulation = build_simulation(REFERENCE, build_model(REFERENCE, model_file), 'exact',
                                      seed=number, torque_noise=0.05)
        simulate_to_bag(simulation, excitation_motion(REFERENCE, 4.0, 3), REFERENCE,
                        tmp_path / f'bag_{number}', began=(SECONDS + 604_800 * number) * SECOND)
    write_model_file(tmp_path / 'known.yaml', known)
    monkeypatch.setattr(tasks, 'FEW', 100)  # in this process
    bags = [tmp_path / f'bag_{number}' for number in range(6)]
    done = run(trend, *bags, '--robot', 'reference', '--model', tmp_path / 'known.yaml',
               '--output', tmp_path / 'life')
    assert done.code == 0, done.err
    result = json.loads((tmp_path / 'life' / 'trend.json').read_text(encoding='utf-8'))
    event, = result['changes']
    assert event['bag'] == str(bags[3])
    assert [part['name'] for part in event['series']] == ['cogging.amplitude[2]']
    part, = event['series']
    assert part['step'] == pytest.approx(0.3, abs=4.0 * part['step_std'])
    assert result['sentence'].startswith('On 18 March cogging amplitude of joint 2 up by 0.3')


def test_a_gap_is_read_from_the_bounces_of_its_load(tmp_path):
    # the columns of backlash gave a gap below zero here, and a smaller one for a wider gap
    found = []
    for number, gap in enumerate((1e-3, 2e-3)):
        model_file = with_effects(read_model_file('table1'), backlash=((2,), {
            'gap': (gap, 'rad')}))
        simulation = build_simulation(REFERENCE, build_model(REFERENCE, model_file), 'exact',
                                      seed=number, torque_noise=0.05)
        simulate_to_bag(simulation, excitation_motion(REFERENCE, 5.0, 3), REFERENCE,
                        tmp_path / f'{number}', began=SECONDS * SECOND)
        size, = values_of_bag(str(tmp_path / f'{number}'), REFERENCE, model_file).effects
        assert size.label == 'backlash.gap[2]'
        assert size.value == pytest.approx(gap, rel=2.0 * WIDTH_ERROR)
        found.append(size.value)
    assert found[1] > 1.5 * found[0]


def test_each_order_of_a_cogging_is_followed_on_each_joint():
    effect = CATALOGUE['cogging']
    item = Hypothesis(effect, {'periods': np.array([7.0, 84.0])}, (0, 3))
    value = ((0.3, 0.2), (0.05, 0.04))
    told = {'amplitude': Parameter(value=value, std=value, unit='N m'),
            'phase': Parameter(value=value, std=value, unit='rad'),
            'periods': Parameter(value=(7.0, 84.0), unit='1/turn')}
    found = {size.label: size.value for size in sizes_of_effect(item, told, 4)}
    assert len(found) == 8
    assert found['cogging.amplitude.order_7[3]'] == 0.2
    assert found['cogging.phase.order_84[0]'] == 0.05


def test_each_term_of_a_series_is_followed():
    item = Hypothesis(CATALOGUE['position_torque'], {'degree': 2.0, 'low': -1.0, 'high': 1.0},
                      (0,))
    told = {'coefficients': Parameter(value=(0.1, 0.4, 0.2), std=(0.01, 0.02, 0.03), unit='N m'),
            'range': Parameter(value=(-1.0, 1.0), std=(0.0, 0.0), unit='rad')}
    assert [(size.label, size.value, size.std) for size in sizes_of_effect(item, told, 1)] == [
        ('position_torque.coefficients.term_0', 0.1, 0.01),
        ('position_torque.coefficients.term_1', 0.4, 0.02),
        ('position_torque.coefficients.term_2', 0.2, 0.03)]


def log_of_model(model, number, noise=0.1, seconds=5.0):
    """Return a log whose torques are those of a model, with noise; of week `number`."""
    motion = excitation_motion(REFERENCE, seconds, number)
    torque = model.torque(State(motion.t, motion.q, motion.qd, motion.qdd, REFERENCE.geometry,
                                motion.x, motion.xd, motion.xdd))
    return Log(f'bag {number}', REFERENCE.joint_names, (SECONDS + 604_800 * number) * SECOND, 1e-3,
               motion.t, motion.q, noisy(torque, number, noise),
               (slice(0, len(motion.t)),), None, None)


@pytest.mark.parametrize(('name', 'parameters', 'followed'), [
    ('stribeck', {'stribeck_torque': (1.0, 'N m'), 'stribeck_velocity': (0.2, 'rad/s')},
     'stribeck_torque'),
    ('nonlinear_viscous', {'torque': (1.0, 'N m'), 'exponent': (0.5, '1')}, 'torque')])
def test_what_the_model_leaves_out_of_a_friction_is_no_series(name, parameters, followed,
                                                              monkeypatch):
    # the exponent of Stribeck friction and the quadratic form have no deviation
    model_file = with_effects(read_model_file('table1'), **{name: (None, parameters)})
    model = build_model(REFERENCE, model_file)
    logs = {str(number): log_of_model(model, number) for number in range(6)}
    monkeypatch.setattr('par4_identification.trend.bag_values.read_log',
                        lambda bag, *_: logs[bag])
    found = [values_of_bag(bag, REFERENCE, model_file) for bag in logs]
    for bag in found:
        assert [size.label for size in bag.effects] == [
            f'{name}.{followed}[{joint}]' for joint in range(4)]
        for size in bag.effects:
            assert size.value == pytest.approx(1.0, abs=5.0 * size.std)
    assert life_of(found).events == ()


@pytest.mark.parametrize(('name', 'parameters'), [
    ('payload', {'mass': (1.0, 'kg')}), ('payload', {'mass': (0.5, 'kg'), 'half': (2.0, '1')}),
    ('quantization', {'step': (1e-5, 'rad')})])
def test_an_effect_that_has_no_size_of_its_own_is_known(name, parameters, monkeypatch):
    """The columns of a payload are base columns, and quantization has none."""
    table = read_model_file('table1')
    model_file = with_effects(table, **{name: (None, parameters)})
    log = log_of_model(build_model(REFERENCE, model_file), 3)
    monkeypatch.setattr('par4_identification.trend.bag_values.read_log', lambda *_: log)
    found = values_of_bag('a bag', REFERENCE, model_file)
    assert found.effects == ()
    expected = build_model(REFERENCE, table).values
    values = np.stack([expected[name] for name in found.terms], axis=1)
    std = np.sqrt(np.diag(found.covariance)).reshape(values.shape)
    np.testing.assert_array_less(np.abs(found.values - values), 5.0 * std)


def test_of_the_dimensions_those_that_the_model_changes_are_followed(monkeypatch):
    """One motion does not tell all of them apart, so that every bag was refused."""
    model_file = with_effects(read_model_file('table1'), geometry_error=(None, {
        'arm_length': (1e-3, 'm'), 'platform_bar_length': (2e-3, 'm')}))
    log = log_of_model(build_model(REFERENCE, model_file), 3)
    monkeypatch.setattr('par4_identification.trend.bag_values.read_log', lambda *_: log)
    arm, bar = values_of_bag('a bag', REFERENCE, model_file).effects
    assert (arm.label, bar.label) == ('geometry_error.arm_length',
                                      'geometry_error.platform_bar_length')
    assert arm.value == pytest.approx(1e-3, abs=4.0 * arm.std)
    assert bar.value == pytest.approx(2e-3, abs=4.0 * bar.std)


@pytest.mark.parametrize('joints', [(0, 1, 2, 3), (2,)])
def test_a_stiffness_is_told_as_it_is(joints, monkeypatch):
    # a series about rigid joints told 17,300 and 17,600 N m/rad, off by thirty deviations
    model_file = with_effects(read_model_file('table1'), elastic_transmission=(joints, {
        'stiffness': (2e4, 'N m/rad')}))
    log = log_of_model(build_model(REFERENCE, model_file), 3, noise=0.02, seconds=8.0)
    monkeypatch.setattr('par4_identification.trend.bag_values.read_log', lambda *_: log)
    sizes = values_of_bag('a bag', REFERENCE, model_file).effects
    assert [size.label for size in sizes] == [
        f'elastic_transmission.stiffness[{joint}]' for joint in joints]
    for size in sizes:
        assert size.std < 0.02 * size.value
        assert size.value == pytest.approx(2e4, abs=3.0 * size.std)


def slide_bag(number, size=0.002, offset=0.0):
    """Return the log of week `number` of a slide that goes 2 mm to and fro, 95 kg, 20 N."""
    random = np.random.default_rng(number)
    t = 1e-3 * np.arange(10_000)
    waves = size * random.uniform(0.2, 0.6, 4), random.uniform(1.0, 9.0, 4), random.uniform(0, 6, 4)
    q, qd, qdd = (sum(a * w ** order * np.sin(w * t + p + order * np.pi / 2.0)
                      for a, w, p in zip(*waves)) for order in range(3))
    torque = 95.0 * qdd + 20.0 * np.sign(qd) + 200.0 * qd + offset * q / size
    return Log(f'bag {number}', SLIDE.joint_names, (SECONDS + 604_800 * number) * SECOND, 1e-3, t,
               q[:, None], noisy(torque, number, 0.5)[:, None], (slice(0, len(t)),), None, None)


def plateau_bag(number):
    """Return the log of week `number` of the same slide that holds one speed after the other."""
    speeds = np.array([side * speed for speed in (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
                       for side in (1.0, -1.0)])
    speed = np.repeat(speeds, 400)
    torque = noisy(20.0 * np.sign(speed) + 200.0 * speed, number, 0.5)
    return Log(f'bag {number}', SLIDE.joint_names, (SECONDS + 604_800 * number) * SECOND, 1e-2,
               1e-2 * np.arange(len(speed)), 1e-2 * np.cumsum(speed)[:, None], torque[:, None],
               (slice(0, len(speed)),), None, None)


def test_an_axis_is_read_with_the_filters_that_suit_it(monkeypatch):
    # it is slower than an arm of a Par4 ever counts as moving
    monkeypatch.setattr('par4_identification.trend.bag_values.read_log', lambda *_: slide_bag(1))
    found = values_of_bag('a bag', SLIDE)
    std = np.sqrt(np.diag(found.covariance))
    assert np.all(std < 0.1 * found.values[0])
    assert np.all(np.abs(found.values[0] - (95.0, 20.0, 200.0)) < 4.0 * std)


def test_terms_of_a_torque_that_follows_the_position_are_followed(monkeypatch):
    model_file = with_effects(ModelFile(schema='par4/model/1', parameters={
        'actuator_inertia': Parameter(value=95.0, unit='kg'),
        'coulomb_friction': Parameter(value=20.0, unit='N'),
        'viscous_friction': Parameter(value=200.0, unit='N s/m')}), position_torque=(None, {
            'coefficients': ((0.0, 5.0), 'N'), 'range': ((-0.002, 0.002), 'm')}))
    monkeypatch.setattr('par4_identification.trend.bag_values.read_log',
                        lambda *_: slide_bag(1, offset=5.0))
    constant, slope = values_of_bag('a bag', SLIDE, model_file).effects
    assert constant.label == 'position_torque.coefficients.term_0'
    assert slope.label == 'position_torque.coefficients.term_1'
    assert constant.value == pytest.approx(0.0, abs=4.0 * constant.std)
    assert slope.value == pytest.approx(5.0, abs=4.0 * slope.std)


@pytest.mark.usefixtures('unrendered')
def test_steady_speeds_of_an_axis_are_followed_and_other_motions_left_out(tmp_path, monkeypatch):
    logs = {str(tmp_path / f'{number}'): slide_bag(3) if number == 3 else plateau_bag(number)
            for number in range(7)}
    monkeypatch.setattr('par4_identification.trend.bag_values.read_log',
                        lambda bag, *_: logs[bag])
    monkeypatch.setattr(Kept, 'key', lambda _, bag: bag[-1])
    monkeypatch.setattr(tasks, 'FEW', 100)  # in this process
    write_yaml(tmp_path / 'slide.yaml', SLIDE.model_dump(mode='json', by_alias=True))
    done = run(trend, *logs, '--robot', tmp_path / 'slide.yaml', '--output', tmp_path / 'life')
    assert done.code == 0, done.err
    result = json.loads((tmp_path / 'life' / 'trend.json').read_text(encoding='utf-8'))
    assert {series['name'] for series in result['series']} == {
        'coulomb_friction', 'viscous_friction'}
    assert len(result['bags']) == 6
    refused, = result['refused']
    assert refused['reason'] == (
        f'{tmp_path / "3"}: tells actuator_inertia, coulomb_friction, viscous_friction, most bags '
        f'tell coulomb_friction, viscous_friction; give bags of one kind of motion')


def test_no_bag_that_can_be_used(tmp_path):
    done = run(trend, tmp_path / 'a', '--robot', 'reference', '--output', tmp_path / 'life')
    assert done.code == 2
    assert done.err.splitlines()[-1].startswith('error: none of 1 bags can be used')
    assert not (tmp_path / 'life' / 'trend.json').exists()


def test_workers_of_this_machine_that_do_not_answer(monkeypatch):
    """Nobody asked for a scheduler, so none is spoken of."""
    def refuse(*_, **__):
        raise TimeoutError

    monkeypatch.setattr(tasks, 'ONE_THREAD', ())  # this process goes on to other tests
    started = []
    monkeypatch.setattr('dask.distributed.LocalCluster', lambda n_workers, **_: (
        started.append(n_workers), SimpleNamespace(close=lambda: None))[1])
    monkeypatch.setattr('dask.distributed.Client', refuse)
    # a container or taskset may leave few of many processors
    monkeypatch.setattr('os.cpu_count', lambda: 64)
    monkeypatch.setattr('os.sched_getaffinity', lambda _: {5, 6}, raising=False)
    with pytest.raises(InputError, match='^the workers on this machine do not answer; ') as told:
        next(tasks.results_of(str.upper, [str(number) for number in range(tasks.FEW + 1)], None))
    assert 'scheduler' not in str(told.value)
    assert started == [2]


def test_no_scheduler(monkeypatch):
    monkeypatch.setattr(tasks, 'REACHED', 1)
    with pytest.raises(InputError, match='no dask scheduler answers'):
        list(tasks.results_of(str, ['a bag'], 'tcp://127.0.0.1:9'))


@pytest.fixture
def cluster():
    """Return the address of a dask scheduler with one worker, as elsewhere in the network."""
    from dask.distributed import LocalCluster

    with LocalCluster(processes=False, protocol='tcp', n_workers=1, threads_per_worker=1,
                      dashboard_address=':0') as found:
        yield found


def test_a_scheduler_that_runs_elsewhere(cluster):
    found = dict(tasks.results_of(str.upper, ['a', 'b', 'c'], cluster.scheduler_address))
    assert found == {'a': 'A', 'b': 'B', 'c': 'C'}


def test_a_scheduler_without_workers(cluster, monkeypatch):
    monkeypatch.setattr(tasks, 'REACHED', 1)
    cluster.scale(0)
    cluster.sync(cluster._correct_state)
    with pytest.raises(InputError, match='it has no workers; start some with `dask worker tcp:'):
        list(tasks.results_of(str.upper, ['a'], cluster.scheduler_address))


def test_undated_stamps_are_those_before_the_year_2000():
    assert EARLIEST == 946_684_800 * SECOND
