"""Messages to arrays and back, on live, bag and fake messages."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import PoseStamped
from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from par4_kinematics.errors import InputError
from par4_kinematics.interface import (
    BASE_FRAME,
    CLOCK,
    FEEDFORWARD_TORQUE,
    REFERENCE,
    START_DELAY,
    TOPICS,
)
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.convert import (
    Trajectory,
    joint_values,
    read_trajectory,
    time_ns,
    write_joint_state,
    write_pose,
    write_time,
    write_trajectory,
)
from par4_kinematics.ros.qos import message_type, qos_of
from par4_kinematics.ros.serialised_trajectory import SerialisedTrajectory
from par4_kinematics.stamps import SECOND
from par4_sim.ros.zero_stamp import ZeroStamps

STAMP = 1_700_000_000_123_456_789
ORDERS = (JOINT_NAMES, JOINT_NAMES[::-1], ('passive', *JOINT_NAMES[2:], *JOINT_NAMES[:2], 'tool'))


def live_joint_state(names, **arrays) -> JointState:
    message = JointState(name=list(names))
    for field, values in arrays.items():
        setattr(message, field, list(values))
    return message


def bag_joint_state(names, **arrays) -> object:
    types = get_typestore(Stores.ROS2_JAZZY).types
    empty = {field: np.empty(0) for field in ('position', 'velocity', 'effort')}
    filled = {field: np.asarray(values, float) for field, values in arrays.items()}
    header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), '')
    return types['sensor_msgs/msg/JointState'](header, list(names), **(empty | filled))


def fake_joint_state(names, **arrays) -> SimpleNamespace:
    return SimpleNamespace(name=tuple(names), **arrays)


def named(names, q) -> list[float]:
    """Return q in the order of `names`, other joints -99."""
    values = dict(zip(JOINT_NAMES, q, strict=True))
    return [values.get(name, -99.0) for name in names]


def random_trajectory(seed: int, points: int = 7) -> Trajectory:
    random = np.random.default_rng(seed)
    times = np.cumsum(random.integers(1, 10 ** 9, points))
    return Trajectory(STAMP, times, *random.normal(size=(4, points, 4)))


def message_of(trajectory: Trajectory, names=JOINT_NAMES) -> JointTrajectory:
    """Return the message of a trajectory with its joints in another order."""
    message = JointTrajectory()
    write_trajectory(message, JointTrajectoryPoint, trajectory)
    for point in message.points:
        for field in ('positions', 'velocities', 'accelerations', 'effort'):
            if len(getattr(point, field)):
                setattr(point, field, named(names, getattr(point, field)))
    message.joint_names = list(names)
    return message


@pytest.mark.parametrize('kind', [Time, Duration])
@pytest.mark.parametrize('nanoseconds', [0, 1, 999_999_999, SECOND, STAMP])
def test_times_are_exact(kind, nanoseconds):
    stamp = kind()
    write_time(stamp, nanoseconds)
    assert time_ns(stamp) == nanoseconds


@pytest.mark.parametrize('make', [live_joint_state, bag_joint_state, fake_joint_state])
@pytest.mark.parametrize('names', ORDERS)
@pytest.mark.parametrize('field', ['position', 'velocity', 'effort'])
def test_joints_are_found_by_name(make, names, field):
    q = np.random.default_rng(1).normal(size=4)
    message = make(names, **{field: named(names, q)})
    np.testing.assert_array_equal(joint_values(message, field), q)


@pytest.mark.parametrize(('names', 'position', 'found'), [
    (JOINT_NAMES[:3], [0.0] * 3, r'missing joint arm_joint_3; found arm_joint_0'),
    ((), [], r'found none; send all of arm_joint_0'),
    ((*JOINT_NAMES, 'arm_joint_1'), [0.0] * 5, r'joint arm_joint_1 is named twice'),
    (JOINT_NAMES, [0.0] * 3, r'position: 3 values for 4 joint names'),
    (JOINT_NAMES, [], r'position: 0 values'),
    (JOINT_NAMES, [0.0, 0.0, np.nan, 0.0], r'position: arm_joint_2 has nan'),
    (JOINT_NAMES[::-1], [np.inf, 0.0, 0.0, 0.0], r'position: arm_joint_3 has inf'),
])
@pytest.mark.parametrize('make', [live_joint_state, bag_joint_state, fake_joint_state])
def test_bad_joint_states_are_refused_in_one_line(make, names, position, found):
    with pytest.raises(InputError, match=found) as refused:
        joint_values(make(names, position=position), 'position')
    assert '\n' not in str(refused.value)


def test_a_joint_that_nobody_asked_for_may_be_nan():
    message = fake_joint_state((*JOINT_NAMES, 'passive'), position=[1.0, 2.0, 3.0, 4.0, np.nan])
    np.testing.assert_array_equal(joint_values(message, 'position'), (1.0, 2.0, 3.0, 4.0))


def test_a_written_joint_state_reads_back_and_keeps_what_was_not_given():
    message = live_joint_state(JOINT_NAMES, velocity=(5.0, 6.0, 7.0, 8.0))
    q, effort = np.random.default_rng(2).normal(size=(2, 4))
    write_joint_state(message, STAMP, position=q, effort=effort)
    assert time_ns(message.header.stamp) == STAMP
    np.testing.assert_array_equal(joint_values(message, 'position'), q)
    np.testing.assert_array_equal(joint_values(message, 'velocity'), (5.0, 6.0, 7.0, 8.0))
    np.testing.assert_array_equal(joint_values(message, 'effort'), effort)


@pytest.mark.parametrize('names', ORDERS)
def test_a_trajectory_reads_back_whatever_the_order_of_its_joints(names):
    sent = random_trajectory(3)
    fields = ('positions', 'velocities', 'accelerations', 'effort')
    received = read_trajectory(message_of(sent, names), fields)
    assert received.stamp_ns == STAMP
    for part in ('from_start_ns', 'q', 'qd', 'qdd', 'effort'):
        np.testing.assert_array_equal(getattr(received, part), getattr(sent, part))


def test_only_the_fields_asked_for_are_needed():
    sent = random_trajectory(4)
    torque_alone = message_of(Trajectory(0, sent.from_start_ns, effort=sent.effort))
    received = read_trajectory(torque_alone, ('effort',))
    np.testing.assert_array_equal(received.effort, sent.effort)
    assert received.q is None
    with pytest.raises(InputError, match='positions of point 0: 0 values for 4 joint names'):
        read_trajectory(torque_alone)


def test_times_are_stamp_plus_time_from_start():
    trajectory = Trajectory(STAMP, np.array([0, 1_500_000, SECOND]))
    np.testing.assert_allclose(trajectory.times(10 * SECOND), (10.0, 10.0015, 11.0), rtol=1e-15)


def test_bad_trajectories_are_refused():
    sent = random_trajectory(5)
    with pytest.raises(InputError, match='no points'):
        read_trajectory(JointTrajectory(joint_names=list(JOINT_NAMES)))
    bad = sent.qd.copy()
    bad[4, 1] = np.nan
    with pytest.raises(InputError, match='velocities of point 4: arm_joint_1 has nan'):
        read_trajectory(message_of(Trajectory(0, sent.from_start_ns, sent.q, bad, sent.qdd)))
    with pytest.raises(InputError, match='missing joint arm_joint_0'):
        read_trajectory(message_of(sent, JOINT_NAMES[1:]))
    for times, point in ((sent.from_start_ns[::-1], 1), (np.array([0, 5, 5, 6, 7, 8, 9]), 2)):
        with pytest.raises(InputError, match=f'time_from_start of point {point} is not later'):
            read_trajectory(message_of(Trajectory(0, times, sent.q, sent.qd, sent.qdd)))


@pytest.mark.parametrize('names', ORDERS)
def test_effort_goes_to_its_joints_and_leaves_the_rest_as_it_was(names):
    sent = random_trajectory(6)
    message = message_of(Trajectory(STAMP, sent.from_start_ns, sent.q, sent.qd, sent.qdd), names)
    message = deserialize_message(
        SerialisedTrajectory(serialize_message(message)).with_effort(sent.effort), JointTrajectory)
    received = read_trajectory(message, ('positions', 'effort'))
    np.testing.assert_array_equal(received.effort, sent.effort)
    np.testing.assert_array_equal(received.q, sent.q)
    assert (received.stamp_ns, list(message.joint_names)) == (STAMP, list(names))
    others = [column for column, name in enumerate(names) if name not in JOINT_NAMES]
    assert not np.array([point.effort for point in message.points])[:, others].any()


@pytest.mark.parametrize('theta', [0.0, 0.3, -0.7])
def test_a_pose_turns_by_the_tool_angle(theta):
    message = PoseStamped()
    write_pose(message, STAMP, np.array((0.1, -0.2, -0.8, theta)), 4.0)
    position, turn = message.pose.position, message.pose.orientation
    assert (position.x, position.y, position.z) == (0.1, -0.2, -0.8)
    assert (time_ns(message.header.stamp), message.header.frame_id) == (STAMP, BASE_FRAME)
    # x axis of the turned frame: (1 - 2 z^2, 2 w z) of a turn about z
    assert turn.x == turn.y == 0.0
    np.testing.assert_allclose(
        (1.0 - 2.0 * turn.z ** 2, 2.0 * turn.w * turn.z),
        (np.cos(4.0 * theta), np.sin(4.0 * theta)), atol=1e-15)


@pytest.mark.parametrize('topic', TOPICS, ids=lambda topic: topic.name)
def test_quality_of_service_is_that_of_the_contract(topic):
    qos = qos_of(topic)
    assert qos.history == HistoryPolicy.KEEP_LAST
    if topic is CLOCK:
        assert (qos.reliability, qos.depth) == (ReliabilityPolicy.BEST_EFFORT, 1)
        return
    assert qos.reliability == ReliabilityPolicy.RELIABLE
    latched = topic.name == 'robot_description'
    assert qos.depth == (1 if latched else 1000)
    assert qos.durability == (DurabilityPolicy.TRANSIENT_LOCAL if latched
                              else DurabilityPolicy.VOLATILE)


@pytest.mark.parametrize('topic', TOPICS, ids=lambda topic: topic.name)
def test_message_types_exist(topic):
    kind = message_type(topic)
    assert f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}' == topic.type


class TestZeroStamps:
    NOW = 5 * SECOND
    START = NOW + round(START_DELAY * SECOND)
    LATER = NOW + 50_000_000

    @staticmethod
    def points(stamp_ns: int = 0, count: int = 100, q: float | None = None) -> Trajectory:
        return Trajectory(stamp_ns, np.arange(count) * 1_000_000,
                          None if q is None else np.full((count, 4), q))

    def test_a_stamp_rules(self):
        assert ZeroStamps().start_ns(REFERENCE, self.points(STAMP), self.NOW) == STAMP

    @pytest.mark.parametrize('order', [(REFERENCE, FEEDFORWARD_TORQUE),
                                       (FEEDFORWARD_TORQUE, REFERENCE)])
    def test_reference_and_torque_start_together(self, order):
        stamps = ZeroStamps()
        assert stamps.start_ns(order[0], self.points(), self.NOW) == self.START
        assert stamps.start_ns(order[1], self.points(), self.LATER) == self.START

    def test_a_second_reference_starts_on_its_own_and_torques_follow_in_order(self):
        stamps = ZeroStamps()
        first = stamps.start_ns(REFERENCE, self.points(), self.NOW)
        second = stamps.start_ns(REFERENCE, self.points(), self.LATER)
        assert second == first + self.LATER - self.NOW
        assert [stamps.start_ns(FEEDFORWARD_TORQUE, self.points(), self.LATER)
                for _ in range(2)] == [first, second]

    def test_torques_find_their_references_out_of_order_whatever_waits_before(self):
        stamps = ZeroStamps()
        long = stamps.start_ns(REFERENCE, self.points(count=200), self.NOW)
        short = stamps.start_ns(REFERENCE, self.points(), self.LATER)
        assert stamps.start_ns(FEEDFORWARD_TORQUE, self.points(), self.LATER) == short
        assert stamps.start_ns(FEEDFORWARD_TORQUE, self.points(count=200), self.LATER) == long

    @pytest.mark.parametrize('refused', [REFERENCE, FEEDFORWARD_TORQUE],
                             ids=lambda topic: topic.name)
    @pytest.mark.parametrize('order', [(REFERENCE, FEEDFORWARD_TORQUE),
                                       (FEEDFORWARD_TORQUE, REFERENCE)])
    def test_what_waits_for_a_refused_counterpart_takes_none_of_the_next(self, refused, order):
        """Of the same times, at other positions."""
        stamps = ZeroStamps()
        left, = {REFERENCE, FEEDFORWARD_TORQUE} - {refused}
        first = stamps.start_ns(left, self.points(q=0.1), self.NOW)
        for number in range(3):
            now_ns = self.NOW + (number + 1) * 10_000_000
            starts = [stamps.start_ns(topic, self.points(q=0.2 + number), now_ns)
                      for topic in order]
            assert starts == [now_ns + round(START_DELAY * SECOND)] * 2
        assert stamps.start_ns(refused, self.points(q=0.1), self.LATER) == first

    def test_a_torque_without_positions_belongs_to_the_first_reference_of_its_times(self):
        stamps = ZeroStamps()
        first, second = (stamps.start_ns(REFERENCE, self.points(q=q), now_ns)
                         for q, now_ns in ((0.1, self.NOW), (0.2, self.LATER)))
        assert [stamps.start_ns(FEEDFORWARD_TORQUE, self.points(), self.LATER)
                for _ in range(2)] == [first, second]

    def test_another_content_is_another_trajectory(self):
        stamps = ZeroStamps()
        stamps.start_ns(REFERENCE, self.points(), self.NOW)
        other = stamps.start_ns(FEEDFORWARD_TORQUE, self.points(count=50), self.LATER)
        assert other == self.LATER + round(START_DELAY * SECOND)

    def test_a_reference_that_is_over_waits_no_longer_for_its_torque(self):
        stamps = ZeroStamps()
        stamps.start_ns(REFERENCE, self.points(), self.NOW)
        much_later = self.NOW + 10 * SECOND
        assert stamps.start_ns(FEEDFORWARD_TORQUE, self.points(), much_later) == (
            much_later + round(START_DELAY * SECOND))

    def test_a_reference_is_not_begun_in_the_middle_by_a_torque_whose_own_was_lost(self):
        stamps = ZeroStamps()
        stamps.start_ns(FEEDFORWARD_TORQUE, self.points(count=9000, q=0.1), self.NOW)
        for second in range(1, 4):
            now_ns = self.NOW + second * SECOND
            for topic in (REFERENCE, FEEDFORWARD_TORQUE):
                assert stamps.start_ns(topic, self.points(count=9000, q=0.1), now_ns) == (
                    now_ns + round(START_DELAY * SECOND))
