"""Excitation by design: limits, repeats, information, and the executable."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from test_commands import run

from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints
from par4_identification.commands import excite, identify
from par4_identification.excitation import path_optimisation
from par4_identification.excitation.design import design_excitation
from par4_identification.excitation.fourier_path import FourierPath
from par4_identification.excitation.motion_limits import largest_loads, limits_of
from par4_identification.excitation.path_optimisation import PathProblem, criterion
from par4_identification.excitation.precision import expected_precision
from par4_identification.excitation.quasi_random import quasi_random_within
from par4_identification.excitation.request import DesignRequest
from par4_identification.excitation.transition import DURATIONS, shortest_durations, transition
from par4_identification.fitting.identification import identify as fit_parameters
from par4_identification.logs.log import Log
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.acceleration import half_plate_accelerations
from par4_kinematics.errors import InputError
from par4_kinematics.motion_file import read_motion
from par4_kinematics.workspace import home_pose, inside
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.commands import simulate
from robots import OTHER, REFERENCE, model_with, other_model

TABLE_1 = read_model('table1', REFERENCE)
MACHINES = {'reference': (REFERENCE, TABLE_1), 'other': (OTHER, other_model())}
QUICK = DesignRequest(duration=8.0, harmonics=2, starts=1, seed=3)
"""Roughly what the executable does, in a second instead of some ten."""
NOISE = np.full(4, 0.2)
INERTIAL = ('actuator_inertia', 'platform_mass_1', 'platform_mass_2')


CASES = (('reference', None), ('other', None), ('reference', 30.0), ('other', 12.0))
"""Machine and torque limit, N m: the first two are limited by speed and acceleration."""


@cache
def designed(name: str, torque: float | None):
    robot, model = MACHINES[name]
    limits = limits_of(robot, model, torque=torque)
    return robot, model, limits, design_excitation(robot, model, limits, QUICK)


@pytest.fixture(autouse=True)
def few_iterations(monkeypatch):
    """Optimise less than a user does: every law here holds for any path."""
    monkeypatch.setattr(path_optimisation, 'ROUGH_ITERATIONS', 30)
    monkeypatch.setattr(path_optimisation, 'ITERATIONS', 60)


@pytest.fixture(params=MACHINES)
def design(request):
    return designed(request.param, None)


def state_of(robot, motion):
    return state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)


@pytest.mark.parametrize(('name', 'torque'), CASES)
def test_limits_hold_at_every_sample(name, torque):
    robot, model, limits, result = designed(name, torque)
    motion = result.motion
    h = motion.period
    assert inside(robot, motion.x).all()
    low, high = robot.limits.joint_position
    assert low <= motion.q.min()
    assert motion.q.max() <= high
    assert np.abs(np.diff(motion.q, axis=0) / h).max() <= limits.joint_speed
    theta = motion.x[:, 3]
    bar = robot.geometry.platform_bar_length
    d = motion.x[:, :3]
    d2 = d + bar * np.column_stack((-np.sin(theta), np.cos(theta), np.zeros_like(theta)))
    for point in (d, d2):
        acceleration = np.diff(point, 2, axis=0) / h ** 2
        assert np.linalg.norm(acceleration, axis=1).max() <= limits.acceleration
    tau = model.torque(state_of(robot, motion))
    assert np.abs(tau).max() <= limits.torque
    # a limit is used, or nothing would have been optimised
    assert max(load for name, load in result.loads.items() if name != 'workspace') > 0.9
    assert max(result.loads.values()) <= 1.0
    if torque is not None:
        assert result.loads['torque'] > 0.9


def test_loads_are_told_as_they_are(design):
    robot, model, limits, result = design
    motion = result.motion
    loads = largest_loads(limits, motion, robot, model)
    assert loads == result.loads
    assert loads['joint speed'] == pytest.approx(np.abs(motion.qd).max() / limits.joint_speed)
    tau = model.torque(state_of(robot, motion))
    assert loads['torque'] == pytest.approx(np.abs(tau).max() / limits.torque)


def test_acceleration_of_d2_is_the_second_difference_of_its_position(design):
    robot, _, _, result = design
    motion = result.motion
    theta = motion.x[:, 3]
    d2 = motion.x[:, :3] + robot.geometry.platform_bar_length * np.column_stack(
        (-np.sin(theta), np.cos(theta), np.zeros_like(theta)))
    # within the periods: where they begin and end the jerk jumps
    inner = slice(result.fast.first + 1, result.fast.first + result.fast.samples)
    difference = np.diff(d2, 2, axis=0)[inner] / motion.period ** 2
    calculated = half_plate_accelerations(
        robot.geometry, motion.x, motion.xd, motion.xdd)[1, 1:-1][inner]
    assert np.abs(difference - calculated).max() < 0.005 * np.abs(calculated).max()


def test_periods_repeat_exactly_at_least_twice(design):
    motion = design[3].motion
    for repeats in (design[3].slow, design[3].fast):
        assert repeats.count >= 2
        for part in (motion.x, motion.xd, motion.xdd):
            block = part[repeats.first:repeats.first + repeats.samples * repeats.count]
            periods = block.reshape(repeats.count, repeats.samples, 4)
            assert (periods == periods[0]).all()
            assert np.ptp(periods[0], axis=0).min() > 0.0


def test_rests_at_home_at_both_ends_and_lasts_as_long_as_asked(design):
    robot, _, _, result = design
    motion = result.motion
    for end in (0, -1):
        np.testing.assert_allclose(motion.x[end], home_pose(robot), atol=1e-12)
        assert not motion.xd[end].any()
        assert not motion.xdd[end].any()
    assert motion.duration == pytest.approx(QUICK.duration)


def test_samples_are_each_others_derivatives(design):
    motion = design[3].motion
    h = motion.period
    for value, rate in ((motion.x, motion.xd), (motion.xd, motion.xdd)):
        middle = 0.5 * (rate[1:] + rate[:-1])
        assert np.abs(np.diff(value, axis=0) / h - middle).max() < 2e-3 * np.abs(rate).max()


def test_slow_is_slow_and_fast_is_fast(design):
    motion, slow, fast = design[3].motion, design[3].slow, design[3].fast
    peaks = [np.abs(motion.qd[one.first:one.first + one.samples]).max() for one in (slow, fast)]
    assert peaks[0] <= 1.0
    assert peaks[1] > 3.0 * peaks[0]


def test_the_same_request_gives_the_same_motion_and_another_seed_another():
    robot, model, limits, first = designed('reference', None)
    again = design_excitation(robot, model, limits, QUICK)
    other = design_excitation(robot, model, limits, replace(QUICK, seed=4))
    assert (first.motion.q == again.motion.q).all()
    assert np.abs(first.motion.q - other.motion.q).max() > 0.01


def test_tells_more_than_quasi_random(design):
    robot, model, limits, result = design
    random = quasi_random_within(robot, model, limits, QUICK.duration, QUICK.seed)
    ours, theirs = (expected_precision(motion, robot, model, NOISE)
                    for motion in (result.motion, random))
    ratios = {name: theirs.std[name] / std for name, std in ours.std.items()}
    assert np.exp(np.mean(np.log(list(ratios.values())))) > 1.7
    assert min(ratios[name] for name in INERTIAL) > 1.5
    assert ours.collinearity < theirs.collinearity


@pytest.mark.parametrize(('name', 'torque'), CASES)
def test_quasi_random_keeps_the_same_limits(name, torque):
    robot, model = MACHINES[name]
    limits = limits_of(robot, model, torque=torque)
    random = quasi_random_within(robot, model, limits, QUICK.duration, 0)
    assert max(largest_loads(limits, random, robot, model).values()) <= 1.0


def test_information_is_the_sum_over_the_joints_each_by_its_noise():
    robot, model, limits, result = designed('reference', None)
    noise = np.array((0.1, 0.2, 0.4, 0.8))

    def information(of):
        return PathProblem(robot.geometry, model, limits, result.fast.path.period, 100.0, of,
                           np.zeros((6, 6)), Conditioning()).information(result.fast.path)

    alone = [information(np.where(np.arange(4) == joint, 1.0, np.inf)) for joint in range(4)]
    together = sum(part / size ** 2 for part, size in zip(alone, noise, strict=True))
    np.testing.assert_allclose(information(noise), together, rtol=1e-9)


# --------------------------------------------------------------------------- expectation


def exact_log(robot, model, motion, noise, seed):
    tau = model.torque(state_of(robot, motion))
    tau = tau + noise * np.random.default_rng(seed).standard_normal(tau.shape)
    return Log(name='made', joint_names=robot.joint_names, start_stamp=0, period=motion.period,
               t=motion.t, q=motion.q, tau=tau, segments=(slice(0, len(motion.t)),),
               reference=None, accounts=None)


def test_expected_deviations_are_those_of_identification(design):
    robot, model, _, result = design
    expected = expected_precision(result.motion, robot, model, NOISE)
    found = [fit_parameters([exact_log(robot, model, result.motion, NOISE, seed)], robot).estimate
             for seed in range(16)]
    values = np.array([estimate.values for estimate in found])
    scores = (values - values.mean(axis=0)) / list(expected.std.values())
    size = np.sqrt((scores ** 2).sum() / (scores.size - scores.shape[1]))
    assert 0.8 < size < 1.2
    assert found[0].condition_number == pytest.approx(expected.condition_number, rel=1e-9)


def test_repeats_of_a_simulated_log_show_the_noise_floor():
    robot, model, _, result = designed('reference', None)
    quiet = robot.model_copy(update={
        'drives': robot.drives.model_copy(update={'encoder_counts': 0})})
    simulation = build_simulation(quiet, model, 'exact', 1e-3, 0, torque_noise=0.2)
    motion, fast = result.motion, result.fast
    simulation.queue_reference(simulation.time + motion.t, motion.q, motion.qd, motion.qdd)
    tau = simulation.next_samples(len(motion.t)).effort
    # the drives settle into the periodic motion within the first periods
    block = tau[fast.first:fast.first + fast.count * fast.samples].reshape(
        fast.count, fast.samples, 4)[2:]
    level = np.sqrt(block.var(axis=0, ddof=1).mean(axis=0))
    np.testing.assert_allclose(level, 0.2, rtol=0.1)


# --------------------------------------------------------------------------------- parts


def test_path_rates_are_differences_of_the_path():
    path = FourierPath(np.random.default_rng(0).standard_normal((7, 4)), 0.8)
    t, h = np.linspace(0.0, 0.8, 50), 1e-6
    before, here, after = path.sample(t - h), path.sample(t), path.sample(t + h)
    for order in (0, 1):
        np.testing.assert_allclose((after[order] - before[order]) / (2.0 * h), here[order + 1],
                                   rtol=1e-6, atol=1e-5)
    np.testing.assert_allclose(path.sample(t + path.period), here, atol=1e-9)


def test_slope_of_the_criterion_is_its_difference():
    random = np.random.default_rng(1)
    root = random.standard_normal((20, 6)) * (1.0, 10.0, 3.0, 0.5, 1.0, 2.0)
    information = root.T @ root
    _, slope = criterion(information)
    for _ in range(5):
        step = random.standard_normal((6, 6))
        step = (step + step.T) * 1e-5
        difference = criterion(information + step)[0] - criterion(information - step)[0]
        assert difference == pytest.approx(2.0 * np.sum(slope * step), rel=1e-4)


@pytest.mark.parametrize('penalty', [0.0, 30.0])
def test_gradient_of_the_cost_is_its_difference(penalty):
    robot, model = MACHINES['other']
    limits = limits_of(robot, model, torque=20.0)
    problem = PathProblem(robot.geometry, model, limits, 0.5, 100.0, NOISE, np.eye(6),
                          Conditioning())
    random = np.random.default_rng(2)
    coefficients = random.standard_normal((5, 4)) * (0.03, 0.03, 0.02, 0.2)
    coefficients[0] += limits.middle
    t = np.arange(40) / 80.0
    x = FourierPath(coefficients, 0.5).sample(t)
    _, gradient = problem.cost(x, penalty)
    for order in range(3):
        step = np.zeros_like(x)
        step[order] = 1e-5 * np.abs(x[order]).max(axis=0) * random.standard_normal(x[order].shape)
        difference = problem.cost(x + step, penalty)[0] - problem.cost(x - step, penalty)[0]
        assert difference == pytest.approx(2.0 * np.sum(gradient * step), rel=1e-4, abs=1e-9)


def test_transitions_join_states_and_the_shortest_keeps_the_limits():
    robot, model = MACHINES['reference']
    limits = limits_of(robot, model)
    random = np.random.default_rng(5)
    start, end = np.zeros((3, 1, 4)), random.standard_normal((3, 6, 4))
    start[0] = home_pose(robot)
    end *= np.array(((0.1, 0.1, 0.05, 0.2), (0.5,) * 4, (10.0,) * 4))[:, None]
    end[0] += limits.middle
    both = transition(*np.broadcast_arrays(start, end), 0.7, np.array((0.0, 0.7)))
    np.testing.assert_allclose(both[:, :, 0], np.broadcast_to(start, end.shape), atol=1e-9)
    np.testing.assert_allclose(both[:, :, 1], end, atol=1e-9)
    found = shortest_durations(start, end, robot.geometry, model, limits)
    assert np.isin(found, DURATIONS).all()
    faster = replace(limits, acceleration=4.0 * limits.acceleration,
                     joint_speed=2.0 * limits.joint_speed)
    assert (shortest_durations(start, end, robot.geometry, model, faster) <= found).all()
    tight = replace(limits, acceleration=1e-3)
    assert np.isinf(shortest_durations(start, end, robot.geometry, model, tight)).all()


def test_effects_of_the_model_count_towards_the_torque():
    robot, model = MACHINES['reference']
    offset = model_with(model, 'torque_offset', offset=8.0)
    limits = limits_of(robot, offset, torque=60.0)
    result = design_excitation(robot, offset, limits, QUICK)
    tau = offset.torque(state_of(robot, result.motion))
    assert 0.7 * limits.torque < np.abs(tau).max() <= limits.torque


# ------------------------------------------------------------------------ the executable


OPTIONS = ('--robot', 'reference', '--duration', 8, '--harmonics', 2, '--starts', 1)


def test_from_design_to_identification(tmp_path):
    file = tmp_path / 'new' / 'motion.yaml'
    done = run(excite, *OPTIONS, '--output', file, '--seed', 3)
    assert done.code == 0, done.err
    assert not done.err
    assert 'geometric mean' in done.out
    assert sorted(path.name for path in file.parent.iterdir()) == ['motion.csv', 'motion.yaml']
    expected = designed('reference', None)[3].motion
    played = read_motion(file, REFERENCE)
    np.testing.assert_allclose(played.q, expected.q, atol=1e-9)
    np.testing.assert_allclose(played.qdd, expected.qdd, atol=1e-6)
    bag = tmp_path / 'bag'
    done = run(simulate, file, '--model', 'table1', '--torque-noise', 0.05, '--output', bag)
    assert done.code == 0, done.err
    done = run(identify, bag, '--robot', 'reference', '--output', tmp_path / 'identified',
               '--no-report')
    assert done.code == 0, done.err
    found = read_model(tmp_path / 'identified' / 'model.yaml', REFERENCE)
    for name, value in TABLE_1.values.items():
        np.testing.assert_allclose(found.values[name], value, rtol=5e-3)


@pytest.mark.parametrize(('options', 'words'), [
    (('--torque-limit', 5), 'holding and moving the platform at all takes'),
    (('--torque-limit', 500), 'robot reference has 200 N m'),
    (('--joint-speed', 20), 'robot reference has 15 rad/s'),
    (('--joint-speed', 1e-9), 'rows are used above 0.05 rad/s only; allow more'),
    (('--acceleration', -1), "expected a number above 0, found '-1'"),
    (('--duration', 3), 'at least 4 s'),
    (('--duration', 'nan'), "finite and at most 1e+12, found 'nan'"),
    (('--harmonics', 40), 'harmonics must be 2 to 12'),
    (('--periods', 1), 'slow_periods must be 2'),
    (('--periods', 1000), 'ask for fewer periods, of 0.1 s or more'),
    (('--slow-fraction', 0.95), 'slow_fraction must be 0.1 to 0.9'),
    (('--base-frequency', 30), 'at most 10 Hz'),
    (('--torque-noise', '1,2'), 'expected one positive number'),
    (('--torque-noise', '-1'), 'expected a positive number'),
    (('--output', 'motion.csv'), 'ends in .yaml'),
    (('--robot', 'nobody'), 'not a built-in name'),
    (('--sped', 1), 'No such option'),
], ids=str)
def test_one_clear_line_on_bad_requests(options, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = dict(zip(OPTIONS[::2], OPTIONS[1::2], strict=True)) | {'--output': 'motion.yaml'}
    given[options[0]] = options[1]
    done = run(excite, *(word for item in given.items() for word in item))
    assert done.code == 2
    assert done.err.startswith('error: ')
    assert done.err.count('\n') == 1
    assert words in done.err
    assert not list(tmp_path.iterdir())


def test_too_little_time_for_two_fast_periods():
    robot, model = MACHINES['reference']
    request = replace(QUICK, duration=5.0, base_frequency=0.4)
    with pytest.raises(InputError, match='fast periods'):
        design_excitation(robot, model, limits_of(robot, model), request)
