"""The bound of time-optimal motion, and the fastest pace within torque and error."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from browser import check_in_browser
from click.testing import CliRunner

from par4_dynamics.base_terms import BASE_TERMS
from par4_dynamics.model_from_file import read_model
from par4_kinematics.adept import adept_motion
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_yaml
from par4_kinematics.geometry import HOME
from par4_kinematics.motion import Motion, check_limits, waypoints_motion
from par4_kinematics.motion_file import read_motion, write_motion
from par4_sim.commands.fastest import fastest
from par4_sim.tracking.case import Case, Plan
from par4_sim.tracking.fastest import Reached, Unreached, at_pace, fastest_case
from par4_sim.tracking.fastest_outcome import outcome_of_fastest
from par4_sim.tracking.run import TrackedRun
from par4_sim.tracking.time_optimal import PathLimits, fastest_along, motion_of
from par4_sim.tracking.way import Averaged, joints_over_time
from robots import OTHER, REFERENCE, model_with, other_model

MACHINE = read_model('table1_full', REFERENCE)
SMOOTH = adept_motion(REFERENCE, jerk=30_000.0)
LIMIT = 200.0
SHORT = waypoints_motion(REFERENCE, ((0.0, 0.0, -0.78, 0.0), (0.15, 0.05, -0.73, 0.2)),
                         acceleration=100.0, speed=4.0, jerk=30_000.0)


def needed(robot, model, motion):
    return model.torque_of_joints(robot.geometry, motion.q, motion.qd, motion.qdd)


@pytest.fixture(scope='module')
def shortest():
    return fastest_along(REFERENCE, MACHINE, SMOOTH, PathLimits(LIMIT))


@pytest.fixture(scope='module')
def quickest():
    """Return the same of the short path."""
    return fastest_along(REFERENCE, MACHINE, SHORT, PathLimits(LIMIT))


def test_the_bound_and_a_motion_that_keeps_the_limits_enclose_the_shortest_time(shortest):
    assert shortest.bound < shortest.duration < 1.02 * shortest.bound
    for profile in shortest.profiles:
        assert np.abs(profile.torque).max() < 1.001 * LIMIT
        speed = np.abs(profile.path(profile.s, 1)).max(axis=1) * profile.sd
        assert speed.max() <= REFERENCE.limits.joint_speed * (1.0 + 1e-9)


def test_nearly_everywhere_some_limit_is_met(shortest):
    """Pontryagin: a time-optimal motion is bang-bang; what meets no limit could be faster."""
    for profile in shortest.profiles:
        torque = np.abs(profile.torque).max(axis=1) > 0.98 * LIMIT
        speed = np.abs(profile.path(profile.s[:-1], 1)).max(axis=1) * profile.sd[:-1] > (
            0.98 * REFERENCE.limits.joint_speed)
        assert np.mean(torque | speed) > 0.97


@pytest.mark.parametrize(('robot', 'model', 'limit'), [
    (REFERENCE, MACHINE, 120.0), (REFERENCE, MACHINE, 300.0), (OTHER, other_model(), 60.0)])
def test_no_motion_of_that_path_within_the_limit_is_faster(robot, model, limit):
    """Other timings of the same path, at the pace at which they just need the torque."""
    home = np.array(HOME if robot is REFERENCE else (0.0, 0.0, -0.55, 0.0))
    poses = home + np.array(((0.0, 0.0, 0.0, 0.0), (0.12, 0.05, 0.04, 0.2)))
    for jerk in (3e3, 3e5):
        motion = waypoints_motion(robot, poses, acceleration=100.0, speed=4.0, jerk=jerk,
                                  theta_speed=50.0, theta_acceleration=500.0, theta_jerk=1e5)
        found = fastest_along(robot, model, motion, PathLimits(limit))
        low, high = 0.01, 100.0
        while high / low > 1.001:
            middle = np.sqrt(low * high)
            keeps = np.abs(needed(robot, model, at_pace(motion, middle))).max() < limit
            low, high = (middle, high) if keeps else (low, middle)
        assert motion.duration / low > found.bound
        assert found.duration < 1.03 * found.bound


def test_without_friction_and_with_torque_to_spare_time_goes_with_the_root_of_the_limit():
    values = {**MACHINE.values, 'coulomb_friction': np.zeros(4), 'viscous_friction': np.zeros(4)}
    free = replace(MACHINE, values=values)
    robot = REFERENCE.model_copy(update={
        'limits': REFERENCE.limits.model_copy(update={'joint_speed': 1e3})})
    times = [fastest_along(robot, free, SMOOTH, PathLimits(limit)).bound for limit in (2e3, 8e3)]
    assert times[0] / times[1] == pytest.approx(2.0, rel=0.01)


def test_the_time_optimal_motion_keeps_path_and_torque(shortest):
    motion = motion_of(shortest, REFERENCE, 'time optimal', period=0.25e-3)
    assert motion.duration == pytest.approx(shortest.duration, abs=1e-3)
    np.testing.assert_allclose(motion.q[[0, -1]], SMOOTH.q[[0, -1]], atol=1e-9)
    np.testing.assert_allclose(motion.qd[[0, -1]], 0.0, atol=1e-9)
    # where it is, the given motion has been: the same path
    apart = np.linalg.norm(motion.x[::20, None, :3] - SMOOTH.x[None, :, :3], axis=2).min(axis=1)
    assert apart.max() < 2.5e-3  # half the distance between samples of the given motion
    rows = slice(4, -4)
    assert np.abs(needed(REFERENCE, MACHINE, motion)[rows]).max() < 1.05 * LIMIT


def test_with_torque_and_speed_to_spare_time_goes_with_the_root_of_the_acceleration():
    robot = REFERENCE.model_copy(update={
        'limits': REFERENCE.limits.model_copy(update={'joint_speed': 1e3})})
    found = [fastest_along(robot, MACHINE, SMOOTH, PathLimits(1e5, limit))
             for limit in (100.0, 400.0)]
    assert found[0].bound / found[1].bound == pytest.approx(2.0, rel=1e-3)
    assert all(part.duration == pytest.approx(part.bound, rel=1e-3) for part in found)
    # where an acceleration is bounded alone, one joint is at its limit nearly all the time
    qdd = np.abs(motion_of(found[1], robot, 'quick', 0.25e-3).qdd).max(axis=1)
    assert np.mean(qdd > 0.97 * 400.0) > 0.9
    assert np.mean(qdd > 1.01 * 400.0) < 0.02


def test_a_limit_of_jerk_is_kept_on_the_same_path_and_costs_less_the_higher_it_is(quickest):
    whole, before = quickest, np.inf
    for jerk in (5e4, 2e7):
        found = fastest_along(REFERENCE, MACHINE, SHORT, PathLimits(LIMIT, jerk=jerk))
        assert found.bound == whole.bound
        assert whole.duration < found.duration < before
        before = found.duration
        motion = motion_of(found, REFERENCE, 'smooth', 0.25e-3)
        check_limits(motion, REFERENCE, jerk=jerk)
        assert np.abs(needed(REFERENCE, MACHINE, motion)).max() < LIMIT
        apart = np.linalg.norm(motion.x[::40, None, :3] - SHORT.x[None, :, :3], axis=2)
        assert apart.min(axis=1).max() < 2.5e-3
        np.testing.assert_allclose(motion.x[-1], SHORT.x[-1], atol=1e-9)
    assert before < 1.06 * whole.duration


def test_an_averaged_profile_is_that_of_its_derivatives(shortest):
    """Accelerations jump in slope, so that the mean error of trapezoids is held, not the largest.
    """
    way = Averaged(shortest.profiles[0], 4e-3, 0.9)
    t = np.linspace(0.0, way.duration, 20_001)
    q, qd, qdd = joints_over_time(way, t)
    for values, slope in ((q, qd), (qd, qdd), (qdd, way.jerk(t))):
        error = np.diff(values, axis=0) - 0.5 * (slope[1:] + slope[:-1]) * t[1]
        assert np.abs(error).sum(axis=0).max() < 5e-3 * np.abs(np.diff(values, axis=0)).sum(
            axis=0).max()


@pytest.mark.parametrize(('effect', 'values'), [
    ('payload', {'mass': 0.5, 'half': 1.0}),
    ('cogging', {'amplitude': 12.0, 'periods': 24.0, 'phase': 0.4}),
    ('stribeck', {'stribeck_torque': 20.0, 'stribeck_velocity': 2.0})])
def test_a_time_optimal_motion_keeps_the_limit_with_the_effects_of_the_model(
        effect, values, quickest):
    """But for samples beside a jump of acceleration, which have something of both sides."""
    machine = model_with(MACHINE, effect, **values)
    most = {}
    for name, found, effects in (
            ('with', fastest_along(REFERENCE, machine, SHORT, PathLimits(LIMIT)), (effect,)),
            ('without', quickest, ())):
        assert found.effects == effects
        motion = motion_of(found, REFERENCE, name, 0.25e-3)
        jumps = np.abs(np.diff(motion.qdd, axis=0)).max(axis=1) > 100.0
        calm = ~(np.append(jumps, True) | np.append(True, jumps))
        assert calm.mean() > 0.8
        torque = np.abs(needed(REFERENCE, machine, motion)).max(axis=1)[calm]
        assert np.mean(torque > 0.9 * LIMIT) > 0.7
        most[name] = torque.max() / LIMIT
    assert most['with'] < 1.04
    assert most['without'] > 1.0 + 3.0 * abs(most['with'] - 1.0)


def test_what_is_asked_beyond_its_own_limits_is_named_first_when_and_where():
    qdd = np.abs(SMOOTH.qdd).max(axis=1)
    first = SMOOTH.t[np.argmax(qdd > 300.0)]
    with pytest.raises(InputError, match=rf'joint acceleration .* as asked, from {first:.3f} s on'):
        check_limits(SMOOTH, REFERENCE, acceleration=300.0)
    with pytest.raises(InputError, match=r'joint jerk .* outside -50000 to 50000 rad/s3 as asked'):
        check_limits(SMOOTH, REFERENCE, jerk=5e4)
    check_limits(SMOOTH, REFERENCE, acceleration=qdd.max(), jerk=2e5)


def test_a_limit_that_does_not_hold_the_machine_is_named_with_joint_and_place():
    with pytest.raises(InputError, match=r'joint \d needs .* N m at \d+ % of the way'):
        fastest_along(REFERENCE, MACHINE, SMOOTH, PathLimits(3.0))
    moving = Motion('moving', SMOOTH.t[50:], *(getattr(SMOOTH, name)[50:] for name in (
        'q', 'qd', 'qdd', 'x', 'xd', 'xdd')))
    with pytest.raises(InputError, match='must begin and end at rest'):
        fastest_along(REFERENCE, MACHINE, moving, PathLimits(LIMIT))


def test_a_motion_that_never_moves_has_no_fastest_cycle():
    still = adept_motion(REFERENCE)
    still = replace(still, q=np.repeat(still.q[:1], len(still.t), axis=0), qd=0.0 * still.qd,
                    qdd=0.0 * still.qdd)
    with pytest.raises(InputError, match='rests throughout'):
        fastest_along(REFERENCE, read_model('table1', REFERENCE), still, PathLimits(200.0))


def test_twenty_g_within_half_a_millimetre_and_two_hundred_newton_metres(shortest):
    found = fastest_case(Plan(REFERENCE, MACHINE, SMOOTH), 'loops', 'exact', MACHINE,
                         shortest.bound)
    assert isinstance(found, Reached)
    assert found.acceleration > 20.0 * 9.81
    assert found.case.tracking.peak < 0.5e-3
    assert found.case.tracking.peak_torque <= LIMIT
    assert found.case.run.motion.duration > shortest.bound
    assert 'torque of joint' in found.limited_by


def test_loops_alone_keep_half_a_millimetre_at_no_pace(shortest):
    found = fastest_case(Plan(REFERENCE, MACHINE, SMOOTH), 'loops', 'none', None, shortest.bound)
    assert isinstance(found, Unreached)
    assert 'error of D above 0.5 mm' in found.limited_by


def test_the_fastest_motion_keeps_the_limits_that_were_asked_for(tmp_path):
    done = CliRunner().invoke(fastest, [
        'adept', '--jerk', '30000', '--feedforward', 'table1_full', '--joint-acceleration', '600',
        '--joint-jerk', '200000', '--output', str(tmp_path / 'out')])
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / 'out' / 'fastest.json').read_text())
    assert content['limits']['joint_acceleration'] == 600.0
    assert content['limits']['joint_jerk'] == 200_000.0
    assert content['bound'] < content['time_optimal'] <= content['runs'][1]['time'] * 1.001
    played = read_motion(tmp_path / 'out' / 'fastest.yaml', REFERENCE)
    check_limits(played, REFERENCE, 600.0, 2e5)
    assert np.abs(played.qdd).max() > 0.8 * 600.0 or np.abs(
        np.diff(played.qdd, axis=0)).max() > 0.8 * 2e5 * played.period


def test_a_motion_keeps_its_name_at_the_beginning_of_a_sentence(shortest):
    run = TrackedRun(SMOOTH, *np.zeros((6, 1)), None, {}, 0)
    found = Reached('own', Case('loops', 'table1', run, None), 1.0, 150.0, 'torque')
    told = outcome_of_fastest([found], shortest, replace(SMOOTH, name='pickABC'), REFERENCE,
                              PathLimits(LIMIT), 5e-4)
    assert told.sentence.startswith('PickABC is done in 0.2500 s')


def test_where_nothing_is_reached_no_motion_of_an_earlier_run_stays(tmp_path):
    place = tmp_path / 'fastest.yaml'
    asked = ['adept', '--jerk', '30000', '--feedforward', 'none', '--timing', 'own', '--peak',
             '0.01', '--output', str(tmp_path)]
    for maker, stays in (('par4_fastest', False), ('', True)):  # the second is the user's
        write_motion(place, SHORT, maker=maker)
        done = CliRunner().invoke(fastest, asked)
        assert done.exit_code == 0, done.output
        assert 'None of the controllers tried does adept' in ' '.join(done.output.split())
        assert place.exists() == place.with_suffix('.csv').exists() == stays


@pytest.mark.usefixtures('unrendered')
def test_a_fastest_motion_that_somebody_has_changed_stays(tmp_path):
    asked = ['adept', '--jerk', '30000', '--feedforward', 'table1_full', '--timing', 'own',
             '--output', str(tmp_path)]
    place = tmp_path / 'fastest.yaml'

    def written():
        done = CliRunner().invoke(fastest, asked)
        assert done.exit_code == 0, done.output
        told = done.output.partition('fastest motion: ')[2].split('\n')[0]
        return told, {path.name for path in tmp_path.iterdir() if 'fastest' in path.name} - {
            'fastest.json'}

    write_motion(place, SHORT, maker='par4_fastest')
    assert written() == (str(place), {'fastest.yaml', 'fastest.csv'})
    place.write_text(place.read_text() + '# mine\n')
    mine = place.read_bytes(), place.with_suffix('.csv').read_bytes()
    assert written() == (str(tmp_path / 'fastest_2.yaml'), {
        'fastest.yaml', 'fastest.csv', 'fastest_2.yaml', 'fastest_2.csv'})
    assert (place.read_bytes(), place.with_suffix('.csv').read_bytes()) == mine
    asked += ['--peak', '0.001']
    assert written() == ('', {'fastest.yaml', 'fastest.csv'})


def refused(tmp_path, *arguments):
    done = CliRunner().invoke(fastest, ['adept', *map(str, arguments), '--output',
                                        str(tmp_path / 'out')])
    assert isinstance(done.exception, InputError), done.output
    assert not (tmp_path / 'out').exists()
    return str(done.exception)


@pytest.fixture
def weightless(tmp_path):
    """Return a model without mass and friction; its torques are 0."""
    place = tmp_path / 'weightless.yaml'
    write_yaml(place, {'schema': 'par4/model/1', 'parameters': {
        term.name: {'value': 0.0, 'unit': term.unit} for term in BASE_TERMS}})
    return place


def test_a_machine_that_cannot_be_is_no_machine_that_is_too_slow(tmp_path, weightless):
    """Its torques can be computed; only the simulation refuses it, at each pace anew."""
    assert refused(tmp_path, '--machine', weightless) == (
        f'{weightless}: actuator inertia, kg m2: 0 with the effects of the model, a simulated '
        f'machine needs at least 1e-09; change the effect or its base parameter')


@pytest.mark.parametrize('controller', ['computed_torque', 'predictive'])
def test_a_model_without_inertia_is_none_for_a_law_that_divides_by_it(tmp_path, weightless,
                                                                      controller):
    told = refused(tmp_path, '--controller', controller, '--feedforward', weightless)
    assert told.startswith('--feedforward weightless: computed torque divides by the inertia')
    assert '0 kg m2, expected more than 0; give it an actuator_inertia' in told


@pytest.mark.parametrize(('name', 'limit', 'told'), [
    *(('acceleration', limit, f'between two rests the path takes more than the 100 s that are '
                              f'looked at, with joint accelerations of at most {limit:g} rad/s2; '
                              f'raise that limit') for limit in (1e-12, 1e-9, 1e-4)),
    *(('jerk', limit, f'with joint jerks of at most {limit:g} rad/s3 the limits are not even kept '
                      f'where the path takes 100 s between two rests; raise the limit of the '
                      f'jerks') for limit in (1e-9, 1e-3))])
def test_tiny_limits_are_refused_before_anything_is_simulated(name, limit, told, tmp_path,
                                                              monkeypatch):
    def simulated(*_):
        raise AssertionError('simulated')

    monkeypatch.setattr('par4_sim.tracking.case.Plan.case', simulated)
    assert refused(tmp_path, f'--joint-{name}', limit) == told


def test_a_robot_that_hardly_moves_is_refused():
    robot = REFERENCE.model_copy(update={
        'limits': REFERENCE.limits.model_copy(update={'joint_speed': 1e-6})})
    with pytest.raises(InputError, match='more than the 100 s .* limits of the robot; raise them'):
        fastest_along(robot, MACHINE, SMOOTH, PathLimits(LIMIT))


def test_a_small_limit_of_jerk_is_kept_by_a_slow_motion():
    slow = motion_of(fastest_along(REFERENCE, MACHINE, SHORT, PathLimits(LIMIT, jerk=1.0)),
                     REFERENCE, 'slow', 5e-3)
    check_limits(slow, REFERENCE, jerk=1.0)


def test_controllers_of_which_none_can_be_tried_are_refused(tmp_path):
    assert refused(tmp_path, '--controller', 'predictive') == (
        'controller predictive: needs a model, found --feedforward none; give a model.yaml or '
        'table1')


def test_the_command_writes_bound_and_runs(tmp_path):
    done = CliRunner().invoke(fastest, [
        'adept', '--jerk', '30000', '--feedforward', 'table1_full', '--output',
        str(tmp_path / 'out')])
    assert done.exit_code == 0, done.output
    content = json.loads((tmp_path / 'out' / 'fastest.json').read_text())
    assert content['schema'] == 'par4/fastest/1'
    times = [run['time'] for run in content['runs']]
    assert [run['timing'] for run in content['runs']] == ['own', 'time_optimal']
    assert content['bound'] < content['time_optimal'] < times[1] < times[0]
    headings, *rows = done.output.splitlines()
    assert headings.split(None, 3)[3].split('  ')[-1].strip() == 'torque, N m'
    for row, run in zip(rows[:2], content['runs'], strict=True):
        assert float(row.split()[-1]) == pytest.approx(run['peak_torque'], rel=0.01)
    assert times[1] < 1.05 * content['bound']  # the bound is nearly reached, with 0.5 mm
    played = read_motion(tmp_path / 'out' / 'fastest.yaml', REFERENCE)
    assert played.duration == pytest.approx(times[1], rel=1e-6)
    assert all(run['peak'] <= 0.5e-3 for run in content['runs'])
    page = (tmp_path / 'out' / 'report.html').read_text()
    assert page.count('<img src="data:image/svg+xml;base64,') == 1
    check_in_browser(tmp_path / 'out' / 'report.html', 1)
    assert 'nothing is faster than' in done.output
