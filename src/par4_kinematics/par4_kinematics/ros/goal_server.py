"""The action `~/follow_joint_trajectory` of `par4_motion`, where control_msgs is installed.

Goals of control_msgs/action/FollowJointTrajectory become motions; `motion_node` plays them. One
goal at a time; a second one is rejected until the first has ended.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rclpy.action.server import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.task import Future

from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.motion import Motion
from par4_kinematics.robot import JOINT_NAMES, Robot
from par4_kinematics.ros.convert import joint_columns, read_trajectory, time_ns, write_time
from par4_kinematics.splined import splined_motion
from par4_kinematics.stamps import SECOND

ACTION = 'action'
"""Value of the parameter `motion` with which the node plays the goals of the action."""
SUCCESSFUL, INVALID_GOAL, PATH_BROKEN, GOAL_MISSED = 0, -1, -4, -5
"""Error codes of control_msgs/action/FollowJointTrajectory."""
ARRIVED = 0.1
"""How far a joint may stand from the end of a motion that counts as followed, rad."""


def action_type() -> Any:
    """Return the type of the action.

    Raises:
        InputError: control_msgs is not installed.
    """
    try:
        from control_msgs.action import FollowJointTrajectory
    except ImportError:
        raise InputError(f'motion {ACTION}: it takes control_msgs/action/FollowJointTrajectory, '
                         f'and control_msgs is not installed; install ros-jazzy-control-msgs, or '
                         f'play a motion by its name') from None
    return FollowJointTrajectory


@dataclass(frozen=True)
class GoalEnd:
    """How a goal ended: 'succeed', 'abort' or 'canceled', with its error code and words."""

    end: str
    code: int
    words: str


def tolerances(asked: Any, default: float) -> np.ndarray:
    """Return the bound of the position of each joint, (4,) rad.

    It is `default` where none is asked, or zero; a negative one means that there is none: infinite.

    Raises:
        InputError: a joint that the robot does not have, or NaN.
    """
    bounds = np.full(len(JOINT_NAMES), default)
    for tolerance in asked:
        if tolerance.name not in JOINT_NAMES:
            raise InputError(f'tolerance of {tolerance.name}: unknown joint; known are '
                             f'{", ".join(JOINT_NAMES)}')
        if np.isnan(tolerance.position):
            raise InputError(f'tolerance of {tolerance.name}: {tolerance.position}; give a number')
        if tolerance.position != 0.0:
            bounds[JOINT_NAMES.index(tolerance.name)] = (
                tolerance.position if tolerance.position > 0.0 else np.inf)
    return bounds


def goal_motion(goal: Any, robot: Robot, q_now: np.ndarray) -> Motion:
    """Return the motion that a goal asks for.

    Raises:
        Par4Error: joints, times or values that make no sense, a stamp, or limits of the robot.
    """
    trajectory = goal.trajectory
    if time_ns(trajectory.header.stamp) != 0:
        raise InputError('the trajectory has a stamp; it starts as soon as it is accepted, so send '
                         'a stamp of zero')
    joint_columns(trajectory.joint_names)
    fields = ['positions']
    for field in ('velocities', 'accelerations'):
        given = [len(getattr(point, field)) > 0 for point in trajectory.points]
        if any(given) and not all(given):
            raise InputError(f'{field} in some points only; give them in all or none')
        if any(given):
            fields.append(field)
    points = read_trajectory(trajectory, fields)
    return splined_motion('goal', robot, q_now, points.from_start_ns / SECOND,
                          points.rows('positions'), points.qd, points.qdd)


class GoalServer:
    """Takes goals, tells how they are followed, and how they end.

    Args:
        node: that offers the action.
        robot: whose limits hold.
        position: returns where the joints are, (4,) rad, None before it is known.
        play: takes the motion of a goal.
        stop: brakes it.
    """

    def __init__(self, node: Node, robot: Robot, position: Callable[[], np.ndarray | None],
                 play: Callable[[Motion], None], stop: Callable[[], None]) -> None:
        self._node, self._robot = node, robot
        self._position, self._play, self._stop = position, play, stop
        self._type = action_type()
        self._motion: Motion | None = None
        self._handle: Any = None
        self._ended: Future | None = None
        self._broken: GoalEnd | None = None
        self._server = ActionServer(
            node, self._type, '~/follow_joint_trajectory', execute_callback=self._execute,
            goal_callback=self._judge, cancel_callback=self._cancel)

    def _judge(self, goal: Any) -> GoalResponse:
        try:
            if self._motion is not None:
                raise InputError('another goal is being followed; wait for it or cancel it')
            q_now = self._position()
            if q_now is None:
                raise InputError('no joint_states come, so that it is not known where the robot '
                                 'stands; see whether its driver runs')
            self._path = tolerances(goal.path_tolerance, np.inf)
            self._goal = tolerances(goal.goal_tolerance, ARRIVED)
            self._patience_ns = max(0, time_ns(goal.goal_time_tolerance))
            self._motion = goal_motion(goal, self._robot, q_now)
        except Par4Error as error:
            self._node.get_logger().warning(f'goal rejected: {error}')
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _cancel(self, _handle: Any) -> CancelResponse:
        self._stop()
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        self._handle, self._broken, self._ended = handle, None, Future()
        assert self._motion is not None  # the judged one
        self._play(self._motion)
        if handle.is_cancel_requested:  # before there was anything to stop
            self._stop()
        ended = await self._ended
        getattr(handle, ended.end)()
        self._handle = self._motion = None
        return self._type.Result(error_code=ended.code, error_string=ended.words)

    @property
    def unanswered(self) -> bool:
        """Whether a goal was begun whose client has not been told yet how it ended."""
        return self._handle is not None

    @property
    def bounded(self) -> bool:
        """Whether a goal is followed that has a tolerance of its path."""
        return self._handle is not None and bool(np.isfinite(self._path).any())

    def hold_to_path(self, desired: np.ndarray) -> None:
        """Brake where a joint is beyond its tolerance of what is asked, (4,)."""
        actual = self._position()
        if actual is None or self._broken is not None:
            return
        error = desired - actual
        beyond = np.abs(error) > self._path
        if beyond.any():
            joint = int(np.argmax(beyond))
            self._broken = GoalEnd('abort', PATH_BROKEN, (
                f'{JOINT_NAMES[joint]} is {abs(error[joint]):.3g} rad from its path, '
                f'{self._path[joint]:.3g} rad are allowed'))
            self._stop()

    def follow(self, stamp_ns: int, elapsed_ns: int, desired: tuple[np.ndarray, ...]) -> None:
        """Tell what is asked, (4,) of q, qd, qdd, and what is there."""
        actual = self._position()
        if self._handle is None or actual is None:
            return
        feedback = self._type.Feedback()
        write_time(feedback.header.stamp, stamp_ns)
        feedback.joint_names = list(JOINT_NAMES)
        for field, values in zip(('positions', 'velocities', 'accelerations'), desired,
                                 strict=True):
            setattr(feedback.desired, field, values.tolist())
        error = desired[0] - actual
        feedback.actual.positions, feedback.error.positions = actual.tolist(), error.tolist()
        for point in (feedback.desired, feedback.actual, feedback.error):
            write_time(point.time_from_start, elapsed_ns)
        self._handle.publish_feedback(feedback)

    def over(self, late_ns: int, stopped: bool) -> bool:
        """Return whether a goal has ended, `late_ns` after its motion did, and tell its client."""
        if self._ended is None or self._ended.done():
            return True
        actual, motion = self._position(), self._motion
        if self._broken is not None:
            ended = self._broken
        elif stopped:
            asked = self._handle is not None and self._handle.is_cancel_requested
            ended = GoalEnd('canceled' if asked else 'abort', SUCCESSFUL if asked else
                            INVALID_GOAL, 'braked on its path before its end')
        else:
            missed = (np.zeros(4) if actual is None or motion is None
                      else np.abs(motion.q[-1] - actual))
            beyond = missed > self._goal
            if beyond.any() and late_ns <= self._patience_ns:
                return False
            joint = int(np.argmax(beyond))
            ended = GoalEnd('abort', GOAL_MISSED, (
                f'{JOINT_NAMES[joint]} ended {missed[joint]:.3g} rad from its goal, '
                f'{self._goal[joint]:.3g} rad are allowed')) if beyond.any() else GoalEnd(
                    'succeed', SUCCESSFUL, 'followed to its end')
        self._ended.set_result(ended)
        return True

    def fail(self, error: Par4Error) -> None:
        """End the goal that is being followed, because it cannot be."""
        if self._ended is not None and not self._ended.done():
            self._ended.set_result(GoalEnd('abort', INVALID_GOAL, str(error)))
        self._node.get_logger().error(str(error))
