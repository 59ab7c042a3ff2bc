"""What `par4_motion` does where the robot falls silent, stops to follow, or tells no stamps.

The node is real; its clocks, the listener of its reference and the robot are stood in for, so that
time is what a test says it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from node_bench import AWAY_Q, HOME_Q, ROBOT, joint_state, quintic_motion
from par4_dynamics.model_from_file import read_model
from par4_kinematics.adept import adept_motion
from par4_kinematics.astray import LAG_NS, Astray
from par4_kinematics.interface import DIAGNOSTICS, JOINT_STATES
from par4_kinematics.motion import Motion
from par4_kinematics.motion_file import named_motion, write_motion
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros import motion_node
from par4_kinematics.ros.convert import read_trajectory
from par4_kinematics.ros.diagnostics import OK, WARN, NodeState
from par4_kinematics.ros.listeners import DISCOVERY, SETTLING, Listeners
from par4_kinematics.ros.motion_node import MotionNode
from par4_kinematics.ros.played import Played
from par4_kinematics.ros.silence import Silence
from par4_kinematics.stamps import SECOND
from par4_kinematics.standing import Standing
from par4_sim.tracking.run import feedforward_of, record_run

LOOK = 0.02
"""Seconds of wall time between two looks of the node, and two joint states."""


class Cell:
    """A `par4_motion`, a robot that follows its reference, and the time.

    Attributes:
        wall: time of the wall clock, s.
        now_ns: time of the node's clock, ns, which goes `pace` times as fast.
        follows: whether the robot does; else it stands.
        led: where another takes it, q as a function of the time, ns, which it then follows instead.
        tells: whether it publishes joint states.
        stamped: whether these have stamps.
        told: what the node logged.
    """

    def __init__(self, node: MotionNode, monkeypatch: pytest.MonkeyPatch) -> None:
        self.node = node
        self.wall, self.now_ns, self.pace = 1e9, SECOND, 1.0
        self.follows = self.tells = self.stamped = True
        self.led: Callable[[int], np.ndarray] | None = None
        self.q = HOME_Q
        self.told = mock.Mock()
        self._times, self._points = np.zeros(1), np.concatenate((HOME_Q, np.zeros(4)))[None]
        monkeypatch.setattr(motion_node, 'time', SimpleNamespace(monotonic=lambda: self.wall))
        monkeypatch.setattr(node, 'get_clock', lambda: SimpleNamespace(
            now=lambda: SimpleNamespace(nanoseconds=self.now_ns)))
        monkeypatch.setattr(node, 'get_logger', lambda: self.told)
        monkeypatch.setattr(node, '_listeners', Listeners(1, self.wall))
        monkeypatch.setattr(node, '_robot_is_there', lambda: True)
        monkeypatch.setattr(node, '_publisher', SimpleNamespace(
            publish=self._take, get_subscription_count=lambda: 1))

    def _take(self, message: Any) -> None:
        points = read_trajectory(message)
        times = points.times(points.stamp_ns)
        kept = self._times < times[0]
        self._times = np.concatenate((self._times[kept], times))
        self._points = np.concatenate((self._points[kept], np.hstack((points.q, points.qd))))

    @property
    def last(self) -> np.ndarray:
        """The last point of the reference: q and qd, (8,)."""
        return self._points[-1]

    def run(self, seconds: float) -> None:
        """Let so much wall time go by, or less if the node ends."""
        for _ in range(round(seconds / LOOK)):
            if self.node.finished:
                return
            self.wall += LOOK
            self.now_ns += round(self.pace * LOOK * SECOND)
            if self.led is not None:
                self.q = self.led(self.now_ns)
            elif self.follows:
                self.q = np.array([np.interp(self.now_ns / SECOND, self._times, column)
                                   for column in self._points[:, :4].T])
            if self.tells:
                self.node._on_joint_state(joint_state(self.q, self.now_ns if self.stamped else 0))
            self.node._tick()

    def run_to_the_middle(self) -> None:
        """Let time go by until the robot is on its way."""
        for _ in range(round(20.0 / LOOK)):
            if np.abs(self.q - HOME_Q).max() > 0.1:
                return
            self.run(LOOK)
        pytest.fail(f'the robot is not on its way; the node said: {self.warnings()}')

    def warnings(self) -> str:
        """Return what the node warned of."""
        return ' '.join(str(call.args[0]) for call in (*self.told.warning.call_args_list,
                                                       *self.told.error.call_args_list))


@pytest.fixture
def cell(bench, monkeypatch, tmp_path) -> Iterator[Cell]:
    """Yield a node that plays a motion of a second away from home."""
    write_motion(tmp_path / 'away.yaml', quintic_motion(AWAY_Q))
    rclpy.init(args=['--ros-args', '-p', f'motion:={tmp_path / "away.yaml"}'],
               domain_id=bench.domain, signal_handler_options=SignalHandlerOptions.NO)
    node = MotionNode()
    try:
        yield Cell(node, monkeypatch)
    finally:
        monkeypatch.undo()
        node.destroy_node()
        rclpy.try_shutdown()


@pytest.mark.parametrize('stamped', [True, False])
def test_a_motion_is_followed_to_its_end_with_stamps_and_without(cell, stamped):
    cell.stamped = stamped
    cell.run(8.0)
    assert cell.node.finished
    assert cell.node.failure is None
    assert cell.warnings() == ''
    np.testing.assert_allclose(cell.q, AWAY_Q, atol=1e-6)


def test_a_robot_that_falls_silent_is_braked_and_its_motion_is_aborted(cell):
    cell.run_to_the_middle()
    cell.tells = False
    cell.run(0.9)
    assert not cell.node._braking
    cell.run(0.2)
    assert cell.node._braking
    np.testing.assert_array_equal(cell.last[4:], 0.0)
    cell.run(20.0)
    assert cell.node.finished
    said = str(cell.node.failure)
    assert 'aborted: no new joint state of the robot has come on /joint_states for 0.9' in said
    assert 'see whether its driver runs' in said


@pytest.mark.parametrize('stamped', [True, False])
def test_to_a_silent_robot_nothing_is_sent_but_ways_to_rest(cell, stamped):
    cell.node._motion = named_motion('excitation', ROBOT, 20.0)
    cell.stamped = stamped
    cell.run_to_the_middle()
    cell.tells = False
    cell.run(1.2)
    sent_ns = cell.node._played.times_ns[-1]
    assert sent_ns < cell.now_ns + 2 * SECOND
    cell.run(20.0)
    assert cell.node.finished
    assert 'no new joint state' in str(cell.node.failure)
    assert cell._times[-1] * SECOND <= sent_ns + 1, 'nothing was sent after the ways to rest'


def test_stamps_that_stand_are_silence(cell):
    cell.run_to_the_middle()
    old = joint_state(cell.q, cell.now_ns)
    cell.tells = False
    for _ in range(100):
        cell.node._on_joint_state(old)
        cell.run(LOOK)
    assert cell.node._braking
    assert 'its stamps go on' in str(cell.node._fault)


def test_the_joints_of_a_gripper_do_not_stand_for_the_robot(cell):
    cell.run_to_the_middle()
    cell.tells = False
    for _ in range(100):
        cell.node._on_joint_state(JointState(name=['finger'], position=[0.0]))
        cell.run(LOOK)
    assert cell.node._braking


def test_a_paused_simulation_is_not_silent(cell):
    cell.run_to_the_middle()
    cell.tells, cell.pace = False, 0.0
    cell.run(30.0)
    cell.tells, cell.pace = True, 1.0
    cell.run(10.0)
    assert cell.node.finished
    assert cell.node.failure is None


def test_a_silent_robot_is_not_set_in_motion(cell):
    """Where it stood may not be where it stands."""
    cell.run(0.2)
    cell.tells = False
    cell.run(10.0)
    assert cell.node._played is None
    assert cell.node._waits_for == JOINT_STATES.name
    cell.tells = True
    cell.run(10.0)
    assert cell.node.finished
    assert cell.node.failure is None


def test_what_is_to_be_done_is_said_where_there_is_no_robot(cell, monkeypatch):
    monkeypatch.setattr(cell.node, '_robot_is_there', lambda: False)
    cell.tells = False
    cell.run(DISCOVERY + 2.0)
    assert cell.node._waits_for == (
        'joint_states, which nobody publishes: start the driver of the robot, or par4_simulation, '
        'with the same ROS_DOMAIN_ID and namespace')
    monkeypatch.setattr(cell.node, '_robot_is_there', lambda: True)
    cell.tells = True
    cell.run(10.0)
    assert cell.node.failure is None
    assert cell.node.finished


@pytest.mark.parametrize('stamped', [True, False])
def test_a_robot_that_trips_ends_the_motion_at_once(cell, stamped):
    cell.node._motion = named_motion('excitation', ROBOT, 20.0)
    cell.stamped = stamped
    cell.run_to_the_middle()
    cell.follows, tripped_ns = False, cell.now_ns
    cell.run(5.0)
    assert cell.node.finished
    assert cell.now_ns < tripped_ns + 4 * SECOND
    said = str(cell.node.failure)
    assert 'the robot did not follow: arm_joint_' in said
    assert '/diagnostics may say why' in said
    np.testing.assert_array_equal(cell.last[4:], 0.0)


def diagnostics(node: str, level: bytes, text: str = '') -> DiagnosticArray:
    return DiagnosticArray(status=[DiagnosticStatus(name=node, level=level, message=text)])


def publish_from(cell, monkeypatch, *gids: int) -> None:
    monkeypatch.setattr(cell.node, 'get_publishers_info_by_topic', lambda topic: {
        '/joint_states': [SimpleNamespace(node_name='robot', node_namespace='/',
                                          endpoint_gid=[gid]) for gid in gids]}[topic])


@pytest.fixture
def robot_node(cell, monkeypatch) -> str:
    """Return the name of the node that publishes joint states."""
    publish_from(cell, monkeypatch, 1)
    return '/robot'


def test_a_robot_that_stands_and_warns_of_something_is_quoted(cell, robot_node):
    """Points that come late stop a robot as a trip does; it says which of the two it was."""
    cell.node._motion = named_motion('excitation', ROBOT, 20.0)
    cell.run_to_the_middle()
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.WARN, '250 late_points'))
    cell.follows = False
    cell.run(5.0)
    said = str(cell.node.failure)
    assert 'stands, while its reference went' in said
    assert 'it says: 250 late_points' in said
    assert 'trip' not in said


@pytest.mark.parametrize(('level', 'quoted'), [(OK, ''), (WARN, 'reset')])
def test_of_a_node_its_state_is_quoted_without_what_it_counts(cell, robot_node, level, quoted):
    cell.node._diagnostics._publisher = mock.Mock()
    cell.node._tell(NodeState(level, 'reset', 'a remedy'), {'late_steps': 615})
    told = cell.node._diagnostics._publisher.publish.call_args.args[0]
    assert told.status[0].message == 'reset: a remedy; 615 late_steps'
    assert told.status[0].level == WARN
    told.status[0].name = robot_node
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.ERROR, 'hot'))
    cell.node._on_diagnostics(told)
    assert cell.node._trouble(DiagnosticStatus.WARN) == quoted


def test_diagnostics_of_several_nodes_are_not_taken_for_missed_ones(cell):
    """Each numbers its own; the second is far ahead of the first."""
    cell.node._diagnostics._publisher = mock.Mock()
    for number in (6, 68):
        cell.node._arrivals[DIAGNOSTICS.name].take(number)
    cell.node._arrivals[JOINT_STATES.name].take(1)
    cell.node.report()
    cell.node._arrivals[JOINT_STATES.name].take(4)
    cell.node.report()
    first, second = (call.args[0].status[0]
                     for call in cell.node._diagnostics._publisher.publish.call_args_list)
    assert 'missed_messages' not in first.message
    assert first.level == OK
    assert '2 missed_messages' in second.message


def test_a_robot_that_tells_of_a_trip_ends_the_motion_however_little_that_moves(cell, robot_node):
    cell.run_to_the_middle()
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.WARN, 'busy'))
    cell.node._on_diagnostics(diagnostics('/robot_of_others', DiagnosticStatus.ERROR, 'broken'))
    cell.run(LOOK)
    assert not cell.node._braking
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.ERROR, 'arm_joint_0 hot'))
    cell.run(LOOK)
    assert cell.node._braking
    np.testing.assert_array_equal(cell.last[4:], 0.0)
    cell.run(20.0)
    assert str(cell.node.failure) == ('away aborted: the robot did not follow, it says: '
                                      'arm_joint_0 hot; see to it, then play it anew')


def test_no_motion_begins_of_a_robot_that_tells_of_a_trip(cell, robot_node):
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.ERROR, 'call ~/reset'))
    cell.run(10.0)
    assert cell.node.finished
    assert cell.node._played is None
    assert 'not begun: the robot says: call ~/reset; see to it' in str(cell.node.failure)


def test_what_a_robot_told_is_over_once_it_is_started_anew(cell, robot_node, monkeypatch):
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.ERROR, 'ended: hot'))
    publish_from(cell, monkeypatch, 1, 2)  # the old one counts for a while
    assert cell.node._trouble() == 'ended: hot'
    publish_from(cell, monkeypatch, 2)
    assert cell.node._trouble() == ''
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.ERROR, 'hot again'))
    assert cell.node._trouble() == 'hot again'


def test_a_robot_that_told_before_it_was_found_is_heard(cell, robot_node, monkeypatch):
    publish_from(cell, monkeypatch)
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.ERROR, 'hot'))
    publish_from(cell, monkeypatch, 1)
    assert cell.node._trouble() == 'hot'


def test_what_a_robot_told_is_over_once_it_tells_something_else(cell, robot_node):
    for level in (DiagnosticStatus.ERROR, DiagnosticStatus.OK):
        cell.node._on_diagnostics(diagnostics(robot_node, level))
    cell.run(8.0)
    assert cell.node.finished
    assert cell.node.failure is None


def test_another_that_could_move_the_robot_is_warned_of(cell, monkeypatch):
    monkeypatch.setattr(cell.node, 'count_publishers', {'/reference': 2}.get)
    cell.run_to_the_middle()
    assert cell.warnings() == ('2 publish reference: the robot follows what comes last; let one '
                               'move it at a time')


def led_astray(cell: Cell, radians: float) -> None:
    """Let another move the robot once it is on its way, to and fro about home."""
    cell.node._motion = named_motion('excitation', ROBOT, 20.0)
    cell.run_to_the_middle()
    cell.led = lambda now_ns: HOME_Q + radians * np.sin(7.0 * now_ns / SECOND)


@pytest.mark.parametrize(('senders', 'why'), [
    (1, '/diagnostics may say why; see to the robot, then'),
    (2, '2 publish reference, so that another moves the robot, too; let one move it at a time')])
def test_a_robot_that_goes_another_way_ends_the_motion(cell, monkeypatch, senders, why):
    led_astray(cell, 0.2)
    monkeypatch.setattr(cell.node, '_senders', lambda: senders)
    astray_ns = cell.now_ns
    cell.run(5.0)
    assert cell.node.finished
    assert cell.now_ns < astray_ns + 4 * SECOND
    said = str(cell.node.failure)
    assert 'excitation aborted: the robot did not follow: arm_joint_' in said
    assert 'rad from its reference' in said
    assert why in said
    np.testing.assert_array_equal(cell.last[4:], 0.0)


def test_a_robot_that_warns_of_something_as_it_goes_another_way_is_quoted(cell, robot_node):
    led_astray(cell, 0.2)
    cell.node._on_diagnostics(diagnostics(robot_node, DiagnosticStatus.WARN, '9 late_points'))
    cell.run(5.0)
    assert 'from its reference; it says: 9 late_points; see' in str(cell.node.failure)


@pytest.mark.parametrize(('senders', 'moves', 'begins'), [
    (2, True, False), (1, True, True), (2, False, True)])
def test_no_motion_begins_while_another_moves_the_robot(cell, monkeypatch, senders, moves, begins):
    monkeypatch.setattr(cell.node, '_senders', lambda: senders)
    if moves:
        cell.led = lambda now_ns: HOME_Q + 0.05 * np.sin(3.0 * now_ns / SECOND)
    cell.run(DISCOVERY + 0.5)
    assert (cell.node._played is not None) == begins
    if not begins:
        assert str(cell.node.failure) == ('away not begun: 2 publish reference and the robot '
                                          'moves; let one move it at a time')


def test_a_robot_that_stands_elsewhere_at_the_end_did_not_follow(cell):
    """One that goes only part of the way does not stand."""
    cell.node._look_for_arrival(played_of(cell, AWAY_Q + (0.0, 0.2, 0.0, 0.0)), 0)
    assert 'arm_joint_1 stands 0.2 rad from its end' in str(cell.node.failure)


def played_of(cell: Cell, robot_at: np.ndarray) -> Played:
    """Return a motion that is over, where the robot stands there."""
    motion = quintic_motion(AWAY_Q)
    cell.node._robot_at, cell.node._stamp_ns = robot_at, cell.now_ns
    return Played(motion, 0, np.rint(motion.t * SECOND).astype(np.int64),
                  (motion.q, motion.qd, motion.qdd))


# ------------------------------------------------------------------------------------- its parts


def test_silence_is_what_both_clocks_say():
    def silence(*looks: tuple[float, float]) -> float:
        counted = Silence()
        for wall, now in looks:
            last = counted.look(wall, round(now * SECOND))
        return last

    ticks = np.arange(101) * LOOK  # two seconds
    assert silence((5.0, 5.0)) == 0.0
    assert silence(*zip(ticks, ticks, strict=True)) == pytest.approx(2.0)
    assert silence(*zip(ticks, 0.0 * ticks, strict=True)) == 0.0, 'paused'
    assert silence(*zip(ticks, 0.1 * ticks, strict=True)) == pytest.approx(0.2), 'slow'
    assert silence(*zip(ticks, 20.0 * ticks, strict=True)) == pytest.approx(2.0), 'fast'
    assert silence((0.0, 0.0), (9.0, 9.0)) <= 0.1, 'this process stood'
    resumed = *zip(ticks, 0.0 * ticks, strict=True), (2.02, 2.0)
    assert silence(*resumed) <= 0.1, 'a fast simulation that was paused until now'
    assert silence((0.0, 9.0), (0.02, 1.0)) == 0.0, 'the clock jumped back'
    counted = Silence()
    for tick in ticks:
        counted.look(tick, round(tick * SECOND))
    counted.heard()
    assert counted.look(3.0, 3 * SECOND) == 0.0


def stood(motion: Motion, q: np.ndarray) -> np.ndarray:
    """Return what `Standing` finds of joints at q (n, 4) that rested for a second before."""
    watch = Standing(q[0], motion.q[0], -SECOND)
    return np.array([watch.take(*row) for row in zip(
        q, motion.q, np.rint(motion.t * SECOND).astype(np.int64), strict=True)])


@pytest.mark.parametrize('name', ['adept', 'excitation'])
@pytest.mark.parametrize('lag', [0.0, 0.03, 0.1])
def test_joints_that_follow_late_do_not_stand(name, lag):
    motion = named_motion(name, ROBOT)
    assert stood(motion, np.array([np.interp(motion.t - lag, motion.t, column)
                                   for column in motion.q.T]).T).max() < 0.1


def test_joints_that_stand_are_found_also_where_the_reference_comes_and_goes():
    motion = adept_motion(ROBOT, cycles=8)
    assert motion.duration / 8 < 0.5
    assert stood(motion, np.tile(motion.q[0], (len(motion.t), 1))).max() > 0.1


def test_a_single_joint_that_stands_is_found():
    motion = named_motion('excitation', ROBOT, 5.0)
    middle = len(motion.t) // 2
    q = motion.q.copy()
    q[middle:, 2] = q[middle, 2]
    gone = stood(motion, q)
    assert gone[:middle].max() < 0.1
    assert gone[:, [0, 1, 3]].max() < 0.1
    first = np.flatnonzero(gone[:, 2] > 0.1)[0]
    assert 0.5 < motion.t[first] - motion.t[middle] < 1.0
    assert JOINT_NAMES[int(np.argmax(gone[first]))] == 'arm_joint_2'


def astray(motion: Motion, t: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return what `Astray` finds of joints at q (n, 4) at times t (n,), s, (n, 4)."""
    watch, played = Astray(0.1), Played(
        motion, 0, np.rint(motion.t * SECOND).astype(np.int64), (motion.q, motion.qd, motion.qdd))
    return np.array([watch.take(row, *played.asked_since(at_ns, LAG_NS), at_ns) for at_ns, row in
                     zip(np.rint(t * SECOND).astype(np.int64).tolist(), q, strict=True)])


@pytest.mark.parametrize('name', ['adept', 'excitation'])
@pytest.mark.parametrize('lag', [0.0, 0.03, 0.1])
def test_joints_that_follow_late_are_not_astray(name, lag):
    motion = named_motion(name, ROBOT)
    t = motion.t + lag
    assert astray(motion, t, motion.q).max() == 0.0
    assert astray(motion, t, motion.q + (0.0, 0.099, 0.0, -0.099)).max() == 0.0


@pytest.mark.parametrize(('name', 'law', 'share'), [
    ('adept', 'loops', 0.3), ('excitation', 'loops', 0.3), ('adept', 'torque', 0.8)])
def test_drives_that_follow_poorly_are_not_astray(name, law, share):
    """Loops without feedforward at a fraction of their gains; torques with an error of a fifth."""
    motion, known = named_motion(name, ROBOT), read_model('table1', ROBOT)
    drives, torque = ROBOT.drives, None
    if law == 'loops':
        drives = drives.model_copy(update={gain: share * getattr(drives, gain) for gain in (
            'position_gain', 'velocity_gain', 'integral_gain')})
    else:
        torque = share * feedforward_of(ROBOT, known, motion)
    run = record_run(ROBOT.model_copy(update={'drives': drives}), known, motion, torque, law=law)
    asked = np.array([np.interp(run.t, motion.t, column) for column in motion.q.T]).T
    assert np.abs(asked - run.q).max() > 0.1, 'nothing poor is looked at'
    assert astray(motion, run.t[::4], run.q[::4]).max() == 0.0


def test_joints_that_come_and_go_are_astray_once_they_do_not_come_back():
    watch, still = Astray(0.1), np.zeros(4)
    away = np.array([0.0, 0.0, -0.3, 0.0])
    for at_ns in range(0, SECOND, SECOND // 50):  # near every 0.48 s, as a drive that overshoots
        near = at_ns % (24 * SECOND // 50) == 0
        assert watch.take(still if near else away, still, still, at_ns).max() == 0.0
    assert watch.take(away, still, still, 9 * SECOND).max() == 0.3


def test_a_single_joint_state_after_many_were_lost_is_not_astray_for_long():
    watch, still = Astray(0.1), np.zeros(4)
    watch.take(still, still, still, 0)
    assert watch.take(still + 0.3, still, still, SECOND).max() == 0.0
    assert watch.take(still, still, still, 2 * SECOND).max() == 0.0


def test_what_was_asked_within_a_time_is_between_its_bounds():
    motion = quintic_motion(AWAY_Q)
    played = Played(motion, SECOND, SECOND + np.rint(motion.t * SECOND).astype(np.int64),
                    (motion.q, motion.qd, motion.qdd))
    for at in (-1.0, 0.05, 0.2003, motion.duration, 9.0):
        least, most = played.asked_since(SECOND + round(at * SECOND), LAG_NS)
        q = np.array([np.interp(np.linspace(at - 0.1, at, 200), motion.t, column)
                      for column in motion.q.T])
        np.testing.assert_allclose(least, q.min(axis=1), atol=2e-3)
        np.testing.assert_allclose(most, q.max(axis=1), atol=2e-3)
        assert (least <= q.min(axis=1)).all()
        assert (most >= q.max(axis=1)).all()


def test_what_is_asked_at_a_time_lies_between_its_points():
    motion = quintic_motion(AWAY_Q)
    played = Played(motion, SECOND, SECOND + np.rint(motion.t * SECOND).astype(np.int64),
                    (motion.q, motion.qd, motion.qdd))
    for at in (-1.0, 0.0, 0.1, 0.2003, motion.duration, 9.0):
        elapsed_ns, asked = played.asked(SECOND + round(at * SECOND))
        assert elapsed_ns == round(float(np.clip(at, 0.0, motion.duration)) * SECOND)
        for values, part in zip(asked, played.points, strict=True):
            np.testing.assert_allclose(values, [np.interp(at, motion.t, column)
                                                for column in part.T], atol=1e-6)
    rest = Played(motion, SECOND, np.array([SECOND]), (motion.q[:1],))
    assert rest.asked(7 * SECOND) == (0, (pytest.approx(motion.q[0]),))


def test_a_robot_that_falls_silent_over_topics_ends_the_node(bench):
    states = bench.node.create_publisher(JointState, JOINT_STATES.name, 10)
    sent: list = bench.listen(motion_node.REFERENCE)
    child = bench.start('par4_motion', motion='circle')
    bench.until_answered(lambda: states.publish(
        joint_state(HOME_Q, bench.node.get_clock().now().nanoseconds)), sent)
    assert bench.ended(child) == 2
    said = bench.said()
    assert 'no new joint state of the robot has come on /joint_states' in said
    assert 'Traceback' not in said
    bench.drain(sent)
    np.testing.assert_array_equal(read_trajectory(sent[-1]).qd[-1], 0.0)


def test_a_motion_waits_until_no_more_listeners_come():
    """The clock, which goes twice as fast as the wall's, is looked at as long as they are."""
    listeners = Listeners(2, 0.0)
    late = DISCOVERY + 1.0

    def missing(count: int, wall: float) -> str:
        return listeners.missing(count, wall, round(2 * wall * SECOND))

    for wall in (late, late + 0.9):
        assert missing(1, wall) == 'subscribers of reference, 1 of 2 are there'
    for count, wall in ((2, late + 1.0), (3, late + 1.4), (3, late + 1.4 + 0.9 * SETTLING)):
        assert missing(count, wall) == 'subscribers of reference'
    assert missing(3, late + 1.4 + SETTLING) == ''
    assert listeners.pace(late + 5.0, round(2 * (late + 5.0) * SECOND)) == pytest.approx(2.0)
    early = Listeners(1, 0.0)
    for wall in (0.1 * DISCOVERY, 0.1 * DISCOVERY + 2.0 * SETTLING):
        assert early.missing(1, wall, SECOND) == 'subscribers of reference'
    assert early.missing(1, DISCOVERY, SECOND) == ''
