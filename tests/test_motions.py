"""Time laws, the Adept motion, circle, waypoints, excitation, and motion files."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from par4_kinematics.adept import LIFT, REACH, adept_motion
from par4_kinematics.circle import circle_motion
from par4_kinematics.errors import InputError, Par4Error, UnreachableError
from par4_kinematics.excitation import SHORTEST, SLOW_ACCELERATION, excitation_motion
from par4_kinematics.files import read_yaml, write_yaml
from par4_kinematics.geometry import HOME
from par4_kinematics.motion import (
    JOINT_COLUMNS,
    PLATFORM_COLUMNS,
    check_limits,
    motion_of_joints,
    sample_times,
    waypoints_motion,
)
from par4_kinematics.motion_file import (
    MOTION_SCHEMA,
    free_motion_path,
    is_untouched,
    named_motion,
    read_motion,
    write_motion,
)
from par4_kinematics.robot import Robot, Workspace, read_robot
from par4_kinematics.time_laws import Quintic, SCurve, Trapezoid
from par4_kinematics.workspace import home_pose

REFERENCE = read_robot('reference')
SMALL = Robot.model_validate({
    'schema': 'par4/robot/1', 'name': 'small',
    'geometry': {'arm_length': 0.22, 'forearm_length': 0.61, 'base_radius': 0.16,
                 'platform_radius': 0.045, 'platform_bar_length': 0.06,
                 'actuator_azimuth': [0.9, 2.2, 3.8, 5.6]},
    'drives': {'gain': [8.0, 8.0, 8.0, 8.0]},
    'limits': {'joint_speed': 9.0,
               'workspace': {'radius': 0.25, 'z': [-0.62, -0.48], 'theta': 0.6}}})
ROBOTS = pytest.mark.parametrize('robot', [REFERENCE, SMALL], ids=lambda robot: robot.name)

LAWS = [
    Trapezoid(0.305, 5.0, 150.0),
    Trapezoid(0.025, 5.0, 150.0),
    Quintic(0.3, 2.0, 50.0),
    Quintic(0.3, 5.0, 20.0),
    SCurve(1.0, 2.0, 10.0, 100.0),    # all seven phases
    SCurve(1.0, 2.0, 50.0, 100.0),    # acceleration limit not reached
    SCurve(0.3, 5.0, 10.0, 100.0),    # speed limit not reached
    SCurve(0.01, 5.0, 10.0, 100.0),   # neither
    SCurve(2000.0, 30.0, 0.5, 0.05),
]


def copied(robot: Robot, **limits: object) -> Robot:
    return robot.model_copy(update={'limits': robot.limits.model_copy(update=limits)})


def reversals(speeds: np.ndarray) -> np.ndarray:
    """Return how often each column changes its sign."""
    return np.count_nonzero(np.diff(np.sign(speeds), axis=0), axis=0)


def plate_accelerations(motion, robot: Robot) -> np.ndarray:
    """Return |a| (n, 2) of D and of D', the latter from second differences of its position."""
    theta = motion.x[:, 3]
    bar = robot.geometry.platform_bar_length * np.column_stack(
        (-np.sin(theta), np.cos(theta), 0.0 * theta))
    other = np.gradient(np.gradient(motion.x[:, :3] + bar, motion.t, axis=0), motion.t, axis=0)
    return np.column_stack((np.linalg.norm(motion.xdd[:, :3], axis=1),
                            np.linalg.norm(other, axis=1)))


@pytest.mark.parametrize('law', LAWS, ids=repr)
def test_law_goes_from_rest_to_rest(law):
    s, sd, sdd = law.sample([-1.0, 0.0, law.duration, law.duration + 1.0])
    assert s.tolist() == [0.0, 0.0, law.length, law.length]
    assert not sd.any()
    assert not sdd.any()
    middle = law.sample(0.5 * law.duration)
    assert float(middle[0]) == pytest.approx(0.5 * law.length)


@pytest.mark.parametrize('law', LAWS, ids=repr)
def test_law_keeps_its_limits_and_meets_one(law):
    s, sd, sdd = law.sample(np.linspace(0.0, law.duration, 20001))
    jerk = np.gradient(sdd, law.duration / 20000)
    assert (np.diff(s) >= 0.0).all()
    shares = [np.abs(sd).max() / law.speed, np.abs(sdd).max() / law.acceleration]
    if isinstance(law, SCurve):
        shares.append(np.abs(jerk).max() / law.jerk)
    assert max(shares) == pytest.approx(1.0, rel=1e-6)
    assert all(share <= 1.0 + 1e-6 for share in shares)


@pytest.mark.parametrize('law', LAWS, ids=repr)
def test_law_speed_and_acceleration_are_derivatives(law):
    t = np.linspace(0.0, law.duration, 20001)
    s, sd, sdd = law.sample(t)
    step = t[1]
    assert np.abs(np.diff(s) / step - 0.5 * (sd[1:] + sd[:-1])).max() < 1e-3 * sd.max()
    error = np.diff(sd) / step - 0.5 * (sdd[1:] + sdd[:-1])
    jumps = 4 if isinstance(law, Trapezoid) else 0
    assert np.count_nonzero(np.abs(error) > 1e-3 * sdd.max()) <= jumps


def test_law_keeps_the_shape_of_its_times():
    law = SCurve(1.0, 2.0, 10.0, 100.0)
    t = np.linspace(-0.1, 1.1 * law.duration, 12)
    together = law.sample(t.reshape(3, 4))
    assert together[0].shape == (3, 4)
    for part, alone in zip(together, zip(*(law.sample(time) for time in t)), strict=True):
        assert part.ravel().tolist() == [float(value) for value in alone]


@pytest.mark.parametrize('length', [0.025, 0.305])
def test_s_curve_tends_to_the_trapezoid_as_jerk_grows(length):
    trapezoid = Trapezoid(length, 5.0, 150.0)
    t = np.linspace(0.0, trapezoid.duration, 500)
    errors = []
    for jerk in (1e5, 1e6, 1e7):
        law = SCurve(length, 5.0, 150.0, jerk)
        errors.append(np.abs(law.sample(t)[0] - trapezoid.sample(t)[0]).max())
        assert law.duration > trapezoid.duration
    assert errors[0] > 5.0 * errors[1] > 25.0 * errors[2]
    assert errors[2] < 1e-3 * length


@pytest.mark.parametrize('law', [law for law in LAWS if not isinstance(law, Quintic)], ids=repr)
def test_law_is_the_fastest(law):
    # Bang-bang: at every time one of the limits is met, but for the samples at a switch.
    _, sd, sdd = law.sample(np.linspace(0.0, law.duration, 20001))
    met = ((sd > (1.0 - 1e-6) * law.speed) | (np.abs(sdd) > (1.0 - 1e-6) * law.acceleration))[1:]
    if isinstance(law, SCurve):
        met |= np.abs(np.diff(sdd)) * 20000 / law.duration > (1.0 - 1e-6) * law.jerk
    assert np.count_nonzero(~met) <= 8


@pytest.mark.parametrize('wrong', [0.0, -1.0, math.nan, math.inf])
@pytest.mark.parametrize(('law', 'names'), [
    (Trapezoid, ('length', 'speed', 'acceleration')),
    (Quintic, ('length', 'speed', 'acceleration')),
    (SCurve, ('length', 'speed', 'acceleration', 'jerk'))])
def test_law_refuses_limits_that_are_not_positive(law, names, wrong):
    for name in names:
        with pytest.raises(InputError, match=f'{law.__name__}: {name} must be positive'):
            law(**{other: wrong if other == name else 1.0 for other in names})


def test_sample_times_cover_the_duration():
    for duration, samples in ((0.25, 251), (0.2505, 252), (1e-4, 2), (0.3, 301)):
        t = sample_times(duration, 1e-3)
        assert len(t) == samples
        assert duration - 1e-12 <= t[-1] < duration + 1e-3
    for duration, period in ((1.0, 0.0), (0.0, 1e-3), (1.0, -1.0), (math.nan, 1e-3), (1e9, 1e-3)):
        with pytest.raises(InputError, match='every'):
            sample_times(duration, period)


def test_adept_round_trip_between_blended_and_not():
    stops = adept_motion(REFERENCE, round_trip=None, period=1e-5)
    assert stops.duration == pytest.approx(0.292, abs=5e-4)
    with pytest.raises(InputError, match=r'0\.1 s.* 0\.1887 s .*to 0\.2919 s'):
        adept_motion(REFERENCE, round_trip=0.1)
    with pytest.raises(InputError, match=r'0\.1887 s .*to 0\.2919 s'):
        adept_motion(REFERENCE, round_trip=0.3)
    for wanted in (0.1888, 0.21, 0.25, 0.2918):
        assert adept_motion(REFERENCE, round_trip=wanted, period=1e-5).duration == pytest.approx(
            wanted, abs=1.1e-5)


def test_adept_acceleration_at_the_corners():
    def fastest(**arguments: object) -> float:
        motion = adept_motion(REFERENCE, **arguments)
        return float(np.linalg.norm(motion.xdd[:, :3], axis=1).max())

    assert fastest(round_trip=0.25) == pytest.approx(212.0, abs=0.5)
    assert fastest(round_trip=None) == pytest.approx(150.0, abs=1e-6)


@pytest.mark.parametrize('jerk', [None, 3e4])
def test_adept_goes_up_across_down_and_back(jerk):
    centre = (0.05, -0.02, -0.8)
    azimuth = 0.7
    motion = adept_motion(REFERENCE, jerk=jerk, centre=centre, azimuth=azimuth, cycles=2,
                          round_trip=0.28, theta_swing=0.6)
    assert motion.duration == pytest.approx(2 * 0.28, abs=1e-3)
    across = np.array((math.cos(azimuth), math.sin(azimuth)))
    along = (motion.x[:, :2] - centre[:2]) @ across
    aside = (motion.x[:, :2] - centre[:2]) @ (-across[1], across[0])
    assert np.abs(aside).max() < 1e-12
    assert along.min() == pytest.approx(-REACH / 2)
    assert along.max() == pytest.approx(REACH / 2)
    assert along[140] == pytest.approx(REACH / 2)  # at 0.14 s, half a round trip
    assert along[280] == pytest.approx(-REACH / 2)
    assert motion.x[:, 2].min() == pytest.approx(centre[2])
    assert motion.x[:, 2].max() == pytest.approx(centre[2] + LIFT)
    assert motion.x[140, 2] == pytest.approx(centre[2])
    # A way played backwards is a way: both corners are blended alike.
    assert np.abs(along[:141] + along[140::-1]).max() < 1e-9
    assert np.abs(motion.x[:141, 2] - motion.x[140::-1, 2]).max() < 1e-9
    assert np.ptp(motion.x[:, 3]) == pytest.approx(0.6)
    assert np.corrcoef(along, motion.x[:, 3])[0, 1] == pytest.approx(1.0)
    for still in (0, 140, 280, -1):
        assert np.abs(motion.xd[still]).max() < 1e-9
    assert np.abs(motion.x[-1] - motion.x[0]).max() < 1e-12
    check_limits(motion, REFERENCE)


def test_adept_path_does_not_depend_on_time_or_period():
    coarse, fine = (adept_motion(REFERENCE, cycles=2, period=period) for period in (2e-3, 1e-3))
    for part in ('x', 'xd', 'q', 'qd'):
        assert np.abs(getattr(coarse, part) - getattr(fine, part)[::2]).max() < 1e-9
    assert np.abs(fine.x[:250] - fine.x[250:500]).max() < 1e-9


def test_adept_jerk_limit_holds():
    motion = adept_motion(REFERENCE, jerk=3e4, round_trip=None, period=1e-4)
    jerk = np.diff(motion.xdd[:, :3], axis=0) / 1e-4
    assert np.linalg.norm(jerk, axis=1).max() < 3e4 * (1.0 + 1e-6)
    assert motion.duration > 0.292


@pytest.mark.parametrize(('arguments', 'message'), [
    ({'cycles': 0}, 'cycles must be at least 1'), ({'speed': 0.0}, 'speed must be positive'),
    ({'acceleration': -1.0}, 'acceleration must be positive'), ({'jerk': 0.0}, 'jerk must be'),
    ({'round_trip': -1.0}, 'round_trip must be positive'), ({'centre': (0.0, 0.0)}, 'centre must')])
def test_adept_refuses_bad_arguments(arguments, message):
    with pytest.raises(InputError, match=message):
        adept_motion(REFERENCE, **arguments)


def test_adept_out_of_reach_is_refused():
    with pytest.raises(UnreachableError, match='cannot reach'):
        adept_motion(REFERENCE, centre=(1.0, 0.0, -0.78))


@ROBOTS
def test_circle_is_a_circle_at_constant_speed_between_start_and_stop(robot):
    radius, speed = 0.4 * robot.limits.workspace.radius, 0.8
    motion = circle_motion(robot, radius=radius, speed=speed, turns=3, theta_swing=0.4)
    centre = home_pose(robot)
    assert np.abs(np.hypot(*(motion.x[:, :2] - centre[:2]).T) - radius).max() < 1e-12
    assert np.ptp(motion.x[:, 2]) == 0.0
    speeds = np.hypot(*motion.xd[:, :2].T)
    middle = slice(len(speeds) // 3, 2 * len(speeds) // 3)
    assert np.abs(speeds[middle] - speed).max() < 1e-9
    assert speeds.max() < speed + 1e-9
    assert np.ptp(motion.x[:, 3]) == pytest.approx(0.4, rel=1e-3)
    turned = np.unwrap(np.arctan2(*(motion.x[:, :2] - centre[:2]).T[::-1]))
    assert turned[-1] - turned[0] == pytest.approx(6.0 * math.pi)
    for still in (0, -1):
        assert np.abs(motion.qd[still]).max() < 1e-9
        assert np.abs(motion.qdd[still]).max() < 1e-9
    check_limits(motion, robot)


def test_waypoints_stop_in_every_pose_and_keep_their_limits():
    poses = [HOME, (0.2, 0.1, -0.7, 0.5), (0.2, 0.1, -0.7, 0.5), (0.2, 0.1, -0.7, -0.7),
             (-0.1, 0.0, -0.8, -0.7)]
    motion = waypoints_motion(REFERENCE, poses, speed=0.5, acceleration=4.0, jerk=100.0,
                              theta_speed=1.0, theta_acceleration=9.0, theta_jerk=200.0, dwell=0.1)
    still = np.abs(motion.xd).max(axis=1) == 0.0
    rests = motion.x[still]
    for pose in poses:
        assert np.abs(rests - pose).max(axis=1).min() < 1e-9
    distances = np.abs(rests[:, None] - np.array(poses)).max(axis=2).min(axis=1)
    assert distances.max() < 1e-9
    assert np.linalg.norm(motion.xd[:, :3], axis=1).max() == pytest.approx(0.5, rel=1e-3)
    assert np.linalg.norm(motion.xdd[:, :3], axis=1).max() < 4.0 + 1e-9
    assert np.abs(motion.xd[:, 3]).max() == pytest.approx(1.0, rel=1e-3)
    assert np.abs(motion.xdd[:, 3]).max() < 9.0 + 1e-9
    jerk = np.diff(motion.xdd, axis=0) / motion.period
    assert np.linalg.norm(jerk[:, :3], axis=1).max() < 100.0 + 1e-6
    assert np.abs(jerk[:, 3]).max() < 200.0 + 1e-6


@pytest.mark.parametrize(('poses', 'arguments', 'message'), [
    ([HOME], {}, 'at least two poses'), ([HOME, (0.0, 0.0)], {}, 'found 2 of 2 or 4 numbers'),
    ([HOME, HOME], {}, 'must be positive'), ([HOME, (0, 0, -0.7, 0)], {'jerk': 0.0}, 'jerk must'),
    ([HOME, (0, 0, -0.7, 0)], {'theta_speed': 0.0}, 'theta: speed must'),
    ([HOME, (0, 0, -0.7, 0)], {'dwell': -1.0}, 'dwell must')])
def test_waypoints_refuse_bad_arguments(poses, arguments, message):
    with pytest.raises(InputError, match=message):
        waypoints_motion(REFERENCE, poses, **arguments)


@ROBOTS
@pytest.mark.parametrize('duration', [SHORTEST, 13.0])
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_excitation_rests_at_home_and_keeps_every_limit(robot, duration, seed):
    motion = excitation_motion(robot, duration, seed)
    check_limits(motion, robot)
    assert motion.duration == pytest.approx(duration)
    for still in (0, -1):
        assert np.abs(motion.x[still] - home_pose(robot)).max() < 1e-9
        for part in (motion.xd, motion.xdd, motion.qd, motion.qdd):
            assert np.abs(part[still]).max() < 1e-6
    slow = motion.t <= 0.4 * duration
    accelerations = plate_accelerations(motion, robot)
    assert accelerations.max() < 100.0
    assert accelerations[slow].max() < SLOW_ACCELERATION
    assert np.abs(motion.qd[slow]).max() < 1.0
    assert np.abs(motion.qd).max() < 0.6 * robot.limits.joint_speed


@ROBOTS
@pytest.mark.parametrize('seed', [0, 1, 2])
def test_excitation_is_slow_with_many_reversals_and_then_fast(robot, seed):
    motion = excitation_motion(robot, 30.0, seed)
    slow = motion.t < 12.0
    speeds = np.abs(motion.qd[slow])
    assert reversals(motion.qd[slow]).min() >= 15
    assert (speeds > 0.05).mean() > 0.5
    assert np.quantile(speeds, 0.99) > 0.4
    accelerations = plate_accelerations(motion, robot)[~slow]
    assert accelerations.max() > 70.0
    assert np.sqrt(np.mean(accelerations ** 2)) > 20.0
    # The half plates must not just move together, or their masses cannot be told apart.
    turning = robot.geometry.platform_bar_length * motion.xdd[~slow, 3]
    assert np.abs(turning).max() > 8.0
    assert (np.ptp(motion.x, axis=0) > 0.4 * np.array((
        robot.limits.workspace.radius, robot.limits.workspace.radius,
        np.ptp(robot.limits.workspace.z), robot.limits.workspace.theta))).all()


@ROBOTS
def test_long_excitation_stays_inside(robot):
    motion = excitation_motion(robot, 240.0, 11, period=5e-3)
    check_limits(motion, robot)
    space = robot.limits.workspace
    used = np.ptp(motion.x, axis=0) / (2 * space.radius, 2 * space.radius, np.ptp(space.z),
                                       2 * space.theta)
    assert used.min() > 0.35
    assert used.max() < 0.95
    middle = 0.5 * (motion.x[:, 2].min() + motion.x[:, 2].max())
    assert middle == pytest.approx(np.mean(space.z), abs=0.1 * np.ptp(space.z))


def test_excitation_follows_its_seed():
    first, again, other = (excitation_motion(REFERENCE, 6.0, seed) for seed in (5, 5, 6))
    assert np.array_equal(first.x, again.x)
    assert np.array_equal(first.qdd, again.qdd)
    assert np.abs(first.x - other.x).max() > 0.05


def test_excitation_is_smooth():
    motion = excitation_motion(REFERENCE, 8.0, 3, period=2.5e-4)
    step = motion.period

    def error(value: np.ndarray, rate: np.ndarray) -> np.ndarray:
        return np.diff(value, axis=0) / step - 0.5 * (rate[1:] + rate[:-1])

    for value, rate in ((motion.x, motion.xd), (motion.xd, motion.xdd), (motion.q, motion.qd),
                        (motion.qd, motion.qdd)):
        assert (np.abs(error(value, rate)).max(axis=0) < 1e-3 * np.abs(rate).max(axis=0)).all()
    # Three times differentiable: the jerk is continuous, its steps vanish with the period.
    jerk = np.diff(motion.xdd, axis=0) / step
    assert (np.abs(np.diff(jerk, axis=0)).max(axis=0) < 0.05 * np.abs(jerk).max(axis=0)).all()


def test_excitation_takes_other_limits():
    gentle = excitation_motion(REFERENCE, 10.0, acceleration=20.0)
    assert 15.0 < plate_accelerations(gentle, REFERENCE).max() < 20.0
    unhurried = excitation_motion(REFERENCE, 10.0, joint_speed=2.0)
    assert 1.5 < np.abs(unhurried.qd).max() < 2.0
    mostly_slow = excitation_motion(REFERENCE, 10.0, slow_fraction=0.8)
    assert np.abs(mostly_slow.qd[mostly_slow.t < 8.0]).max() < 1.0
    coarse = excitation_motion(REFERENCE, 10.0, acceleration=1e6, joint_speed=14.0, period=0.01)
    moved = np.diff(coarse.q, axis=0) / 0.01 - 0.5 * (coarse.qd[1:] + coarse.qd[:-1])
    assert np.abs(moved).max() < 0.05 * np.abs(coarse.qd).max()
    narrow = copied(REFERENCE, joint_position=(-0.3, 1.0))
    check_limits(excitation_motion(narrow, 10.0), narrow)


@pytest.mark.parametrize(('arguments', 'message'), [
    ({'duration': 3.9}, r'3\.9 s; at least 4 s'), ({'duration': math.nan}, 'at least 4 s'),
    ({'seed': -1}, 'seed must'), ({'slow_fraction': 1.0}, 'slow_fraction must'),
    ({'acceleration': 0.0}, 'acceleration must'), ({'joint_speed': -1.0}, 'joint_speed must'),
    ({'period': 0.0}, 'positive')])
def test_excitation_refuses_bad_arguments(arguments, message):
    with pytest.raises(InputError, match=message):
        excitation_motion(REFERENCE, **arguments)


def test_excitation_of_a_robot_that_cannot_is_refused():
    with pytest.raises(InputError, match='joint range'):
        excitation_motion(copied(REFERENCE, joint_position=(-1.0, 0.41)), 10.0)


def test_blended_waypoints_pass_the_corner_without_a_stop_and_save_time():
    corner = HOME + np.array(((-0.1, -0.05, 0, 0), (0.1, -0.05, 0, 0), (0.1, 0.1, 0, 0.3)))
    square, blended = (waypoints_motion(REFERENCE, corner, blend=blend) for blend in (0.0, 1.0))
    for motion in (square, blended):
        np.testing.assert_allclose(motion.x[[0, -1]], corner[[0, -1]], atol=1e-9)
        for order, of in (('xd', 'x'), ('xdd', 'xd')):  # derivatives, also across the corner
            steps = np.diff(getattr(motion, of), axis=0) / motion.period
            middle = 0.5 * (getattr(motion, order)[1:] + getattr(motion, order)[:-1])
            np.testing.assert_allclose(steps, middle, atol=2e-2 * np.abs(middle).max())
    speed = [np.linalg.norm(motion.xd[len(motion.t) // 4:-len(motion.t) // 4, :3], axis=1).min()
             for motion in (square, blended)]
    assert speed[0] < 0.01 < 0.2 < speed[1]
    assert blended.duration < 0.8 * square.duration
    nearest = np.linalg.norm(blended.x[:, :3] - corner[1, :3], axis=1).min()
    assert 1e-3 < nearest < 0.05
    acceleration = np.linalg.norm(blended.xdd[:, :3], axis=1).max()
    assert acceleration < 1.001 * math.sqrt(2.0) * 10.0
    for wrong in ({'blend': 1.2}, {'blend': -0.1}, {'blend': 0.5, 'dwell': 0.1}):
        with pytest.raises(InputError, match='blend must be 0 to 1'):
            waypoints_motion(REFERENCE, corner, **wrong)


@pytest.mark.parametrize(('part', 'limits', 'message'), [
    ('joint position', {'joint_position': (-1.0, 0.5)}, r'rad is outside -1 to 0\.5 rad'),
    ('joint speed', {'joint_speed': 2.0}, 'is outside -2 to 2 rad/s')])
def test_check_limits_names_what_is_outside(part, limits, message):
    with pytest.raises(InputError, match=rf'motion adept: {part} .*{message}'):
        check_limits(adept_motion(REFERENCE), copied(REFERENCE, **limits))


def test_check_limits_names_the_limit_that_is_broken_first_when_and_where():
    """Speed is exceeded on the way, theta only at the end of it."""
    motion = adept_motion(REFERENCE, theta_swing=math.pi / 2.0)
    too_fast = np.abs(motion.qd).max(axis=1) > 5.0
    too_far = np.abs(motion.x[:, 3]) > 0.7
    assert too_far[0]  # it begins turned
    with pytest.raises(InputError, match=r'theta .* from 0\.000 s on, at the pose \(-0\.152'):
        check_limits(motion, copied(REFERENCE, joint_speed=5.0, workspace=Workspace(theta=0.7)))
    first = motion.t[np.argmax(too_fast)]
    with pytest.raises(InputError, match=rf'joint speed -?\d.* from {first:.3f} s on'):
        check_limits(motion, copied(REFERENCE, joint_speed=5.0))


def test_the_reference_robot_holds_the_range_of_theta_of_the_paper():
    """"The natural range is -pi/4 to pi/4"; the built-in robot and one without limits hold it."""
    for robot in (REFERENCE, Robot.model_validate(
            REFERENCE.model_dump(by_alias=True, exclude={'limits'}))):
        check_limits(adept_motion(robot, theta_swing=math.pi / 2.0), robot)
        with pytest.raises(InputError, match='theta'):
            check_limits(adept_motion(robot, theta_swing=1.001 * math.pi / 2.0), robot)


@pytest.mark.parametrize(('poses', 'part'), [
    ([(0.52, 0.0, -0.78, 0.0)], 'radius of D'), ([(0.0, 0.0, -0.95, 0.0)], 'z of D'),
    ([(0.0, 0.0, -0.78, -0.8)], 'theta')])
def test_check_limits_of_the_platform(poses, part):
    with pytest.raises(InputError, match=part):
        check_limits(waypoints_motion(REFERENCE, [HOME, *poses]), REFERENCE)


@ROBOTS
@pytest.mark.parametrize('frame', ['joint', 'platform'])
def test_motion_file_gives_the_motion_back(tmp_path, robot, frame):
    motion = excitation_motion(robot, 5.0, 4)
    path = tmp_path / 'there' / 'mine.yaml'
    write_motion(path, motion, frame)
    back = read_motion(path, robot)
    assert back.name == 'mine'
    parts = ('q', 'qd', 'qdd') if frame == 'joint' else ('x', 'xd', 'xdd')
    for part in ('t', *parts):
        assert np.array_equal(getattr(back, part), getattr(motion, part))
    for part in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd'):
        assert np.abs(getattr(back, part) - getattr(motion, part)).max() < 1e-9
    assert sorted(file.name for file in path.parent.iterdir()) == ['mine.csv', 'mine.yaml']
    header = (path.parent / 'mine.csv').read_text().splitlines()[0]
    assert header == 't,' + ','.join(JOINT_COLUMNS if frame == 'joint' else PLATFORM_COLUMNS)
    assert read_yaml(path) == {'schema': MOTION_SCHEMA, 'frame': frame, 'samples': 'mine.csv'}


@pytest.mark.parametrize('recipe', [
    {'kind': 'adept'},
    {'kind': 'adept', 'speed': 2.0, 'acceleration': 30.0, 'round_trip': None, 'cycles': 2},
    {'kind': 'adept', 'jerk': 3e4, 'round_trip': 0.29, 'centre': [0.0, 0.1, -0.8]},
    {'kind': 'excitation', 'duration': 5.0, 'seed': 3, 'period': 2e-3},
    {'kind': 'circle', 'radius': 0.1, 'turns': 2},
    {'kind': 'waypoints', 'poses': [list(HOME), [0.1, 0.0, -0.7, 0.2]], 'dwell': 0.2}])
def test_recipe_gives_its_motion(tmp_path, recipe):
    make = {'adept': adept_motion, 'excitation': excitation_motion, 'circle': circle_motion,
            'waypoints': waypoints_motion}[recipe['kind']]
    direct = make(REFERENCE, **{key: value for key, value in recipe.items() if key != 'kind'})
    write_yaml(tmp_path / 'recipe.yaml', {'schema': MOTION_SCHEMA, 'recipe': recipe})
    motion = read_motion(tmp_path / 'recipe.yaml', REFERENCE)
    assert np.array_equal(motion.t, direct.t)
    assert np.array_equal(motion.qdd, direct.qdd)


@pytest.mark.parametrize(('content', 'message'), [
    ({'schema': 'par4/motion/2'}, 'expected schema par4/motion/1'),
    ({'schema': MOTION_SCHEMA}, 'either recipe, or frame and samples, found none'),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': []}}, r'recipe of kind .*, found \[\]'),
    ({'schema': MOTION_SCHEMA, 'frame': 'joint'}, 'found frame'),
    ({'schema': MOTION_SCHEMA, 'frame': 'joint', 'samples': 'a.csv', 'recipe': {}}, 'either'),
    ({'schema': MOTION_SCHEMA, 'frame': 'tool', 'samples': 'a.csv'}, "'tool'"),
    ({'schema': MOTION_SCHEMA, 'frame': 'joint', 'samples': '../a.csv'}, 'beside this one'),
    ({'schema': MOTION_SCHEMA, 'frame': 'joint', 'samples': 'a.csv'}, r'a\.csv: no such file'),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': 'dance'}},
     "circle, waypoints, online, found 'dance'"),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': 'adept', 'sped': 1.0}}, 'sped'),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': 'adept', 'speed': 'fast'}}, "'fast'"),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': 'adept', 'speed': math.inf}}, 'finite'),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': 'adept', 'speed': -1.0}}, 'speed must be'),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': 'waypoints'}}, 'poses: the key is missing'),
    ({'schema': MOTION_SCHEMA, 'recipe': {'kind': 'circle', 'radius': 3.0}}, 'cannot reach')])
def test_bad_motion_files_are_refused_in_one_line(tmp_path, content, message):
    path = tmp_path / 'bad.yaml'
    write_yaml(path, content)
    with pytest.raises(Par4Error, match=message) as caught:
        read_motion(path, REFERENCE)
    assert '\n' not in str(caught.value)
    assert str(tmp_path) in str(caught.value)


def _swap_header(lines: list[str]) -> list[str]:
    return [lines[0].replace('q0', 'q1', 1), *lines[1:]]


def _cell(lines: list[str], row: int, column: int, text: str) -> list[str]:
    cells = lines[row].split(',')
    cells[column] = text
    return [*lines[:row], ','.join(cells), *lines[row + 1:]]


def _scaled(lines: list[str], column: int, factor: float) -> list[str]:
    rows = [line.split(',') for line in lines[1:]]
    return [lines[0], *(','.join([*row[:column], repr(float(row[column]) * factor),
                                  *row[column + 1:]]) for row in rows)]


@pytest.mark.parametrize(('damage', 'message'), [
    (_swap_header, 'expected the header t,q0,'),
    (lambda lines: lines[1:], 'expected the header'),
    (lambda lines: lines[:2], '1 samples, at least 2'),
    (lambda lines: [*lines[:50], lines[50][:40]], 'sample 50 has'),
    (lambda lines: _cell(lines, 7, 3, 'x'), 'every cell must be a number'),
    (lambda lines: _cell(lines, 7, 3, 'nan'), 'q2 of sample 7 is nan'),
    (lambda lines: _cell(lines, 7, 11, '1e200'), 'qdd2 of sample 7 is 1e'),
    (lambda lines: _scaled(lines, 0, 1e-9), 'samples are .* s apart, at least'),
    (lambda lines: [*lines[:30], *lines[31:]], 't of sample'),
    (lambda lines: [lines[0], *lines[20:]], 't of sample 1 is'),
    (lambda lines: [lines[0], *lines[:0:-1]], 't of sample'),
    (lambda lines: _scaled(lines, 6, 180.0 / math.pi), 'qd1 is not the derivative of q1'),
    (lambda lines: _scaled(lines, 8, -1.0), 'qd3 is not the derivative of q3'),
    (lambda lines: _cell(lines, 90, 3, repr(float(lines[90].split(',')[3]) + 2e-3)),
     'qd2 is not the derivative of q2'),
    (lambda lines: _scaled(lines, 9, 0.0), 'qdd0 is not the derivative of qd0'),
    (lambda lines: _scaled(lines, 12, 2.0), 'qdd3 is not the derivative of qd3')])
def test_bad_samples_are_refused_in_one_line(tmp_path, damage, message):
    path = tmp_path / 'motion.yaml'
    write_motion(path, adept_motion(REFERENCE))
    table = tmp_path / 'motion.csv'
    read_motion(path, REFERENCE)
    table.write_text('\n'.join(damage(table.read_text().splitlines())))
    with pytest.raises(InputError, match=message) as caught:
        read_motion(path, REFERENCE)
    assert '\n' not in str(caught.value)
    assert 'motion.csv' in str(caught.value)


@pytest.mark.parametrize('name', ['motion.csv', 'motion.CSV'])
def test_a_motion_is_not_written_over_its_samples(name, tmp_path):
    with pytest.raises(InputError, match='expected a name that ends in .yaml; the samples go'):
        write_motion(tmp_path / name, adept_motion(REFERENCE))
    assert not list(tmp_path.iterdir())


def test_samples_rounded_in_a_spreadsheet_are_read(tmp_path):
    path = tmp_path / 'motion.yaml'
    motion = circle_motion(REFERENCE, theta_swing=0.0)
    write_motion(path, motion, 'platform')
    table = tmp_path / 'motion.csv'
    header, *rows = table.read_text().splitlines()
    rounded = [','.join(f'{float(cell):.6f}' for cell in row.split(',')) for row in rows]
    table.write_bytes(('\ufeff' + '\r\n'.join((header, *rounded, ''))).encode())
    assert np.abs(read_motion(path, REFERENCE).x - motion.x).max() < 1e-6


def test_joint_samples_that_do_not_close_are_refused(tmp_path):
    motion = circle_motion(REFERENCE)
    apart = np.array((2.0, -2.0, 2.0, -2.0))
    write_motion(tmp_path / 'motion.yaml', replace(motion, q=motion.q + apart))
    with pytest.raises(UnreachableError, match=r'motion\.csv: joint positions 0'):
        read_motion(tmp_path / 'motion.yaml', REFERENCE)


@pytest.mark.parametrize('frame', ['joint', 'platform'])
def test_a_tool_knows_its_own_motion_until_somebody_changes_it(frame, tmp_path):
    path, motion = tmp_path / 'motion.yaml', circle_motion(REFERENCE)
    assert free_motion_path(path, 'par4_x') == path
    write_motion(path, motion, frame, 'par4_x')
    np.testing.assert_allclose(read_motion(path, REFERENCE).q, motion.q, atol=1e-9)
    assert is_untouched(path, 'par4_x')
    assert not is_untouched(path, 'par4_y')
    assert free_motion_path(path, 'par4_x') == path
    for file in (path, path.with_suffix('.csv')):
        content = file.read_bytes()
        for changed in (content + b'\n', content.swapcase(), b'', None):
            file.unlink()
            if changed is not None:
                file.write_bytes(changed)
            assert not is_untouched(path, 'par4_x')
            assert free_motion_path(path, 'par4_x') == tmp_path / 'motion_2.yaml'
            file.write_bytes(content)
        assert is_untouched(path, 'par4_x')
    write_motion(path, motion, frame)
    assert not is_untouched(path, '')
    (tmp_path / 'motion_2.csv').mkdir()
    (tmp_path / 'motion_3.yaml').symlink_to(tmp_path / 'nowhere')
    assert free_motion_path(path, 'par4_x') == tmp_path / 'motion_4.yaml'


def test_a_failed_write_leaves_the_old_files(tmp_path):
    path = tmp_path / 'motion.yaml'
    write_motion(path, adept_motion(REFERENCE))
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(KeyError):
        write_motion(path, circle_motion(REFERENCE), 'tool')
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_named_motions(tmp_path):
    for name, own in (('adept', 0.25), ('excitation', 30.0), ('circle', None)):
        motion = named_motion(name, REFERENCE)
        assert motion.name == name
        if own:
            assert motion.duration == pytest.approx(own)
        longer = named_motion(name, REFERENCE, duration=11.0)
        assert 8.0 < longer.duration <= 11.0 + 1e-9
    assert named_motion('adept', REFERENCE, duration=0.01).duration == pytest.approx(0.25)
    first, other = (named_motion('excitation', REFERENCE, 5.0, seed) for seed in (1, 2))
    assert np.array_equal(first.q, excitation_motion(REFERENCE, 5.0, 1).q)
    assert not np.array_equal(first.q, other.q)
    write_motion(tmp_path / 'motion.yaml', first)
    assert np.array_equal(named_motion(tmp_path / 'motion.yaml', REFERENCE).q, first.q)


def test_named_motion_checks_limits_and_names(tmp_path):
    with pytest.raises(InputError, match=r'motion waltz: no such file, and not a .*circle'):
        named_motion('waltz', REFERENCE)
    write_yaml(tmp_path / 'far.yaml', {'schema': MOTION_SCHEMA, 'recipe': {
        'kind': 'circle', 'centre': [0.0, 0.0, -0.91]}})
    with pytest.raises(InputError, match='motion circle: z of D -0'):
        named_motion(tmp_path / 'far.yaml', REFERENCE)
    with pytest.raises(InputError, match='joint speed'):
        named_motion('adept', copied(REFERENCE, joint_speed=3.0))


@ROBOTS
def test_motion_of_joints_inverts_a_platform_motion(robot):
    motion = excitation_motion(robot, 4.0, 7)
    back = motion_of_joints('back', robot.geometry, motion.t, motion.q, motion.qd, motion.qdd)
    for part in ('x', 'xd', 'xdd'):
        given = getattr(motion, part)
        assert np.abs(getattr(back, part) - given).max() < 1e-9 * max(1.0, np.abs(given).max())
    assert back.period == pytest.approx(1e-3)


@pytest.mark.parametrize('period', [1e-9, 1e-212, 5e-324])
def test_a_period_without_sense_is_refused_in_a_line_however_small(period):
    """A length over such a period is no number."""
    with pytest.raises(InputError, match='samples, at most .* are possible'):
        sample_times(1e200, period)
