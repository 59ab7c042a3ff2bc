"""Drive gains: from static pushes on a force sensor, and from runs with a known payload."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from browser import check_in_browser
from measured import log_of_model
from test_commands import run

from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import GRAVITY
from par4_identification.commands import drive_gain
from par4_identification.gains import known_payload
from par4_identification.gains.force_timing import late_readings
from par4_identification.gains.known_payload import DriveGains, gains_of_payloads
from par4_identification.gains.static_push import (
    FASTEST,
    FEWEST,
    SETTLED,
    ForceReadings,
    Push,
    gains_of_pushes,
    pushes_of_log,
    read_force,
)
from par4_identification.logs.log import Log
from par4_identification.logs.read_log import read_log
from par4_identification.reports.outcome.drive_gain import gains_remarks, wrong_gains
from par4_identification.reports.outcome.loads import known_payloads
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_yaml
from par4_kinematics.position import forward_kinematics, inverse_kinematics
from par4_kinematics.robot import Axis
from par4_kinematics.workspace import home_pose
from par4_sim.closed_loop.force_plate import ForcePlate
from par4_sim.closed_loop.simulation import build_plant
from par4_sim.closed_loop.static_push import push_poses, simulate_push
from par4_sim.commands import push
from par4_sim.machines.machine_effects import machine_of_model
from robots import OTHER, REFERENCE, model_with, other_model

ERRORS = np.array((0.03, -0.05, 0.08, -0.02))
"""What is recorded over what is delivered, less one."""
MODELS = {'reference': (REFERENCE, read_model('table1_full', REFERENCE)),
          'other': (OTHER, other_model())}


def true_gains(robot, errors=ERRORS):
    return np.array(robot.drive_gain) / (1.0 + errors)


# ----------------------------------------------------------------------------- the force plate


def test_the_plate_carries_what_presses_on_it():
    """Frictionless, without drives: the platform comes to rest where the spring is its weight."""
    model = read_model('table1', REFERENCE)
    bare = replace(model, values={**model.values, 'arm_gravity': np.zeros(4),
                                  'coulomb_friction': np.zeros(4)})
    home = home_pose(REFERENCE)
    plate = ForcePlate(REFERENCE.geometry, home[2], 2e4)
    plant = build_plant(replace(machine_of_model(REFERENCE, bare), loads=(plate,)), 'exact')
    plant.reset(home)
    for _ in range(6000):
        plant.step(np.zeros(4))
    weight = GRAVITY * sum(float(model.values[f'platform_mass_{half}'][0]) for half in (1, 2))
    t, *force = plate.readings[-1]
    assert t == pytest.approx(1.5, abs=2e-3)
    np.testing.assert_allclose(force, (0.0, 0.0, weight), rtol=1e-3)
    assert plant.x[2] == pytest.approx(home[2] - weight / 2e4, rel=1e-5)


def test_the_torque_against_the_plate_is_the_gradient_of_its_energy():
    geometry = REFERENCE.geometry
    x = push_poses(REFERENCE)[1] - (0.0, 0.0, 3e-3, 0.0)
    height, q, step = x[2] + 3e-3, inverse_kinematics(geometry, x), 1e-6
    plate = ForcePlate(geometry, height, 1e5)

    def energy(q):
        return 0.5 * 1e5 * (height - forward_kinematics(geometry, q, x)[2]) ** 2

    gradient = [(energy(q + step * unit) - energy(q - step * unit)) / (2.0 * step)
                for unit in np.eye(4)]
    np.testing.assert_allclose(plate(0.0, q, np.zeros(4)), gradient, rtol=1e-5)
    np.testing.assert_array_equal(plate(1.0, inverse_kinematics(
        geometry, x + (0.0, 0.0, 4e-3, 0.0)), np.zeros(4)), 0.0)


# ------------------------------------------------------------------------------- static pushes


@pytest.fixture(scope='module', params=sorted(MODELS))
def pushed(request, tmp_path_factory):
    """Return robot, bag and readings of pushes at three places by a machine with other gains."""
    robot, model = MODELS[request.param]
    bag = tmp_path_factory.mktemp(request.param) / 'push'
    readings = bag.with_name('push.csv')
    simulate_push(robot, model_with(model, 'drive_gain_error', relative=ERRORS), bag, readings,
                  seed=3, torque_noise=0.05, force_noise=0.5, poses=push_poses(robot)[:3],
                  pushes=1)
    return robot, bag, readings


@pytest.mark.parametrize('there', ['push', 'push.csv'])
def test_a_push_replaces_neither_bag_nor_readings(tmp_path, there):
    (tmp_path / there).write_text('mine')
    done = run(push, '--output', tmp_path / 'push')
    assert done.code != 0
    assert f'{there}: exists already; give another path or remove it' in done.err
    assert [path.name for path in tmp_path.iterdir()] == [there]
    assert (tmp_path / there).read_text() == 'mine'


def test_a_push_whose_readings_cannot_be_written_leaves_no_bag(tmp_path, monkeypatch):
    def refuse(path, _text):
        raise InputError(f'{path}: cannot be written')

    monkeypatch.setattr('par4_sim.closed_loop.static_push.write_text', refuse)
    with pytest.raises(InputError, match=r'push\.csv: cannot be written'):
        simulate_push(REFERENCE, read_model('table1', REFERENCE), tmp_path / 'push',
                      tmp_path / 'push.csv', poses=push_poses(REFERENCE)[:1], pushes=1)
    assert list(tmp_path.iterdir()) == []


def test_gains_come_back_from_pushes(pushed):
    robot, bag, readings = pushed
    pushes = pushes_of_log(read_log(bag, robot), read_force(readings), robot)
    assert len(pushes) == 3
    gains = gains_of_pushes(pushes, robot)
    true = true_gains(robot)
    np.testing.assert_allclose(gains.values, true, rtol=0.005)
    assert np.all(np.abs(gains.values - true) < 3.0 * gains.std)
    assert np.all(gains.std < 0.005 * true)
    np.testing.assert_array_equal(gains.bound, 0.0)
    assert wrong_gains(gains).all()


def test_friction_at_rest_stays_within_its_bound(pushed):
    """The same pushes without the direction of sliding, as the paper had them."""
    robot, bag, readings = pushed
    known = MODELS[robot.name][1].values
    pushes = [replace(push, sliding=np.zeros_like(push.sliding))
              for push in pushes_of_log(read_log(bag, robot), read_force(readings), robot)]
    # creeping makes viscous friction of hundredths of a N m beside
    friction = float(known['coulomb_friction'][0] + 0.05 * known['viscous_friction'][0])
    gains = gains_of_pushes(pushes, robot, friction * 1.1)
    assert np.all(gains.bound > 0.02 * gains.values)
    assert np.all(np.abs(gains.values - true_gains(robot)) < gains.bound + 3.0 * gains.std)
    with pytest.raises(InputError, match='joint 0: 0 and 0 rows in which it slides'):
        gains_of_pushes(pushes, robot)


def synthetic_push(friction, carried=None):
    """Return a push of joints at rest with friction (m, 4), N m; the gains are nominal."""
    carried = np.linspace(2.0, 20.0, len(friction))[:, None] * np.ones(4)
    rest = np.zeros_like(friction)
    return Push('bag', carried, carried + friction + 3.0, rest, rest.astype(bool))


def test_the_bound_is_reached_by_the_worst_friction_and_by_none_else():
    random = np.random.default_rng(2)
    rows = 40
    none = gains_of_pushes([synthetic_push(1e-9 * random.standard_normal((rows, 4)))], REFERENCE,
                           1.5)
    worst = 1.5 * np.sign(np.linspace(-1.0, 1.0, rows))[:, None] * np.ones(4)
    pushed = gains_of_pushes([synthetic_push(worst)], REFERENCE, 1.5)
    # the slope, nominal over gain, is linear in friction
    reach = none.nominal / pushed.values - none.nominal / none.values
    np.testing.assert_allclose(none.bound / none.nominal, reach, rtol=1e-6)
    for _ in range(20):
        friction = random.uniform(-1.5, 1.5, (rows, 4))
        other = gains_of_pushes([synthetic_push(friction)], REFERENCE, 1.5)
        assert np.all(np.abs(other.nominal / other.values - 1.0) <= none.bound / none.nominal)


def pushed_along(*parts):
    """Return the pushes of joints that move by parts, s and rad/s, under 100 N all the time."""
    speed = np.concatenate([np.full(round(seconds / 1e-3), rate) for seconds, rate in parts])
    t = 1e-3 * np.arange(len(speed))
    q = inverse_kinematics(REFERENCE.geometry, home_pose(REFERENCE)) + 1e-3 * np.cumsum(
        speed)[:, None]
    log = Log('bag', REFERENCE.joint_names, 0, 1e-3, t, q, np.zeros_like(q),
              (slice(0, len(t)),), None, None)
    return pushes_of_log(log, ForceReadings(t, np.tile((0.0, 0.0, 100.0), (len(t), 1))), REFERENCE)


def test_joints_count_as_sliding_only_some_way_behind_a_turn():
    """Friction has its level there: 4 mrad/s, a row each 40 ms, two seconds to and fro."""
    push, = pushed_along(*[(2.0, 4e-3), (2.0, -4e-3)] * 3)
    since = (0.04 * np.arange(len(push.sliding))) % 2.0
    assert not push.sliding[4e-3 * since < 0.95 * SETTLED].any()
    assert push.sliding[(4e-3 * since > 1.05 * SETTLED) & (since < 1.5)].all()


def test_a_part_that_is_too_fast_for_a_static_push_is_in_none():
    """Behind it, as behind a turn, friction has its level some way on only."""
    first, second = pushed_along((2.0, 4e-3), (0.5, 2.0 * FASTEST), (2.0, 4e-3))
    rows = len(first.sliding), len(second.sliding)
    assert all(44 <= count <= 50 for count in rows)
    assert first.sliding[:40].any()
    since = 2.0 - 0.04 * np.arange(rows[1])[::-1]
    assert not second.sliding[4e-3 * since < 0.9 * SETTLED].any()
    assert second.sliding[(since > 1.0) & (since < 1.5)].all()


def test_readings_on_another_clock_and_of_another_sign_are_refused(pushed):
    robot, bag, readings = pushed
    log, force = read_log(bag, robot), read_force(readings)
    with pytest.raises(InputError, match='readings on the clock of the bag'):
        pushes_of_log(log, ForceReadings(force.t + 1e9, force.force), robot)
    with pytest.raises(InputError, match='no push of at least'):
        pushes_of_log(log, ForceReadings(force.t, 0.0 * force.force), robot)
    with pytest.raises(InputError, match='check unit, sign, frame and clock'):
        gains_of_pushes(pushes_of_log(log, ForceReadings(force.t, -force.force), robot), robot)


@pytest.mark.parametrize(('content', 'message'), [
    ('t,fx,fy\n0,1,2\n', 'expected the header t,fx,fy,fz'),
    ('t,fx,fy,fz\n0,1,2\n', 'expected four numbers in every row'),
    ('t,fx,fy,fz\n0,1,2,a\n', 'expected four numbers in every row'),
    ('t,fx,fy,fz\n0,1,2,nan\n1,1,1,1\n', 'finite numbers with increasing t'),
    ('t,fx,fy,fz\n1,1,2,3\n0,1,1,1\n', 'finite numbers with increasing t'),
    ('', 'expected the header')])
def test_readings_that_are_none_are_refused_in_one_line(tmp_path, content, message):
    path = tmp_path / 'force.csv'
    path.write_text(content, encoding='utf-8')
    with pytest.raises(InputError, match=message) as refused:
        read_force(path)
    assert '\n' not in str(refused.value)
    with pytest.raises(InputError, match='no such file'):
        read_force(tmp_path / 'none.csv')
    with pytest.raises(InputError, match=r'cannot be read as text \(Is a directory\)'):
        read_force(tmp_path)


def test_readings_may_begin_with_the_mark_of_a_spreadsheet(tmp_path):
    path = tmp_path / 'force.csv'
    path.write_text('t,fx,fy,fz\n0,1,2,3\n1,4,5,6\n', encoding='utf-8-sig')
    readings = read_force(path)
    np.testing.assert_array_equal(readings.t, (0.0, 1.0))
    np.testing.assert_array_equal(readings.force, ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))


def test_the_command_writes_gains_and_report(pushed, tmp_path):
    robot, bag, readings = pushed
    named = tmp_path / 'robot.yaml'
    write_yaml(named, robot.model_dump(mode='json', by_alias=True))
    done = run(drive_gain, f'{bag}={readings}', '--robot', named, '--output', tmp_path)
    assert done.code == 0, done.err
    assert 'The drive gains are' in done.out
    content = json.loads((tmp_path / 'drive_gain.json').read_text(encoding='utf-8'))
    assert content['schema'] == 'par4/drive_gain/1'
    np.testing.assert_allclose(content['drive_gain']['value'], true_gains(robot), rtol=0.005)
    page = (tmp_path / 'report.html').read_text(encoding='utf-8')
    check_in_browser(tmp_path / 'report.html', 0)
    assert 'All joints slid both ways' in page
    assert 'Write the gains into drives.gain' in page
    copy = shutil.copytree(bag, tmp_path / 'copy')
    for arguments, message in (((bag,), 'expected BAG=FORCE.csv'),
                               ((f'{bag}={readings}', f'{bag}={readings}'), 'given twice'),
                               ((f'{bag}={readings}', f'{copy}={readings}'), 'same readings')):
        done = run(drive_gain, *arguments, '--robot', named, '--output', tmp_path)
        assert done.code == 2
        assert message in done.err
        assert done.err.count('\n') == 1


@pytest.mark.parametrize(('unit', 'late', 'told'), [
    (1e-3, 0.0, ('99.9 %', 'the force is in N and not in kN', 'a mistake is likelier')),
    (1.0, 0.5, ('force are 0.500 s late', 'subtract 0.500 s from the t')),
    (1.0, -0.3, ('force are 0.300 s early', 'add 0.300 s to the t')),
])
def test_forces_in_another_unit_or_at_another_time_are_told(pushed, tmp_path, unit, late, told):
    robot, bag, readings = pushed
    force = read_force(readings)
    other, named = tmp_path / 'force.csv', tmp_path / 'robot.yaml'
    np.savetxt(other, np.column_stack((force.t + late, unit * force.force)), delimiter=',',
               header='t,fx,fy,fz', comments='')
    write_yaml(named, robot.model_dump(mode='json', by_alias=True))
    done = run(drive_gain, f'{bag}={other}', '--robot', named, '--output', tmp_path)
    assert done.code == 0, done.err
    page = (tmp_path / 'report.html').read_text(encoding='utf-8')
    for words in told:
        assert words in ' '.join(done.out.split())
        assert words in page
    assert 'Write the gains' not in page or unit == 1.0
    content = json.loads((tmp_path / 'drive_gain.json').read_text(encoding='utf-8'))
    assert content['data']['force_delay'] == (pytest.approx(late, abs=4e-3) if late else None)


@pytest.mark.parametrize(('name', 'values'), [
    ('presliding', {'distance': 2e-3}), ('passive_joint_friction', {'coulomb': 0.02}),
    ('stribeck', {'stribeck_torque': 1.0, 'stribeck_velocity': 0.02})])
def test_friction_is_no_delay_of_the_readings(tmp_path, name, values):
    """It makes gains less certain, but no other time makes them much better."""
    model = model_with(read_model('table1_full', REFERENCE), name, **values)
    bag, readings = tmp_path / 'push', tmp_path / 'push.csv'
    simulate_push(REFERENCE, model, bag, readings, seed=3, torque_noise=0.05, force_noise=0.5,
                  poses=push_poses(REFERENCE)[:3], pushes=1)
    pair = read_log(bag, REFERENCE), read_force(readings)
    gains = gains_of_pushes(pushes_of_log(*pair, REFERENCE), REFERENCE)
    assert late_readings([pair], REFERENCE, gains) is None


def test_gains_far_from_the_nominal_ones_are_doubted():
    nominal, none = np.array(REFERENCE.drive_gain), np.zeros(4)
    for factor, doubted in ((0.7, True), (0.8, False), (1.3, False), (1.41, True)):
        gains = DriveGains(factor * nominal, 1e-4 * np.eye(4), nominal, none)
        remark, = gains_remarks(gains, REFERENCE, 'By the payload', 'the payload is in kg')
        assert not remark.good
        assert ('look first whether the payload is in kg' in remark.advice) == doubted
        assert ('Write the gains into' in remark.advice) != doubted


# ------------------------------------------------------------------------------ known payloads


def loaded_runs(robot, model, mass, seed, **options):
    """Return the rows of the bags 'bare' and 'loaded'."""
    heavy = model_with(model, 'payload', mass=mass, half=1.0)
    return [run for name, truth, number in (('bare', model, 2 * seed),
                                            ('loaded', heavy, 2 * seed + 1))
            for run in runs_of_log(log_of_model(robot, truth, seed=number, name=name, **options),
                                   robot)]


@pytest.mark.parametrize(('robot', 'model'), [(REFERENCE, read_model('table1', REFERENCE)),
                                              (OTHER, other_model())], ids=('reference', 'other'))
def test_gains_come_back_from_known_payloads(robot, model):
    """Within 1 %; within three standard deviations but for rare chance."""
    scores = []
    for seed, mass in ((0, 0.2), (1, 0.5), (2, 2.0)):
        errors = np.random.default_rng(seed).uniform(-0.1, 0.1, 4)
        odd = model_with(model, 'drive_gain_error', relative=errors)
        gains = gains_of_payloads(loaded_runs(robot, odd, mass, seed), {'loaded': mass}, robot)
        true = true_gains(robot, errors)
        np.testing.assert_allclose(gains.values, true, rtol=0.01)
        scores.append((gains.values - true) / gains.std)
        assert gains.p_value > 1e-4
    assert np.abs(scores).max() < 3.5
    assert np.sqrt(np.mean(np.square(scores))) < 2.0


def test_unequal_arms_and_friction_that_drifts_are_no_gains():
    """Each joint may have friction and inertia of its own, and friction may change on the way."""
    model = read_model('table1', REFERENCE)
    arms = {**model.values, 'actuator_inertia': np.array((0.10, 0.12, 0.113, 0.09)),
            'coulomb_friction': np.array((2.0, 2.4, 2.8, 3.0))}
    warm = {**arms, 'coulomb_friction': 0.8 * arms['coulomb_friction'],
            'viscous_friction': 0.7 * arms['viscous_friction'],
            'platform_mass_1': arms['platform_mass_1'] + 0.5}
    runs = [run for name, values in (('bare', arms), ('loaded', warm))
            for run in runs_of_log(log_of_model(REFERENCE, replace(model, values=values),
                                                seed=len(name), name=name), REFERENCE)]
    gains = gains_of_payloads(runs, {'loaded': 0.5}, REFERENCE)
    np.testing.assert_allclose(gains.values, REFERENCE.drive_gain, rtol=0.005)
    assert not wrong_gains(gains).any()
    remark, = gains_remarks(gains, REFERENCE, 'By the payload', 'the payload is in kg')
    assert remark.good


def test_full_bodies_are_known_torque_too():
    model = model_with(read_model('table1_full', REFERENCE), 'drive_gain_error', relative=ERRORS)
    gains = gains_of_payloads(loaded_runs(REFERENCE, model, 0.5, 4), {'loaded': 0.5}, REFERENCE,
                              'full')
    np.testing.assert_allclose(gains.values, true_gains(REFERENCE), rtol=0.005)


def test_gains_and_masses_settle_where_the_start_is_far_off():
    """The least squares are a minimum: no gradient is left, and the truth fits no better."""
    true = np.outer((0.8, 0.9, 1.1, 1.2), (0.8, 0.86, 1.0))
    for seed in range(60):
        random = np.random.default_rng(seed)
        mixed = random.normal(size=(12, 12))
        covariance = 0.03 * mixed @ mixed.T + 0.036 * np.eye(12)
        products = true + random.multivariate_normal(np.zeros(12), covariance).reshape(4, 3)
        weight = np.linalg.inv(covariance)
        ratio, spread, misfit = known_payload._common_masses(products, covariance)
        # for given ratios the masses are a linear fit
        design = np.concatenate([np.eye(3)[:, :2] * each for each in ratio])
        rest = (products - np.outer(ratio, (0.0, 0.0, 1.0))).ravel()
        masses = np.append(np.linalg.solve(design.T @ weight @ design, design.T @ weight @ rest), 1)
        left = (products - np.outer(ratio, masses)).ravel()
        assert left @ weight @ left == pytest.approx(misfit, rel=1e-6)
        gradient = np.array([(weight @ left)[3 * joint:3 * joint + 3] @ masses
                             for joint in range(4)])
        np.testing.assert_allclose(gradient * np.sqrt(np.diag(spread)), 0.0, atol=1e-4)
        assert misfit <= (products - true).ravel() @ weight @ (products - true).ravel()


def test_gains_that_do_not_settle_are_said_in_a_line(monkeypatch):
    runs = loaded_runs(REFERENCE, read_model('table1', REFERENCE), 0.5, 5, duration=4.0)
    monkeypatch.setattr(known_payload, 'TRIALS', 1)
    (remark,), fields = known_payloads(runs, {'loaded': 0.5}, REFERENCE, 'paper')
    assert 'do not settle in 1 trials; record longer' in remark.text
    assert not remark.good
    assert fields == {}
    monkeypatch.setattr(known_payload, '_common_masses',
                        mock.Mock(side_effect=np.linalg.LinAlgError))
    (remark,), fields = known_payloads(runs, {'loaded': 0.5}, REFERENCE, 'paper')
    assert 'do not tell gains and platform masses apart; record longer' in remark.text
    assert fields == {}


def test_gains_need_a_known_difference():
    runs = loaded_runs(REFERENCE, read_model('table1', REFERENCE), 0.5, 5, duration=4.0)
    for payloads in ({}, {'bare': 0.5, 'loaded': 0.5}):
        with pytest.raises(InputError, match='every bag carries the same payload'):
            gains_of_payloads(runs, payloads, REFERENCE)
    with pytest.raises(InputError, match='check which bag carried it'):
        gains_of_payloads(runs, {'bare': 0.5}, REFERENCE)
    axis = Axis(schema='par4/axis/1', name='slide', joint='slide', kind='linear', gain=35.0)
    with pytest.raises(InputError, match='single axis'):
        gains_of_payloads(runs, {'loaded': 0.5}, axis)


def short_push(number, rows):
    """Return a push of so many rows, a third of them sure to slide either way; 2 % too large."""
    side = np.where(np.arange(rows) < rows / 2, 1.0, -1.0)
    carried = np.repeat(np.linspace(5.0, 20.0, rows)[:, None], 4, axis=1)
    direction = np.repeat(side[:, None], 4, axis=1)
    sliding = np.repeat((np.arange(rows) % (rows // 2) < rows / 3)[:, None], 4, axis=1)
    noise = np.random.default_rng(number).normal(0.0, 0.01, (rows, 4))
    return Push('a bag', carried, 1.02 * carried + 2.0 * direction + noise, direction, sliding)


def test_pushes_in_which_a_joint_hardly_slides_are_too_few_however_many_they_are():
    short = [short_push(number, 12) for number in range(4)]
    assert all(push.sliding[:, 0].sum() < FEWEST for push in short)
    with pytest.raises(InputError, match=r'joint 0: 0 and 0 rows in which .* of pushes in which it '
                                         r'slides for 10 rows; let pushes grow and fade slowly'):
        gains_of_pushes(short, REFERENCE)
    bounded = gains_of_pushes(short, REFERENCE, coulomb_friction=2.0)
    assert np.all(bounded.bound > 0.0)
    long = [short_push(number, 48) for number in range(4)]
    found = gains_of_pushes([*short, *long], REFERENCE)
    assert np.all(found.bound == 0.0)
    np.testing.assert_allclose(np.asarray(REFERENCE.drives.gain) / found.values, 1.02, rtol=1e-3)
