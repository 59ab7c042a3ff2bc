"""Trajectories read from their bytes are those of the message, and so are the refusals."""

from __future__ import annotations

import tracemalloc
from contextlib import suppress

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from par4_kinematics.errors import InputError
from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.convert import (
    Trajectory,
    read_trajectory,
    write_trajectory,
)
from par4_kinematics.ros.serialised_trajectory import (
    SerialisedTrajectory,
    read_serialised_trajectory,
    serialised_rest,
)
from par4_kinematics.stamps import SECOND

FIELDS = ('positions', 'velocities', 'accelerations', 'effort')


def message(seed: int, count: int = 7) -> JointTrajectory:
    """Return a message with joints in any order, further ones among them."""
    random = np.random.default_rng(seed)
    built = JointTrajectory()
    write_trajectory(built, JointTrajectoryPoint, Trajectory(
        int(random.integers(0, 2 ** 31)) * SECOND + 5,
        np.cumsum(random.integers(1, 2 * SECOND, count)) - SECOND // 2))
    built.header.frame_id = 'base' * int(random.integers(0, 3))
    names = random.permutation((*JOINT_NAMES, *['tool', 'finger'][:random.integers(0, 3)]))
    built.joint_names = names.tolist()
    for point in built.points:
        for field in FIELDS:
            setattr(point, field, random.normal(size=len(names)).tolist())
    return built


def outcome(read, data, fields):
    """Return the numbers of a trajectory, or why it is refused."""
    try:
        told = read(data, fields)
    except InputError as error:
        return str(error)
    return [told.stamp_ns, told.from_start_ns.tolist(), *(
        None if part is None else part.tolist()
        for part in (told.q, told.qd, told.qdd, told.effort))]


def spoilt(built: JointTrajectory, how: int) -> JointTrajectory:
    """Return a message with one thing wrong."""
    if how == 1:
        built.points[3].velocities = built.points[3].velocities[:2]
    elif how == 2:
        built.points[2].effort[1] = np.nan
    elif how == 3:
        built.points[4].time_from_start = built.points[1].time_from_start
    elif how == 4:
        built.joint_names = ['other', *built.joint_names[1:]]
    elif how == 5:
        built.points = []
    elif how == 6:
        for point in built.points:
            point.effort = []
    return built


@pytest.mark.parametrize('how', range(7))
@pytest.mark.parametrize('fields', [FIELDS[:3], FIELDS[3:], FIELDS])
def test_bytes_say_what_the_message_says(how, fields):
    for seed in range(10):
        built = spoilt(message(seed), how)
        data = serialize_message(built)
        assert outcome(read_serialised_trajectory, data, fields) == outcome(
            read_trajectory, built, fields)


@pytest.mark.parametrize('how', [0, 1, 2, 6])
@pytest.mark.parametrize('count', [1, 2, 7])
def test_bytes_are_given_their_effort_as_the_message_is(how, count):
    """Whether it has one already, and wherever that leaves what stands behind."""
    for seed in range(10):
        built = message(seed, 7)
        spoilt(built, how).points = built.points[:count]
        effort = np.random.default_rng(seed).normal(size=(count, 4))
        given = SerialisedTrajectory(serialize_message(built)).with_effort(effort)
        columns = [list(built.joint_names).index(name) for name in JOINT_NAMES]
        for point, row in zip(built.points, effort, strict=True):
            point.effort = [0.0] * len(built.joint_names)
            for column, value in zip(columns, row, strict=True):
                point.effort[column] = value
        assert deserialize_message(given, JointTrajectory) == built
        np.testing.assert_array_equal(read_serialised_trajectory(given, FIELDS[3:]).effort, effort)


def test_a_message_is_copied_once():
    """A copy by Python holds the threads of the physics for milliseconds; the one here is numpy's.
    """
    point = JointTrajectoryPoint(positions=np.zeros(200_001))
    data = serialize_message(JointTrajectory(joint_names=['arm'], points=[point])) + bytes(4)
    assert len(data) % 8 == 0, 'behind its first four bytes it is to be filled up'
    SerialisedTrajectory(data)
    tracemalloc.start()
    try:
        SerialisedTrajectory(data)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 1.1 * len(data)


def test_a_reference_at_rest_rests_where_it_is_told_to():
    q = np.array((0.1, -0.2, 0.3, -0.4))
    told = read_serialised_trajectory(serialised_rest(q, 3))
    np.testing.assert_array_equal(told.q, np.tile(q, (3, 1)))
    assert not told.qd.any()
    assert not told.qdd.any()
    assert (np.diff(told.from_start_ns) > 0).all()


def test_bytes_that_are_no_trajectory_are_refused_in_one_line():
    random = np.random.default_rng(1)
    data = serialize_message(message(3))
    for size in range(len(data) - 8):
        with pytest.raises(InputError):
            read_serialised_trajectory(data[:size])
    for _ in range(2000):
        broken = bytearray(data)
        for place in random.integers(4, len(data), 4):
            broken[place] = random.integers(256)
        said = outcome(read_serialised_trajectory, bytes(broken), FIELDS)
        assert not isinstance(said, str) or len(said) < 1000
        with suppress(InputError):
            SerialisedTrajectory(bytes(broken)).with_effort(np.ones((7, 4)))
