"""Node `par4_motion`: plays a motion as `reference`, then ends."""

from __future__ import annotations

import math
import sys
import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.topic_endpoint_info import TopicEndpointInfo
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from par4_kinematics.acceleration import platform_motion
from par4_kinematics.approach import with_approach
from par4_kinematics.astray import LAG_NS, Astray
from par4_kinematics.braking import ways_to_rest
from par4_kinematics.errors import InputError, Par4Error
from par4_kinematics.interface import CLOCK, DIAGNOSTICS, JOINT_STATES, REFERENCE
from par4_kinematics.motion import Motion
from par4_kinematics.motion_file import NAMED_MOTIONS, named_motion, refuse_no_motion
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import read_robot
from par4_kinematics.ros import motion_faults
from par4_kinematics.ros.arrivals import SILENCE
from par4_kinematics.ros.awaited import waited_for
from par4_kinematics.ros.convert import is_foreign, joint_values, time_ns, write_trajectory
from par4_kinematics.ros.diagnostics import OK, WARN, NodeState
from par4_kinematics.ros.goal_server import ACTION, ARRIVED, GoalServer
from par4_kinematics.ros.listeners import Listeners
from par4_kinematics.ros.motion_parameters import MotionParameters
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.played import Played
from par4_kinematics.ros.process import run
from par4_kinematics.ros.silence import Silence
from par4_kinematics.ros.troubles import Troubles
from par4_kinematics.stamps import SECOND
from par4_kinematics.standing import Standing
from par4_kinematics.standstill import Standstill
from par4_kinematics.workspace import home_pose

LEAD_NS = SECOND
"""How far ahead of the clock points are sent."""
WALL_LEAD = 1.0
"""Seconds of wall time from the first message to its first point where the clock runs faster."""
FAST = 1.5
"""A clock that goes so many times as fast as the wall's is that of a simulation, not of a robot."""
SLOWEST_CLOCK = 0.05
"""Lower bound of the measured pace of the clock over the wall's: where the clock stood when the
motion began, the measured pace is zero."""
FAR_NS = 100 * SECOND
"""How far ahead of a fast clock points are sent: 400 messages, fewer than a queue holds."""
MILLISECOND = SECOND // 1000
TICK = 0.02
"""Seconds of wall time between looks at the clock."""
BRAKING_LEAD = 0.15
"""Seconds of wall time from now to the first point of the first way to rest."""
UNSEEN_NS = SECOND // 2
"""How long after the end of the last way to rest the robot is still watched for coming to rest."""
STANDSTILL = 3.0
"""Seconds of wall time to wait while the clock stands, or for the robot to say where it ended."""
FEEDBACK = 0.05
"""Seconds of wall time between two feedbacks of a goal."""


class MotionNode(Par4Node):
    """The node `par4_motion`; `MotionParameters` says what it does."""

    REST = 0.002
    PARAMETERS = MotionParameters
    parameters: MotionParameters

    def __init__(self) -> None:
        super().__init__()
        asked = self.parameters
        self._publisher = self.publisher_of(REFERENCE)
        self._listeners = Listeners(asked.listeners, time.monotonic())
        self._robot = read_robot(asked.robot_file)
        self.warn_of_limits_not_given(self._robot)
        self._motion: Motion | None = None
        refuse_no_motion(asked.motion, (*NAMED_MOTIONS, ACTION))
        if asked.motion != ACTION:
            self._motion = named_motion(asked.motion, self._robot, asked.duration or None,
                                        asked.seed, asked.period)
        if asked.duration and asked.motion not in NAMED_MOTIONS:
            raise InputError(f'parameter duration: for {", ".join(NAMED_MOTIONS)}, found motion '
                             f'{asked.motion}, whose own duration it is; leave it out')
        # compile what the approach needs before there is a clock that could run on meanwhile
        home = inverse_kinematics(self._robot.geometry, home_pose(self._robot))
        platform_motion(self._robot.geometry, *np.vstack((home, np.zeros((2, 4))))[:, None])
        self._goals: GoalServer | None = None
        self._ending = self._braking = self._stop_asked = False
        self._fed_back = 0.0
        self._played: Played | None = None
        self._fault: Par4Error | None = None
        self._silence = Silence()
        self._troubles = Troubles()
        self._standing: Standing | None = None
        self._astray: Astray | None = None
        self._before = Standstill()
        self._standstill: Standstill | None = None
        self._rests_between_ns = 0, 0
        self._ahead_ns = LEAD_NS
        self._pace = 1.0
        self._patient_until = math.inf
        self._stamp_ns = 0
        self._robot_at: np.ndarray | None = None
        self._waits_for = ''
        self._message = JointTrajectory()
        self.subscribe(JOINT_STATES, self._on_joint_state)
        self.subscribe(DIAGNOSTICS, self._on_diagnostics)
        self.create_timer(TICK, self._tick, clock=self.wall_clock)
        self.serve('~/stop', self._stop)
        if asked.motion == ACTION:
            self._goals = GoalServer(self, self._robot, lambda: self._robot_at, self._play,
                                     self._ask_to_stop)

    def _on_joint_state(self, message: JointState) -> None:
        if is_foreign(message):
            return
        self._robot_at = joint_values(message, 'position')
        # where there is no stamp, the state is that of the time at which it comes
        stamp_ns = time_ns(message.header.stamp) or self.now_ns()
        if stamp_ns != self._stamp_ns:
            self._silence.heard()
        self._stamp_ns = stamp_ns
        if self._standstill is not None:
            self._standstill.take(stamp_ns, self._robot_at)
        if self._played is None:
            self._before.take(stamp_ns, self._robot_at)
        elif not self._braking:
            self._hold_to_reference(self._played, self._robot_at)

    def _hold_to_reference(self, played: Played, robot_at: np.ndarray) -> None:
        """Abort where a joint stands that should move, goes another way than it should, or is
        beyond the tolerance of a goal.
        """
        _, (q, *_) = played.asked(self._stamp_ns)
        bounded = self._goals is not None and self._goals.bounded
        if self._goals is not None and bounded:
            self._goals.hold_to_path(q)
        if self._standing is None or self._astray is None:
            self._standing, self._astray = Standing(robot_at, q, self._stamp_ns), Astray(ARRIVED)
        gone = self._standing.take(robot_at, q, self._stamp_ns)
        away = self._astray.take(robot_at, *played.asked_since(self._stamp_ns, LAG_NS),
                                 self._stamp_ns)
        if self._stop_asked:
            return
        if gone.max() > ARRIVED:
            self._abort(motion_faults.stands(played.motion.name, gone,
                                             self._trouble(DiagnosticStatus.WARN)))
        elif away.max() > ARRIVED and not bounded:  # whoever gives a tolerance knows what he allows
            self._abort(motion_faults.astray(played.motion.name, away, self._senders(),
                                             self._trouble(DiagnosticStatus.WARN)))

    def _senders(self) -> int:
        """Return how many publish the reference, this node among them."""
        return self.count_publishers(self.resolve_topic_name(REFERENCE.name))

    def _look_for_silence(self, now_ns: int) -> None:
        """Forget where a robot is that tells no more, and abort what is sent to it."""
        silent = self._silence.look(time.monotonic(), now_ns)
        if silent <= SILENCE:
            return
        self._robot_at = None
        if self._played is not None and not self._stop_asked:
            self._abort(motion_faults.silent(
                self._played.motion.name, self.resolve_topic_name(JOINT_STATES.name), silent))

    def _abort(self, fault: Par4Error) -> None:
        """Brake at the next look at the clock, then fail."""
        self._fault, self._stop_asked = fault, True

    def clock_jumped_back(self) -> None:
        """Abort a motion that is being played: the robot is not where it was."""
        self._before = Standstill()
        if self._played is not None and not self.finished:
            self._fail(motion_faults.started_again(self._played.motion.name))

    def _trouble(self, least: bytes = DiagnosticStatus.ERROR) -> str:
        """Return what those that publish joint states tell is so bad with the robot."""
        return self._troubles.of(self._robots(), least)

    def _robots(self) -> list[TopicEndpointInfo]:
        return self.get_publishers_info_by_topic(self.resolve_topic_name(JOINT_STATES.name))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self._troubles.take(message, self._robots())
        if self._played is not None and not self._stop_asked and (trouble := self._trouble()):
            self._abort(motion_faults.tripped(self._played.motion.name, trouble))

    def _tick(self) -> None:
        now_ns = self.get_clock().now().nanoseconds
        self._look_for_silence(now_ns)
        if self._played is None:
            motion, robot_at, self._waits_for = self._motion, self._robot_at, self._missing(now_ns)
            if motion is None:
                self._end_when_answered()
                return
            if self._stop_asked:  # before it began
                self._braking = True
                self._over(0)
                return
            if self._waits_for or robot_at is None:
                self.get_logger().info(f'waiting for {self._waits_for}', throttle_duration_sec=5.0,
                                       throttle_time_source_type=self.wall_clock)
                return
            try:
                if mixed := self._arrivals.mixed:
                    raise InputError(f'{motion.name} not begun: {mixed}')
                motion_faults.check_start(
                    motion.name, self._trouble(), self.clocks() if self.simulated_time else 0,
                    self._stamp_ns, now_ns, 0 if self._before.reached(0) else self._senders())
                self._played = self._begin(motion, robot_at, now_ns)
            except Par4Error as error:
                self._fail(error)
                return
        played = self._played
        if self._stop_asked and not self._braking:
            self._braking = True
            if played.sent == 0:
                self._over(0)
                return
            self._brake(played, now_ns)
        # at every look, for the clock of a simulation that has ended asks for no further points
        if not (self._braking or self._robot_is_there()):
            self._fail(motion_faults.ended(played.motion.name))
            return
        while played.sent < len(played.times_ns) and (
                played.times_ns[played.sent] <= now_ns + self._ahead_ns):
            self._send_chunk(played)
        self._feed_back(played, now_ns)
        if self._standstill is not None:
            self._look_for_rest(played, now_ns, self._standstill)
        elif now_ns > played.times_ns[-1]:
            self._look_for_end(played)

    def _robot_is_there(self) -> bool:
        """Return whether a robot tells of itself: one that comes anew stands somewhere else."""
        return self.count_publishers(self.resolve_topic_name(JOINT_STATES.name)) > 0

    def _play(self, motion: Motion) -> None:
        """Play the motion of a goal from the next look at the clock on."""
        self._motion = motion

    def _feed_back(self, played: Played, now_ns: int) -> None:
        if self._goals is None or time.monotonic() - self._fed_back < FEEDBACK:
            return
        self._fed_back = time.monotonic()
        self._goals.follow(now_ns, *played.asked(self._stamp_ns))

    def _look_for_end(self, played: Played) -> None:
        """End after the last point, where the robot tells of a time after it."""
        last_ns = int(played.times_ns[-1])
        if self._goals is None:
            self._look_for_arrival(played, last_ns)
        elif self._stamp_ns > last_ns:
            self._over(self._stamp_ns - last_ns)
        elif (self._arrivals[JOINT_STATES.name].age or 0.0) > STANDSTILL:
            self._fail(motion_faults.unknown_end(played.motion.name))

    def _look_for_arrival(self, played: Played, last_ns: int) -> None:
        """End a motion; it fails if the robot stands somewhere else than at its end."""
        if self._patient_until == math.inf:
            self._patient_until = time.monotonic() + STANDSTILL
        if self._stamp_ns > last_ns and self._robot_at is not None:
            away = np.abs(self._robot_at - played.points[0][-1])
            if away.max() > ARRIVED:
                self._fail(motion_faults.missed(played.motion.name, away))
                return
        elif time.monotonic() < self._patient_until:
            return
        else:
            self.get_logger().warning(f'no {JOINT_STATES.name} tell whether the robot followed '
                                      f'{played.motion.name} to its end')
        self._over(0)

    def _over(self, late_ns: int) -> None:
        """End what was played, `late_ns` after its last point."""
        if self._fault is not None:
            self._fail(self._fault)
        elif self._goals is None:
            self.finished = True
        elif self._goals.over(late_ns, self._braking):
            self._await_next()

    def _fail(self, error: Par4Error) -> None:
        if self._goals is None:
            self.failure, self.finished = error, True
            return
        self._goals.fail(error)
        self._await_next()

    def _await_next(self) -> None:
        """Wait for the next goal, or for the client of the last one where the end was asked."""
        self._motion = self._played = None
        self._braking = self._stop_asked = False
        self._fault = self._standing = self._astray = self._standstill = None
        self._patient_until = math.inf

    def _end_when_answered(self) -> None:
        """End where that was asked, once the client of the goal knows how it ended."""
        if self._ending and not (self._goals is not None and self._goals.unanswered):
            self.finished = True

    def _ask_to_stop(self) -> None:
        self._stop_asked = self._motion is not None

    def _stop(self) -> str:
        if self._goals is None:
            self.end()
        else:
            self._ask_to_stop()
        return 'braking on the path of the motion'

    def end(self) -> None:
        """Brake on the path of the motion, then end; at once if it does not play yet.

        The client of a goal is told first.
        """
        if self._played is None and not (self._goals is not None and self._goals.unanswered):
            self.finished = True
        self._stop_asked = self._ending = True

    def _brake(self, played: Played, now_ns: int) -> None:
        """Replace what is queued by ways to rest, of which one is in time."""
        now, sent = (float(at_ns - played.start_ns) / SECOND
                     for at_ns in (now_ns, played.times_ns[played.sent - 1]))
        ways = ways_to_rest(played.motion, now, max(1.0, self._pace) * BRAKING_LEAD, sent)
        ends = [way[0][-1] for way in ways] or [played.motion.duration]
        self._rests_between_ns = (played.start_ns + round(ends[0] * SECOND),
                                  played.start_ns + round(ends[-1] * SECOND) + UNSEEN_NS)
        for times, *points in reversed(ways):
            played.times_ns = played.start_ns + np.rint(times * SECOND).astype(np.int64)
            played.points, played.sent = tuple(points), 0
            while played.sent < len(played.times_ns):
                self._send_chunk(played)
        self._standstill = Standstill()
        self._patient_until = time.monotonic() + STANDSTILL + (
            self._rests_between_ns[1] - now_ns) / SECOND / min(1.0, max(SLOWEST_CLOCK, self._pace))
        self.get_logger().warning(
            f'{self._fault or "asked to stop"}: braking on the path of the motion')

    def _look_for_rest(self, played: Played, now_ns: int, standstill: Standstill) -> None:
        """End when the robot has come to rest, or when it cannot be hoped for any more."""
        first_ns, last_ns = self._rests_between_ns
        if standstill.reached(first_ns):
            after = max((standstill.since_ns or 0) - played.start_ns, 0) / SECOND
            self.get_logger().warning(f'stopped: at rest {after:.3f} s after the start, of '
                                      f'{played.motion.duration:.3f} s')
        elif self._publisher.get_subscription_count() == 0:
            self.get_logger().warning(
                f'stopped: nobody takes {REFERENCE.name} any more; the drives must brake')
        elif self._stamp_ns > last_ns:  # as the robot says; what it says may come late
            self.get_logger().error('stopped, but the robot was not seen to come to rest')
        elif time.monotonic() > self._patient_until:
            self.get_logger().error('the clock stands: the robot may not have braked'
                                    if now_ns <= last_ns else
                                    f'stopped, but no {JOINT_STATES.name} tell whether the robot '
                                    f'came to rest')
        else:
            return
        self._over(0)

    def _missing(self, now_ns: int) -> str:
        if self._motion is None:
            return 'a goal'
        found = time.monotonic() > self._listeners.found_at
        if now_ns == 0:
            return waited_for(CLOCK, self.clocks() == 0 and found)
        if self._robot_at is None:
            return waited_for(JOINT_STATES, not self._robot_is_there() and found)
        return self._listeners.missing(self._publisher.get_subscription_count(), time.monotonic(),
                                       now_ns)

    def _begin(self, motion: Motion, robot_at: np.ndarray, now_ns: int) -> Played:
        motion = with_approach(motion, self._robot, robot_at)
        self._pace = self._listeners.pace(time.monotonic(), now_ns)
        lead_ns = max(LEAD_NS, round(self._pace * WALL_LEAD * SECOND))
        if self._pace > FAST:
            self._ahead_ns = FAR_NS
        # a whole millisecond, so that samples of the usual rates fall on the points
        start_ns = (now_ns + lead_ns) // MILLISECOND * MILLISECOND
        if (senders := self._senders()) > 1:
            self.get_logger().warning(f'{senders} publish {REFERENCE.name}: the robot follows what '
                                      f'comes last; let one move it at a time')
        self.get_logger().info(f'playing {motion.name}, {motion.duration:.3f} s')
        return Played(motion, start_ns, start_ns + np.rint(motion.t * SECOND).astype(np.int64),
                      (motion.q, motion.qd, motion.qdd))

    def _send_chunk(self, played: Played) -> None:
        write_trajectory(self._message, JointTrajectoryPoint, played.next_chunk())
        self._publisher.publish(self._message)

    def state(self) -> NodeState:
        """Return whether the node waits, plays or brakes, and whether its clock goes."""
        common = super().state()
        does = (f'waiting for {self._waits_for or "its first second"}' if self._played is None
                else f'{"braking" if self._braking else "playing"} {self._played.motion.name}')
        if common.level != OK:
            return NodeState(common.level, f'{does}; {common.text}')
        return NodeState(WARN if self._braking else OK, does)

    def traffic(self) -> dict[str, int]:
        """Return how many points have been sent."""
        return {'sent_points': 0 if self._played is None else self._played.sent}


def main() -> int:
    """Run the node; return its exit code."""
    return run(MotionNode)


if __name__ == '__main__':
    sys.exit(main())
