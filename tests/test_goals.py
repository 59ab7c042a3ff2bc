"""Trajectories of other planners: the spline through them, and the action that takes them.

control_msgs is not on PyPI: its action type and the action server of rclpy are stood in for here.
All else is real: the node, its executor, and a simulation that follows.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest
import rclpy
from rclpy.action import CancelResponse, GoalResponse
from rclpy.signals import SignalHandlerOptions
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from node_bench import AWAY_Q, HOME_Q, ROBOT, Simulated, joint_state, joint_values
from par4_kinematics.errors import InputError
from par4_kinematics.motion import Motion
from par4_kinematics.motion_file import named_motion
from par4_kinematics.ros import goal_server, motion_node
from par4_kinematics.ros.convert import write_time
from par4_kinematics.ros.listeners import Listeners
from par4_kinematics.ros.motion_node import MotionNode, Played
from par4_kinematics.ros.silence import Silence
from par4_kinematics.splined import splined_motion
from par4_kinematics.stamps import SECOND
from par4_kinematics.standstill import Standstill

MIDDLE_Q = 0.5 * (HOME_Q + AWAY_Q) + np.array((0.03, -0.02, 0.01, 0.0))


def at(motion, time: float) -> int:
    return int(np.argmin(np.abs(motion.t - time)))


def test_positions_alone_become_a_spline_from_rest_to_rest():
    motion = splined_motion('path', ROBOT, HOME_Q, (0.4, 0.8), (MIDDLE_Q, AWAY_Q))
    for time, q in ((0.0, HOME_Q), (0.4, MIDDLE_Q), (0.8, AWAY_Q)):
        np.testing.assert_allclose(motion.q[at(motion, time)], q, atol=1e-9)
    for ends in (motion.qd, motion.qdd):
        np.testing.assert_allclose(ends[[0, -1]], 0.0, atol=1e-6)
    # velocities and accelerations are derivatives, and nothing jumps
    step = motion.period
    np.testing.assert_allclose((motion.q[2:] - motion.q[:-2]) / (2 * step), motion.qd[1:-1],
                               atol=1e-3)
    np.testing.assert_allclose((motion.qd[2:] - motion.qd[:-2]) / (2 * step), motion.qdd[1:-1],
                               atol=0.05)
    assert np.abs(np.diff(motion.qdd, axis=0)).max() < 0.02 * np.abs(motion.qdd).max()


def test_two_positions_are_the_quintic_of_least_jerk():
    motion = splined_motion('path', ROBOT, HOME_Q, (0.5,), (AWAY_Q,))
    u = motion.t / 0.5
    share = 10 * u ** 3 - 15 * u ** 4 + 6 * u ** 5
    np.testing.assert_allclose(motion.q, HOME_Q + np.outer(share, AWAY_Q - HOME_Q), atol=1e-9)


def test_velocities_and_accelerations_are_kept_where_they_are_given():
    speed, push = np.array((0.3, 0.1, -0.1, 0.2)), np.array((0.5, 0.0, 0.2, -0.5))
    q, qd, qdd = (np.vstack(rows) for rows in (
        (MIDDLE_Q, AWAY_Q), (speed, np.zeros(4)), (push, np.zeros(4))))
    for accelerations in (None, qdd):
        motion = splined_motion('path', ROBOT, HOME_Q, (0.4, 0.8), q, qd, accelerations)
        np.testing.assert_allclose(motion.qd[at(motion, 0.4)], speed, atol=1e-9)
    np.testing.assert_allclose(motion.qdd[at(motion, 0.4)], push, atol=1e-6)


@pytest.mark.parametrize(('points', 'said'), [
    (((0.0,), (AWAY_Q,)), 'rad from where the robot stands'),
    (((0.0,), (HOME_Q,)), 'a single point at 0 s'),
    (((0.4, 0.4), (MIDDLE_Q, AWAY_Q)), 'must be 0 or more and increase'),
    (((-1.0, 0.4), (MIDDLE_Q, AWAY_Q)), 'must be 0 or more and increase'),
    (((0.4,), (AWAY_Q,), np.ones((1, 4))), 'it ends in motion'),
    (((0.0, 0.4), (HOME_Q, AWAY_Q), np.array((np.ones(4), np.zeros(4)))), 'it begins in motion'),
    (((0.4,), (AWAY_Q,), None, np.zeros((1, 4))), 'accelerations without velocities'),
    (((0.4,), (np.full(4, 1.7),)), 'z of D'),
    (((0.02,), (AWAY_Q,)), 'joint speed'),
])
def test_what_no_robot_should_follow_is_refused(points, said):
    with pytest.raises(InputError, match=said):
        splined_motion('path', ROBOT, HOME_Q, *points)


# ------------------------------------------------------------------------------------- the action


def point() -> SimpleNamespace:
    return SimpleNamespace(time_from_start=SimpleNamespace(sec=0, nanosec=0))


class Feedback:
    """As control_msgs has it, as far as the node fills it."""

    def __init__(self) -> None:
        self.header = SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0))
        self.desired, self.actual, self.error = point(), point(), point()


class Server:
    """The callbacks of an action server, called as rclpy calls them."""

    def __init__(self, node: Any, _type: Any, name: str, execute_callback: Any,
                 goal_callback: Any, cancel_callback: Any) -> None:
        self.node, self.name = node, name
        self.judge, self.cancel, self._execute = goal_callback, cancel_callback, execute_callback

    def send(self, goal: Any) -> Handle | None:
        """Return the handle of a goal that is executed, None if it is rejected."""
        if self.judge(goal) == GoalResponse.REJECT:
            return None
        handle = Handle()
        handle.task = self.node.executor.create_task(self._execute(handle))
        return handle


class Handle:
    """Of a goal: what the server told of it."""

    def __init__(self) -> None:
        self.feedback: list[Feedback] = []
        self.is_cancel_requested = False
        self.end = ''

    def publish_feedback(self, feedback: Feedback) -> None:
        """Keep it."""
        self.feedback.append(feedback)

    def succeed(self) -> None:
        """Keep that it did."""
        self.end = 'succeeded'

    def abort(self) -> None:
        """Keep that it was aborted."""
        self.end = 'aborted'

    def canceled(self) -> None:
        """Keep that it was canceled."""
        self.end = 'canceled'


def goal(*points: np.ndarray, seconds: float = 0.4, path: float = 0.0, last: float = 0.0) -> Any:
    message = JointTrajectory(joint_names=list(ROBOT.joint_names))
    for number, q in enumerate(points, 1):
        item = JointTrajectoryPoint(positions=q.tolist())
        write_time(item.time_from_start, round(number * seconds * SECOND))
        message.points.append(item)

    def bounds(size: float) -> list:
        return [SimpleNamespace(name=name, position=size) for name in ROBOT.joint_names]

    return SimpleNamespace(trajectory=message, path_tolerance=bounds(path),
                           goal_tolerance=bounds(last),
                           goal_time_tolerance=SimpleNamespace(sec=0, nanosec=200_000_000))


def stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand in for the type of the action and its server."""
    module = ModuleType('control_msgs.action')
    module.FollowJointTrajectory = SimpleNamespace(
        Result=lambda **fields: SimpleNamespace(**fields), Feedback=Feedback)
    monkeypatch.setitem(sys.modules, 'control_msgs', ModuleType('control_msgs'))
    monkeypatch.setitem(sys.modules, 'control_msgs.action', module)
    monkeypatch.setattr(goal_server, 'ActionServer', Server)


@pytest.fixture
def server(bench, monkeypatch) -> Iterator[Server]:
    """Yield the action of a `par4_motion` that runs in this process beside a simulation."""
    stand_in(monkeypatch)
    rclpy.init(args=['--ros-args', '-p', 'motion:=action', '-p', 'use_sim_time:=true'],
               domain_id=bench.domain, signal_handler_options=SignalHandlerOptions.NO)
    node = MotionNode()
    thread = threading.Thread(target=node.work)
    thread.start()
    try:
        yield node._goals._server
    finally:
        node.end()
        thread.join(20.0)
        node.finished = True
        thread.join(20.0)
        node.destroy_node()
        rclpy.try_shutdown()
        assert not thread.is_alive()


def test_goals_are_followed_cancelled_and_held_to_their_tolerances(bench, server):
    assert server.name == '~/follow_joint_trajectory'
    assert server.send(goal(AWAY_Q)) is None, 'it is not known where the robot stands'
    simulated = Simulated(bench)
    bench.wait(lambda: server.node._robot_at is not None and server.node.now_ns() > 0, 'a robot')
    simulated.pause()
    first = server.send(goal(MIDDLE_Q, AWAY_Q, path=0.3, last=0.02))
    assert server.send(goal(AWAY_Q)) is None, 'one at a time'
    bench.wait(lambda: len(first.feedback) > 3, 'feedback of the first goal')
    simulated.resume()
    bench.wait(first.task.done, 'the end of the first goal')
    result = first.task.result()
    assert (first.end, result.error_code) == ('succeeded', 0), result
    simulated.current_ns()
    np.testing.assert_allclose(joint_values(simulated.states[-1], 'position'), AWAY_Q, atol=0.01)

    cancelled = server.send(goal(HOME_Q, seconds=8.0))
    bench.wait(lambda: np.abs(
        joint_values(simulated.states[-1], 'position') - AWAY_Q).max() > 0.03, 'a motion')
    simulated.pause()
    stands = joint_values(simulated.states[-1], 'position')
    bench.wait(lambda: cancelled.feedback and np.array_equal(
        cancelled.feedback[-1].actual.positions, stands), 'feedback of where it stands')
    told = cancelled.feedback[-1]
    error = np.subtract(told.desired.positions, told.actual.positions)
    np.testing.assert_array_equal(told.error.positions, error)
    assert 0.0 < np.abs(error).max() < 0.3, 'the loops alone lag, but follow'
    simulated.resume()
    cancelled.is_cancel_requested = True
    assert server.cancel(cancelled) == CancelResponse.ACCEPT
    bench.wait(cancelled.task.done, 'the end of the cancelled goal')
    assert cancelled.end == 'canceled'
    simulated.wait_until(simulated.current_ns() + SECOND)
    rest = joint_values(simulated.states[-1], 'position')
    assert np.abs(joint_values(simulated.states[-1], 'velocity')).max() < 0.05
    assert np.abs(rest - HOME_Q).max() > 0.03, 'it was stopped on its way'

    strict = server.send(goal(HOME_Q, seconds=1.0, path=1e-5))
    bench.wait(strict.task.done, 'the end of the strict goal')
    result = strict.task.result()
    assert (strict.end, result.error_code) == ('aborted', -4)
    assert 'rad from its path' in result.error_string

    unknown = goal(HOME_Q)
    unknown.trajectory.joint_names = ['a', 'b', 'c', 'd']
    dated = goal(HOME_Q)
    write_time(dated.trajectory.header.stamp, SECOND)
    assert [server.send(item) for item in (unknown, dated, goal(np.full(4, 1.7)))] == [None] * 3

    last = server.send(goal(HOME_Q, seconds=8.0))
    bench.wait(lambda: len(last.feedback) > 3, 'feedback of the last goal')
    server.node.end()
    bench.wait(last.task.done, 'the end of the goal of a node that ends')
    assert (last.end, last.task.result().error_code) == ('aborted', -1)


def played(motion: Motion) -> Played:
    """Return a motion that starts at 1 s and of which a second has been sent."""
    return Played(motion, SECOND, SECOND + np.rint(motion.t * SECOND).astype(np.int64),
                  (motion.q, motion.qd, motion.qdd), sent=min(1000, len(motion.t)))


@pytest.fixture
def following(monkeypatch) -> SimpleNamespace:
    """Return the state of a `par4_motion` that follows a goal; the test calls its callbacks."""
    stand_in(monkeypatch)
    node = SimpleNamespace(
        _robot_at=HOME_Q, _stamp_ns=0, _standstill=None, _braking=False, stopped=0,
        _arrivals={'joint_states': SimpleNamespace(age=0.1)}, get_logger=mock.Mock(),
        _await_next=lambda: None, _silence=Silence(), _standing=None, _astray=None,
        _before=Standstill(), _stop_asked=False,
        _fault=None, now_ns=lambda: 0)
    for name in ('_over', '_fail', '_abort', '_hold_to_reference', '_look_for_silence'):
        setattr(node, name, partial(getattr(MotionNode, name), node))

    def stop() -> None:
        node.stopped += 1

    goals = node._goals = goal_server.GoalServer(node, ROBOT, lambda: node._robot_at,
                                                 lambda _: None, stop)
    assert goals._judge(goal(AWAY_Q, path=0.05, last=0.02)) == GoalResponse.ACCEPT
    goals._execute(Handle()).send(None)
    node._played = played(goals._motion)
    return node


def test_one_joint_state_beyond_the_path_is_enough_however_soon_a_better_one_comes(following):
    for q in (HOME_Q, HOME_Q + 0.04):
        MotionNode._on_joint_state(following, joint_state(q, SECOND))
    assert following.stopped == 0
    for q in (HOME_Q - 0.06, HOME_Q):
        MotionNode._on_joint_state(following, joint_state(q, SECOND))
    assert following.stopped == 1
    assert following._goals._broken.code == goal_server.PATH_BROKEN


def test_the_end_of_a_goal_is_judged_by_what_the_robot_tells_of_it(following):
    """Not by where it was told to be when the clock reached that time."""
    following._goals._path = np.full(4, np.inf)
    end_ns, ended = int(following._played.times_ns[-1]), following._goals._ended
    for q, stamp_ns in ((HOME_Q, end_ns - SECOND // 10), (AWAY_Q - 0.01, end_ns)):
        MotionNode._on_joint_state(following, joint_state(q, stamp_ns))
        MotionNode._look_for_end(following, following._played)
        assert not ended.done()
    MotionNode._on_joint_state(following, joint_state(AWAY_Q, end_ns + 1))
    MotionNode._look_for_end(following, following._played)
    assert ended.result().end == 'succeed'


@pytest.mark.parametrize(('asked', 'missed', 'end'), [
    (None, 0.11, 'abort'), (None, 0.09, 'succeed'), (0.0, 0.11, 'abort'), (0.0, 0.09, 'succeed'),
    (-1.0, 1.0, 'succeed'), (0.5, 0.4, 'succeed'), (0.5, 0.6, 'abort')])
def test_a_goal_without_a_tolerance_has_the_one_of_every_motion(following, asked, missed, end):
    message = goal(AWAY_Q, last=asked or 0.0)
    if asked is None:
        message.goal_tolerance = []
    following._goals._motion = None
    assert following._goals._judge(message) == GoalResponse.ACCEPT
    following._robot_at = AWAY_Q - (0.0, 0.0, missed, 0.0)
    assert following._goals.over(SECOND, stopped=False)
    outcome = following._goals._ended.result()
    assert outcome.end == end
    assert outcome.code == (goal_server.SUCCESSFUL if end == 'succeed' else goal_server.GOAL_MISSED)


def test_a_goal_that_still_waits_for_listeners_can_be_stopped(following):
    following._played, following._motion = None, following._goals._motion
    following._stop_asked, following._missing = False, lambda _: 'subscribers of reference'
    following.wall_clock = None
    following.get_clock = lambda: SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=SECOND))
    MotionNode._tick(following)
    assert not following._goals._ended.done()
    following._stop_asked = True
    MotionNode._tick(following)
    assert following._goals._ended.result().end == 'abort'


def test_a_goal_cancelled_before_it_is_executed_is_stopped(following):
    following._goals._ended = None
    handle = Handle()
    handle.is_cancel_requested = True
    following._goals._execute(handle).send(None)
    assert following.stopped == 1


def test_a_goal_of_a_robot_that_tells_no_more_is_aborted(following):
    following._arrivals['joint_states'].age = 10.0
    MotionNode._look_for_end(following, following._played)
    assert following._goals._ended.result().end == 'abort'
    assert 'joint_states came, but no more' in following._goals._ended.result().words


def test_a_goal_of_a_robot_that_falls_silent_on_its_way_is_aborted_with_the_same_words(
        following, monkeypatch):
    """Also one that stands short of its goal while there is time left to reach it."""
    times = SimpleNamespace(wall=0.0, ns=int(following._played.times_ns[-1]) + 1)
    monkeypatch.setattr(motion_node, 'time', SimpleNamespace(monotonic=lambda: times.wall))
    following.get_clock = lambda: SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=times.ns))
    following.resolve_topic_name = '/cell/{}'.format
    following._brake = lambda *_: setattr(following, '_standstill', object())
    following._look_for_rest = lambda *_: following._over(0)
    following._robot_is_there, following._ahead_ns = lambda: True, 0
    following._feed_back = lambda *_: None
    following._look_for_end = partial(MotionNode._look_for_end, following)
    following._goals._path = np.full(4, np.inf)
    MotionNode._on_joint_state(following, joint_state(AWAY_Q - 0.05, times.ns))
    for _ in range(60):
        assert not following._goals._ended.done() or times.wall > 0.9
        times.wall, times.ns = times.wall + 0.02, times.ns + SECOND // 50
        MotionNode._tick(following)
    outcome = following._goals._ended.result()
    assert outcome.end == 'abort'
    assert 'no new joint state of the robot has come on /cell/joint_states' in outcome.words


def test_a_goal_of_a_robot_without_stamps_is_judged_by_when_its_joint_states_come(following):
    end_ns, ended = int(following._played.times_ns[-1]), following._goals._ended
    for q, now_ns in ((HOME_Q, SECOND), (AWAY_Q, end_ns)):
        following.now_ns = lambda now_ns=now_ns: now_ns
        MotionNode._on_joint_state(following, joint_state(q, 0))
        assert following.stopped == 0, 'held to where it should be at that time'
        MotionNode._look_for_end(following, following._played)
        assert not ended.done()
    following.now_ns = lambda: end_ns + 1
    MotionNode._on_joint_state(following, joint_state(AWAY_Q, 0))
    MotionNode._look_for_end(following, following._played)
    assert ended.result().end == 'succeed'


def test_rest_is_looked_for_until_the_robot_has_told_of_the_time_after_it():
    """What it says comes late to a busy node, whose clock goes on."""
    over, said = [], mock.Mock()
    node = SimpleNamespace(
        _rests_between_ns=(SECOND, 2 * SECOND), _stamp_ns=SECOND, _patient_until=np.inf,
        _publisher=SimpleNamespace(get_subscription_count=lambda: 1),
        get_logger=lambda: said, _over=over.append)
    moves = SimpleNamespace(reached=lambda _: False)
    look = partial(MotionNode._look_for_rest, node, None, standstill=moves)
    look(now_ns=9 * SECOND)
    assert not over
    node._stamp_ns = 2 * SECOND + 1
    look(now_ns=9 * SECOND)
    node._stamp_ns, node._patient_until = SECOND, 0.0
    look(now_ns=9 * SECOND)
    look(now_ns=SECOND)
    assert len(over) == 3
    told = [call.args[0] for call in said.error.call_args_list]
    expected = 'not seen to come to rest', 'no joint_states tell', 'clock stands'
    assert all(words in text for text, words in zip(told, expected, strict=True))


def test_a_motion_that_began_while_the_clock_stood_can_be_braked():
    node = SimpleNamespace(
        _pace=0.0, _goals=object(), get_logger=mock.Mock(), _fault=None,
        _send_chunk=lambda sent: setattr(sent, 'sent', len(sent.times_ns)))
    MotionNode._brake(node, played(named_motion('excitation', ROBOT, 5.0)), SECOND)
    assert np.isfinite(node._patient_until)


def test_a_clock_is_told_to_be_missing_once_it_had_time_to_be_found():
    node = SimpleNamespace(_motion=object(), clocks=lambda: 0, _listeners=Listeners(1, np.inf))
    assert MotionNode._missing(node, 0) == '/clock'
    node._listeners.found_at = 0.0
    assert 'nobody publishes' in MotionNode._missing(node, 0)


def test_without_control_msgs_the_action_is_refused_in_one_line():
    with pytest.raises(InputError, match='control_msgs is not installed'):
        goal_server.action_type()
