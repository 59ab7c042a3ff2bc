"""The move from where the robot stands to where a motion begins."""

from __future__ import annotations

import numpy as np
import pytest

from par4_kinematics.approach import with_approach
from par4_kinematics.circle import circle_motion
from par4_kinematics.errors import InputError
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import Robot
from par4_kinematics.workspace import home_pose
from robots import OTHER, REFERENCE


@pytest.fixture(params=[REFERENCE, OTHER], ids=lambda robot: robot.name)
def robot(request) -> Robot:
    return request.param


def test_it_starts_at_rest_where_the_robot_stands_and_ends_in_the_motion(robot):
    motion = circle_motion(robot)
    q = inverse_kinematics(robot.geometry, home_pose(robot))
    joined = with_approach(motion, robot, q)
    added = len(joined.t) - len(motion.t)
    assert added > 0
    np.testing.assert_allclose(joined.q[0], q, atol=1e-12)
    np.testing.assert_allclose(joined.qd[0], 0.0, atol=1e-12)
    for part in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd'):
        np.testing.assert_array_equal(getattr(joined, part)[added:], getattr(motion, part))
    np.testing.assert_allclose(np.diff(joined.t), motion.period, rtol=1e-9)


def test_it_is_smooth_slow_and_its_derivatives_belong_to_it(robot):
    motion = circle_motion(robot)
    joined = with_approach(motion, robot, inverse_kinematics(robot.geometry, home_pose(robot)))
    part = slice(0, len(joined.t) - len(motion.t) + 2)
    period = motion.period
    for values, rates in ((joined.q, joined.qd), (joined.qd, joined.qdd)):
        middle = 0.5 * (rates[part][1:] + rates[part][:-1])
        change = np.diff(values[part], axis=0) / period
        # the trapezoidal rule errs by period^2 / 12 times the third derivative
        np.testing.assert_allclose(change, middle, atol=1e-3 * np.abs(rates[part]).max())
    assert np.abs(joined.qd[part]).max() <= 0.1 * robot.limits.joint_speed * (1 + 1e-9)


def test_a_motion_that_begins_there_is_left_alone(robot):
    motion = circle_motion(robot)
    assert with_approach(motion, robot, motion.q[0] + 5e-4) is motion


def test_a_robot_out_of_its_limits_is_refused():
    motion = circle_motion(REFERENCE)
    low, _ = REFERENCE.limits.joint_position
    narrow = REFERENCE.model_copy(update={'limits': REFERENCE.limits.model_copy(
        update={'joint_position': (low, float(motion.q[0].max()) + 0.01)})})
    with pytest.raises(InputError, match='approach to .*joint position'):
        with_approach(motion, narrow, motion.q[0] + 0.05)
    with pytest.raises(InputError, match='finite'):
        with_approach(motion, REFERENCE, np.full(4, np.nan))
