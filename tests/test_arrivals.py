"""What came on a topic, from messages alone."""

from __future__ import annotations

import pytest
from sensor_msgs.msg import JointState

from par4_kinematics.robot import JOINT_NAMES
from par4_kinematics.ros.arrivals import JUMPS, Arrivals, Places


def told(names, positions, nanoseconds=0):
    """Return a JointState."""
    message = JointState(name=names, position=positions)
    message.header.stamp.nanosec = nanoseconds
    return message


@pytest.mark.parametrize('names', [[], [*JOINT_NAMES], [*reversed(JOINT_NAMES)]])
def test_positions_that_jump_to_and_fro_come_from_two_places(names):
    """Also of joints without names, which are the robot's in their order."""
    places = Places()
    for number in range(JUMPS + 1):
        assert not places.are_two
        places.take(told(names, [1.0 * (number % 2)] * 4, 1000 * number))
    assert places.are_two


@pytest.mark.parametrize('message', [
    told([], []), told([], [0.1]), told([*JOINT_NAMES], [0.1]), told([JOINT_NAMES[0]], [0.1])])
def test_a_message_that_tells_no_place_is_passed_over(message):
    arrivals = Arrivals(stream=True)
    arrivals.hear(message)
    arrivals.hear(told([*JOINT_NAMES], [0.1] * 4))
    assert arrivals.others == ''
    assert not arrivals.places.are_two
