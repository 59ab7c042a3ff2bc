"""The action of `par4_motion` with the messages of control_msgs, over DDS, where these are there.

control_msgs is not on PyPI, so this is skipped unless ROS from apt is sourced. `test_goals.py` asks
the same of stand-ins everywhere.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from trajectory_msgs.msg import JointTrajectoryPoint

from node_bench import AWAY_Q, HOME_Q, ROBOT, SIMULATED, Bench, Simulated
from par4_kinematics.ros.convert import joint_values, time_ns, write_time
from par4_kinematics.stamps import SECOND

if find_spec('control_msgs') is None:
    pytest.skip('control_msgs is not installed', allow_module_level=True)

from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from rclpy.action import ActionClient

Result = FollowJointTrajectory.Result
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
"""Of action_msgs/msg/GoalStatus."""


def goal(*points: np.ndarray, seconds: float, path: float = 0.0) -> Any:
    """Return a goal of positions alone, `seconds` apart."""
    message = FollowJointTrajectory.Goal()
    message.trajectory.joint_names = list(ROBOT.joint_names)
    for number, q in enumerate(points, 1):
        point = JointTrajectoryPoint(positions=q.tolist())
        write_time(point.time_from_start, round(number * seconds * SECOND))
        message.trajectory.points.append(point)
    message.path_tolerance = [JointTolerance(name=name, position=path)
                              for name in ROBOT.joint_names]
    message.goal_time_tolerance.nanosec = 200_000_000
    return message


class Client:
    """An action client on a bench."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.feedback: list[Any] = []
        self._client = ActionClient(bench.node, FollowJointTrajectory,
                                    'par4_motion/follow_joint_trajectory')
        bench.wait(self._client.server_is_ready, 'the action')

    def send(self, asked: Any) -> Any:
        """Return the handle of a goal."""
        future = self._client.send_goal_async(
            asked, feedback_callback=lambda message: self.feedback.append(message.feedback))
        self.bench.wait(future.done, 'an answer to a goal')
        return future.result()

    def ended(self, handle: Any) -> Any:
        """Return the status and the result of a goal."""
        future = handle.get_result_async()
        self.bench.wait(future.done, 'the end of a goal')
        return future.result()


def test_goals_of_real_messages_are_followed_cancelled_and_held_to_their_tolerances(bench):
    simulated = Simulated(bench)
    bench.start('par4_motion', motion='action', **SIMULATED)
    client = Client(bench)
    first = bench.wait(lambda: (handle := client.send(goal(AWAY_Q, seconds=0.5))).accepted
                       and handle, 'a robot')
    assert not client.send(goal(HOME_Q, seconds=0.5)).accepted, 'one at a time'
    end = client.ended(first)
    assert (end.status, end.result.error_code) == (SUCCEEDED, Result.SUCCESSFUL), end.result
    bench.wait(lambda: np.abs(joint_values(simulated.states[-1], 'position') - AWAY_Q).max()
               < 0.01, 'the robot to be there')
    assert len(client.feedback) > 3
    times = [time_ns(item.desired.time_from_start) for item in client.feedback]
    assert times == sorted(times)
    assert times[-1] <= SECOND // 2
    for item in client.feedback:
        assert list(item.joint_names) == list(ROBOT.joint_names)
        np.testing.assert_allclose(np.subtract(item.desired.positions, item.actual.positions),
                                   item.error.positions, atol=1e-12)

    cancelled = client.send(goal(HOME_Q, seconds=4.0))
    bench.wait(lambda: np.abs(joint_values(simulated.states[-1], 'position') - AWAY_Q).max()
               > 0.03, 'a motion')
    bench.wait(cancelled.cancel_goal_async().done, 'the answer to a cancel')
    end = client.ended(cancelled)
    assert end.status == CANCELED
    simulated.wait_until(simulated.current_ns() + SECOND)
    assert np.abs(joint_values(simulated.states[-1], 'velocity')).max() < 0.05
    assert np.abs(joint_values(simulated.states[-1], 'position') - HOME_Q).max() > 0.03

    end = client.ended(client.send(goal(HOME_Q, seconds=1.0, path=1e-5)))
    assert (end.status, end.result.error_code) == (ABORTED, Result.PATH_TOLERANCE_VIOLATED)
    assert 'rad from its path' in end.result.error_string
    unknown = goal(HOME_Q, seconds=1.0)
    unknown.trajectory.joint_names = ['a', 'b', 'c', 'd']
    assert not client.send(unknown).accepted
    assert 'Traceback' not in bench.said()
