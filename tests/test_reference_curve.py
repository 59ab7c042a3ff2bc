"""What drives follow at the most: limits on points and between them, and the ramp to rest."""

from __future__ import annotations

import itertools
from contextlib import suppress

import numpy as np
import pytest

from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints
from par4_kinematics.adept import adept_motion
from par4_kinematics.braking import BRAKING_TIME, braked, ways_to_rest
from par4_kinematics.circle import circle_motion
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.limits import check_torque
from par4_kinematics.position import forward_kinematics, inverse_kinematics
from par4_kinematics.workspace import home_pose, inside
from par4_sim.closed_loop.simulation import build_simulation
from par4_sim.drives.reference import ReferenceQueue
from par4_sim.drives.reference_curve import HARDEST, ReferenceLimits, between
from robots import REFERENCE

LIMITS = ReferenceLimits(REFERENCE)
HOME_Q = inverse_kinematics(REFERENCE.geometry, home_pose(REFERENCE))
ADEPT = adept_motion(REFERENCE)
CIRCLE = circle_motion(REFERENCE, speed=3.0, turns=6.0)


def points(q, qd=0.0, qdd=0.0) -> np.ndarray:
    """Return points (n, 12) at q (n, 4)."""
    q = np.atleast_2d(q)
    return np.hstack([np.broadcast_to(part, q.shape) for part in (q, qd, qdd)])


@pytest.mark.parametrize(('bad', 'named'), [
    (points(HOME_Q + 2.5), 'joint position 3.*outside -1 to 1.6 rad'),
    (points(HOME_Q, 40.0), 'joint speed 40 rad/s is outside -15 to 15'),
    (points(HOME_Q, 1e160), 'joint speed 1e.160 rad/s'),
    (points(HOME_Q, 0.0, -1e160), 'joint acceleration -1e.160 rad/s2'),
    (points(inverse_kinematics(REFERENCE.geometry, (0.0, 0.0, -0.95, 0.0))), 'z of D -0.95 m'),
    (points(inverse_kinematics(REFERENCE.geometry, (0.0, 0.0, -0.75, 0.9))), 'theta 0.9 rad'),
])
def test_a_point_beyond_a_limit_is_refused_by_its_name(bad, named):
    LIMITS.check(np.zeros(1), points(HOME_Q))
    with pytest.raises(InputError, match=named):
        LIMITS.check(np.zeros(1), bad)


def test_a_point_that_no_leg_reaches_is_refused():
    with pytest.raises(UnreachableError):
        LIMITS.check(np.zeros(1), points((1.5, -0.9, 1.5, -0.9)))


def test_points_within_the_limits_with_a_way_beyond_them_are_refused():
    both = points(np.stack((HOME_Q, HOME_Q + 0.2)))
    LIMITS.check(np.array((0.0, 0.5)), both)
    with pytest.raises(InputError, match='on the way .* joint speed'):
        LIMITS.check(np.array((0.0, 0.01)), both)
    there = inverse_kinematics(REFERENCE.geometry, (0.0, 0.0, -0.89, 0.0))
    swing = points(np.stack((there, there)), np.array([[8.0] * 4, [-8.0] * 4]))
    with pytest.raises(InputError, match='on the way .* z of D -1'):
        LIMITS.check(np.array((0.0, 0.1)), swing)


@pytest.mark.parametrize(('span', 'qd', 'qdd', 'named'), [
    (4.0, 0.0, 2.4, 'z of D -1'),
    (4.0, 0.0, -2.4, 'z of D -0.5'),
    (5.0, -0.5, 0.0, 'z of D -1'),
])
def test_a_way_that_swings_out_of_the_workspace_and_back_is_refused(span, qd, qdd, named):
    """From rest to a moving point at the same place: the longer ahead, the further the swing."""
    both = points(np.stack((HOME_Q, HOME_Q)), np.array([[0.0] * 4, [qd] * 4]),
                  np.array([[0.0] * 4, [qdd] * 4]))
    LIMITS.check(np.array((0.0, 0.1)), both)
    with pytest.raises(InputError, match=f'on the way .* {named}'):
        LIMITS.check(np.array((0.0, span)), both)


def test_no_way_that_is_let_pass_leaves_the_workspace():
    """But for what lies between two looks: 5 mm, and 5 mrad of theta."""
    space, generator = REFERENCE.limits.workspace, np.random.default_rng(7)
    shares, followed = np.linspace(0.0, 1.0, 100), np.empty((100, 12))
    kept = 0
    for _ in range(1500):
        span = 10.0 ** generator.uniform(-2.0, 1.0)
        scale = min(1.0, 0.5 / span)  # of the time in which a joint goes far
        first, second = (points(
            HOME_Q + generator.uniform(-0.2, 0.2, 4), generator.normal(0.0, scale, 4),
            generator.normal(0.0, 10.0 * scale ** 2, 4))[0] for _ in range(2))
        if generator.integers(2):
            second[:4] = first[:4]
        with suppress(InputError, UnreachableError):
            LIMITS.check(np.array((0.0, span)), np.stack((first, second)))
            for share, state in zip(shares, followed, strict=True):
                between(first, second, span, share, state)
            x = forward_kinematics(REFERENCE.geometry, followed[:, :4])
            beyond = np.stack((np.hypot(x[:, 0], x[:, 1]) - space.radius, x[:, 2] - space.z[1],
                               space.z[0] - x[:, 2], np.abs(x[:, 3]) - space.theta))
            assert beyond.max() < 5e-3, (first, second, span)
            kept += 1
    assert kept > 300


def test_torque_beyond_the_limit_is_refused_and_so_is_none():
    tau = np.zeros((3, 4))
    check_torque(REFERENCE, tau + 200.0, 200.0)
    tau[1, 2] = -201.0
    with pytest.raises(InputError, match='point 1: torque of arm_joint_2 .* limit of 200 N m'):
        check_torque(REFERENCE, tau, 200.0)
    tau[1, 2] = np.nan
    with pytest.raises(InputError, match='no finite torque'):
        check_torque(REFERENCE, tau, 200.0)


def test_a_jump_from_where_the_reference_is_is_refused_and_changes_nothing():
    queue = ReferenceQueue(HOME_Q, LIMITS)
    t = np.array((0.1, 0.2))
    still = np.zeros((2, 4))
    queue.queue(0.0, t, np.tile(HOME_Q, (2, 1)) + 0.1, still, still)
    before = queue.times.copy(), queue.points.copy()
    with pytest.raises(InputError, match='joint speed'):
        queue.queue(0.0, np.array((0.201,)), HOME_Q[None] + 0.5, still[:1], still[:1])
    np.testing.assert_array_equal(queue.times, before[0])
    np.testing.assert_array_equal(queue.points, before[1])


@pytest.mark.parametrize('share', [0.1, 0.3, 0.5, 0.6, 0.9])
def test_a_reference_that_ends_in_motion_comes_to_rest_within_the_limits(share):
    queue = ReferenceQueue(ADEPT.q[0], LIMITS)
    count = int(share * len(ADEPT.t))
    queue.queue(-1.0, *(values[:count] for values in (ADEPT.t, ADEPT.q, ADEPT.qd, ADEPT.qdd)))
    end = ADEPT.t[count - 1]
    queue.use_until(end)
    assert queue.interrupted == 0
    times = end + np.arange(0.0, 0.5, 1e-4)
    queue.foresee(end)
    followed = np.array([queue.target(time) for time in times])
    q, qd = followed[:, :4], followed[:, 4:8]
    np.testing.assert_allclose(q[0], ADEPT.q[count - 1], atol=1e-9)
    np.testing.assert_allclose(qd[0], ADEPT.qd[count - 1], atol=1e-6)
    # velocity is the derivative of position and goes on without a jump, to rest
    np.testing.assert_allclose(np.gradient(q, times, axis=0)[1:-1], qd[1:-1], atol=0.02)
    assert np.abs(np.diff(qd, axis=0)).max() < 0.1
    np.testing.assert_array_equal(qd[-1], 0.0)
    assert np.abs(qd).max() <= REFERENCE.limits.joint_speed
    assert inside(REFERENCE, forward_kinematics(REFERENCE.geometry, q)).all()
    queue.use_until(times[-1])
    assert (queue.interrupted, queue.starved) == (1, True)


def test_a_stream_that_goes_on_in_time_follows_no_ramp():
    """Points one by one, each just ahead of the clock: what is followed is the motion."""
    queue = ReferenceQueue(ADEPT.q[0], LIMITS)
    for row in range(len(ADEPT.t)):
        now = ADEPT.t[row] - 0.005
        queue.queue(now, ADEPT.t[row:row + 1], ADEPT.q[row:row + 1], ADEPT.qd[row:row + 1],
                    ADEPT.qdd[row:row + 1])
        queue.foresee(now)
        queue.use_until(now)
        if row > 10:
            np.testing.assert_allclose(queue.target(ADEPT.t[row - 4])[:4], ADEPT.q[row - 4],
                                       atol=1e-9)
    assert (queue.interrupted, queue.late_points) == (0, 0)


def test_a_stream_that_comes_back_goes_on_from_the_ramp():
    queue = ReferenceQueue(ADEPT.q[0], LIMITS)
    half = len(ADEPT.t) // 3
    parts = (ADEPT.t, ADEPT.q, ADEPT.qd, ADEPT.qdd)
    queue.queue(-1.0, *(values[:half] for values in parts))
    now = ADEPT.t[half - 1] + 0.3
    queue.foresee(now)
    queue.use_until(now)
    assert queue.starved
    rest = queue.target(now)[:4]
    later = now + 0.4 + ADEPT.t[:2]
    queue.queue(now, later, np.tile(ADEPT.q[0], (2, 1)), np.zeros((2, 4)), np.zeros((2, 4)))
    assert not queue.starved
    way = np.array([queue.target(time)[:4] for time in np.linspace(now, later[0], 50)])
    np.testing.assert_allclose(way[0], rest)
    np.testing.assert_allclose(way[-1], ADEPT.q[0])
    assert np.abs(np.diff(way, axis=0)).max() < 0.1


@pytest.mark.parametrize('fidelity', ['exact', 'fast', 'accurate'])
def test_every_plant_brakes_softly_when_the_reference_ends_in_motion(fidelity):
    """A quarter into a 15 G cycle at 7 rad/s, with feedforward: no step of torque, rest inside."""
    model = read_model('table1_full', REFERENCE)
    tau = model.torque(state_of_joints(REFERENCE.geometry, ADEPT.t, ADEPT.q, ADEPT.qd, ADEPT.qdd))
    steps, ends = {}, {}
    for limits in (None, LIMITS):
        simulation = build_simulation(REFERENCE, model, fidelity, pose=ADEPT.x[0], limits=limits)
        count = len(ADEPT.t) // 4
        start = simulation.time + 0.02
        simulation.queue_effort(start + ADEPT.t[:count], tau[:count])
        simulation.queue_reference(start + ADEPT.t[:count], ADEPT.q[:count], ADEPT.qd[:count],
                                   ADEPT.qdd[:count])
        samples = [simulation.next_sample() for _ in range(20 + count + 400)]
        effort = np.array([sample.effort for sample in samples[20 + count - 3:]])
        steps[limits] = np.abs(np.diff(effort, axis=0)).max()
        ends[limits] = samples[-1]
        simulation.close()
    assert steps[None] > 100.0
    assert steps[LIMITS] < 15.0
    assert np.abs(ends[LIMITS].qd).max() < 0.1
    assert inside(REFERENCE, ends[LIMITS].true_pose)


def test_a_motion_brakes_on_its_own_path():
    smooth = adept_motion(REFERENCE, jerk=30000.0)
    start = 0.4 * smooth.duration
    t, q, qd, qdd = braked(smooth, start)
    assert t[0] == pytest.approx(start, abs=smooth.period)
    first = int(np.argmin(np.abs(smooth.t - t[0])))
    for ours, theirs in ((q, smooth.q), (qd, smooth.qd), (qdd, smooth.qdd)):
        np.testing.assert_allclose(ours[0], theirs[first], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(np.diff(t), smooth.period)
    np.testing.assert_allclose(qd[-1], 0.0, atol=1e-9)
    np.testing.assert_allclose(qdd[-1], 0.0, atol=1e-6)
    # derivatives are those of what is returned
    np.testing.assert_allclose(np.gradient(q, t, axis=0)[1:-1], qd[1:-1], atol=0.02)
    np.testing.assert_allclose(np.gradient(qd, t, axis=0)[2:-2], qdd[2:-2], atol=20.0)
    # on the path: where its own reference would be half the braking time later
    end = int(np.argmin(np.abs(smooth.t - t[0] - 0.5 * BRAKING_TIME)))
    np.testing.assert_allclose(q[-1], smooth.q[end], atol=1e-6)
    on_path = np.abs(smooth.q[None, first:end + 1] - q[:, None]).max(axis=2).min(axis=1)
    assert on_path.max() < np.abs(np.diff(smooth.q, axis=0)).max()


@pytest.mark.parametrize('begin', [-0.4, 0.3, 0.5, 0.73])
@pytest.mark.parametrize('lateness', [0.0, 0.1, 0.151, 0.17, 0.2, 0.26, 0.4, 0.55, 0.8, 0.9])
def test_of_the_ways_to_rest_one_is_in_time_however_late_they_arrive(begin, lateness):
    """Seconds in which the sender is held up between its look at the clock and the drives."""
    path = CIRCLE
    sent = begin + 1.0
    ways = ways_to_rest(path, begin, 0.15, sent)
    for way, later in itertools.pairwise(ways):
        assert later[0][0] > way[0][-1], 'torques of one would be taken for those of another'
    assert ways[-1][0][0] <= sent
    queue = ReferenceQueue(path.q[0], LIMITS)
    known = path.t <= sent
    queue.queue(begin - 1.0, *(part[known] for part in (path.t, path.q, path.qd, path.qdd)))
    arrived = begin + lateness
    queue.use_until(arrived)
    for way in reversed(ways):
        with suppress(InputError):  # what is late and would jolt
            queue.queue(arrived, *way)
    queue.foresee(sent + 1.0)
    times = arrived + np.arange(0.0, 2.5, 2.5e-4)
    followed = np.array([queue.target(time) for time in times])
    q, qd = followed[:, :4], followed[:, 4:8]
    queue.use_until(times[-1])
    assert (queue.starved, queue.interrupted) == (False, 0), 'the drives need not brake'
    np.testing.assert_array_equal(qd[-1], 0.0)
    # nothing is torn, neither position nor speed, and the path is not left
    assert np.abs(np.gradient(q, times, axis=0) - qd)[1:-1].max() < 0.05
    hardest = 1.5 * REFERENCE.limits.joint_speed / HARDEST
    assert np.abs(np.diff(qd, axis=0)).max() < 1.2 * hardest * 2.5e-4
    off = np.abs(path.q[None] - q[::40, None]).max(axis=2).min(axis=1)
    assert off.max() < 0.01
    # it rests within what the first way that is in time takes
    in_time = next(way for way in ways if way[0][0] > arrived)
    still = times[np.flatnonzero(np.abs(qd).max(axis=1) > 0.0)[-1]] if qd.any() else arrived
    assert still <= in_time[0][-1] + 1e-6


def test_points_that_come_too_late_to_be_joined_without_a_jolt_are_refused():
    path = CIRCLE
    queue = ReferenceQueue(path.q[0], LIMITS)
    queue.queue(-1.0, path.t, path.q, path.qd, path.qdd)
    now = 0.55
    before = queue.times.copy()
    brake = braked(path, now - 0.02)
    with pytest.raises(InputError, match='would jump: .* rad/s2'):
        queue.queue(now, *brake)
    np.testing.assert_array_equal(queue.times, before)
    # late points of the path that is being followed are no jolt
    late = slice(*np.searchsorted(path.t, (now - 0.1, now + 0.1)))
    queue.queue(now, path.t[late], path.q[late], path.qd[late], path.qdd[late])
    assert queue.late_points > 0


def approach(direction, speed):
    """Return q (4,) next to a limit, from home in a direction of D, and qd (4,) on towards it."""
    home, way = np.array(home_pose(REFERENCE)), np.array((*direction, 0.0))
    step = 1e-6 * way / np.linalg.norm(way)
    q, before = (inverse_kinematics(REFERENCE.geometry, home + part) for part in (way, way - step))
    return q, 1e6 * speed * (q - before)


@pytest.mark.parametrize(('direction', 'speed', 'named'), [
    ((0.499, 0.0, 0.0), 5.0, 'radius of D 0.5'),
    ((0.499, 0.0, 0.0), 1.0, 'radius of D 0.50'),
    ((0.0, 0.0, -0.119), 3.0, 'z of D -0.9'),
    ((0.0, 0.0, 0.229), 3.0, 'z of D -0.5')])
def test_a_reference_that_ends_in_motion_before_a_limit_is_refused(direction, speed, named):
    """Its sender may end, or the link: no ramp could keep the limit any more."""
    q, qd = approach(direction, speed)
    assert inside(REFERENCE, forward_kinematics(REFERENCE.geometry, q[None])[0])
    time = np.zeros(1)
    with pytest.raises(InputError, match=f'ends in motion .* {named}'):
        LIMITS.check(time, points(q, qd))
    # back from the limit and at rest there are fine
    LIMITS.check(time, points(q, -qd))
    LIMITS.check(time, points(q))


@pytest.mark.parametrize('motion', [
    ADEPT, CIRCLE, adept_motion(REFERENCE, jerk=30000.0),
    adept_motion(REFERENCE, centre=(0.343, 0.0, -0.8))], ids=['adept', 'circle', 'hard', 'aside'])
def test_no_point_of_a_motion_within_the_limits_is_refused(motion):
    """Streams send them one by one: each is the last for a moment."""
    for row in range(0, len(motion.t), 3):
        LIMITS.check(motion.t[row:row + 1], points(motion.q[row], motion.qd[row], motion.qdd[row]))


def streamed(gap, ahead, begin=0.3):
    """Return what is followed of a 15 G cycle again and again, point by point, and the queue.

    The points come `ahead` of their time, s, but for those of a gap that begins at a share of a
    cycle; at 0 and 1 it rests.
    """
    queue = ReferenceQueue(ADEPT.q[0], LIMITS)
    times = np.arange(0.0, 2.0 * ADEPT.duration, 0.01)
    rows = np.searchsorted(ADEPT.t, times % ADEPT.duration).clip(max=len(ADEPT.t) - 1)
    start = begin * ADEPT.duration
    followed = []
    for now in np.arange(0.0, times[-1], 0.0025):
        due = np.flatnonzero((times > now + ahead - 0.0025) & (times <= now + ahead))
        for row in due:
            if not start < times[row] < start + gap:
                place = slice(rows[row], rows[row] + 1)
                with suppress(InputError):
                    LIMITS.check(times[row:row + 1], points(
                        ADEPT.q[place], ADEPT.qd[place], ADEPT.qdd[place]))
                    queue.queue(now, times[row:row + 1], ADEPT.q[place], ADEPT.qd[place],
                                ADEPT.qdd[place])
        queue.foresee(now)
        queue.use_until(now)
        followed.append(queue.target(now))
    return np.array(followed), queue


@pytest.mark.parametrize('ahead', [0.02, 0.05])
def test_a_stream_that_was_interrupted_goes_on_without_a_jolt_or_not_at_all(ahead):
    """Braked in the middle of a 15 G cycle it must not jump back into it."""
    whole, queue = streamed(0.0, ahead)
    assert queue.interrupted == 0
    asked = np.abs(whole[:, 12:16]).max()
    for gap in (0.05, 0.08, 0.1, 0.15, 0.25, 0.4, 1.0, 1.37):
        for begin in (0.3, 1.0):
            followed, queue = streamed(gap, ahead, begin)
            assert queue.interrupted >= (begin != 1.0)
            assert np.abs(followed[:, 12:16]).max() < 1.1 * asked


def test_a_motion_that_ends_or_has_not_begun_needs_no_braking():
    end = ADEPT.duration
    assert not ways_to_rest(ADEPT, end - 0.02, 0.15, end)
    assert not ways_to_rest(ADEPT, end - 0.1, 0.15, end)
    t, q, qd, _ = braked(ADEPT, ADEPT.duration - 0.02)
    np.testing.assert_array_equal(q[-1], ADEPT.q[-1])
    assert t[-1] == ADEPT.t[-1]
    t, q, qd, _ = braked(ADEPT, -0.5)
    np.testing.assert_array_equal(q, ADEPT.q[:1])
    np.testing.assert_array_equal(qd, 0.0)


@pytest.mark.parametrize('turns', [1, 2])
def test_in_torque_mode_the_loops_hold_where_a_stream_ends(turns):
    """It ends where it turns, with no speed and a large torque that would drive the joints on."""
    truth, told = (read_model(name, REFERENCE) for name in ('table1_full', 'table1'))
    simulated = build_simulation(REFERENCE, truth, 'exact', 1e-3, law='torque',
                                 limits=ReferenceLimits(REFERENCE))
    home, rate = simulated.q, 2.0 * np.pi / 0.2
    t = np.arange(100 * turns + 1) * 1e-3
    q, qd, qdd = (-0.08 * part[:, None] * np.ones(4) for part in (
        1.0 - np.cos(rate * t), rate * np.sin(rate * t), rate ** 2 * np.cos(rate * t)))
    torque = told.torque_of_joints(REFERENCE.geometry, home + q, qd, qdd, t)
    assert np.abs(qd[-1]).max() < 1e-9
    assert np.abs(torque[-1]).min() > 10.0
    simulated.queue_reference(t + 0.2, home + q, qd, qdd)
    simulated.queue_effort(t + 0.2, torque)
    samples = simulated.next_samples(200 + 100 * turns + 2000)
    ended = slice(200 + 100 * turns, None)
    away = np.abs(samples.q[ended] - home - q[-1]).max(axis=1)
    assert away.max() < 0.05
    assert away[-1] < 1e-3
    steps = np.abs(np.diff(samples.effort[ended], axis=0))
    assert steps.max() < 5.0, 'the loops begin with the torque that was told last'
