"""What the nodes of all packages share: parameters, topics, services, counts, state."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from threading import Lock
from typing import Any, ClassVar

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from std_srvs.srv import Trigger

from par4_kinematics.errors import InputError, Par4Error, UnreachableError, one_line
from par4_kinematics.interface import CLOCK, DIAGNOSTICS, JOINT_STATES, Topic
from par4_kinematics.limits import limits_not_given
from par4_kinematics.robot import Robot
from par4_kinematics.ros.arrivals import SILENCE, Arrivals, Inputs
from par4_kinematics.ros.awaited import AWAITED, waited_for
from par4_kinematics.ros.clock_watch import ClockWatch
from par4_kinematics.ros.diagnostics import ERROR, OK, WARN, Diagnostics, NodeState
from par4_kinematics.ros.parameters import NodeParameters, check_those_of_ros, declare
from par4_kinematics.ros.qos import message_type, on_topic, unheard
from par4_kinematics.runner import runner_has_ended

NOT_LOGGED = ('rejected_messages', 'unreachable_poses', 'late_steps', 'missed_messages',
              'skipped_windows', 'clock_jumps')
"""Faults that are logged when they happen, or that a busy machine has all the time."""
SIMULATED_TIME = 'use_sim_time'
"""Parameter of every node of ROS: whether it follows a published clock."""
LAST_WORDS = 0.5
"""Longest wait, s, until those who hear the diagnostics have the last one of a node that failed."""
REPORT_PERIOD = 1.0
"""Seconds of wall time between diagnostics, and at the least between warnings of one topic."""


class Par4Node(Node):
    """A node that drops bad messages, counts what goes wrong and tells it on `/diagnostics`.

    Attributes:
        PARAMETERS: the dataclass of its parameters, set by the subclass.
        REST: seconds between callbacks, for a node that takes many messages at a time.
        LOOKS: most looks at what waits, `REST` apart, before the executor has another turn. A turn
            costs more than a message; while a stream flows, looks do without it.
        AWAITS: topics without which the node has nothing to do, told where they do not come.
        parameters: their values; a subclass annotates them with its dataclass.
        finished: set to True, by itself or by a signal, when its work is done; `run` then ends it.
        failure: why it ended without having done its work; `run` then tells it.
        counts: what went wrong so far, by name; `count` adds to them from any thread.
    """

    PARAMETERS: ClassVar[type[NodeParameters]]
    parameters: NodeParameters
    REST: ClassVar[float] = 0.0
    LOOKS: ClassVar[int] = 0
    AWAITS: ClassVar[tuple[Topic, ...]] = ()

    def __init__(self) -> None:
        super().__init__(self.PARAMETERS.NAME, automatically_declare_parameters_from_overrides=True)
        self.wall_clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.parameters = declare(self, self.PARAMETERS)
        self.finished = False
        self.counts: Counter[str] = Counter()
        self._counting = Lock()
        self._arrivals = Inputs()
        self._inputs: list[Callable[[], bool]] = []
        self._subscribed: dict[str, Subscription] = {}
        self._alone = False
        self._told_awaited, self._began = False, time.monotonic()
        self.failure: Par4Error | None = None
        self._clock_watch = ClockWatch(self, self.wall_clock, self._on_jump)
        self.add_on_set_parameters_callback(self._keep_clock)
        self._diagnostics = Diagnostics(self, self.publisher_of(DIAGNOSTICS))
        self.create_timer(REPORT_PERIOD, self.report, clock=self.wall_clock)

    def _keep_clock(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse another clock: what the node has begun would be over, or never, by it."""
        if any(parameter.name == SIMULATED_TIME and parameter.value != self.simulated_time
               for parameter in parameters):
            return SetParametersResult(successful=False, reason=(
                f'{SIMULATED_TIME}: a node keeps the clock it was started with; start it anew'))
        return SetParametersResult(successful=True)

    def declare_parameters(self, namespace: str, parameters: Any, *arguments: Any,
                           **options: Any) -> list[Parameter]:
        """Declare parameters; one of ROS of the wrong type is refused: rclpy would go on without.
        """
        check_those_of_ros({name: value for name, value, *_ in parameters})
        return super().declare_parameters(namespace, parameters, *arguments, **options)

    def create_subscription(self, msg_type: Any, topic: str, callback: Callable[..., None],
                            *arguments: Any, **options: Any) -> Subscription:
        """Return a subscription; one of the clock, as rclpy makes it, rejects times before zero."""
        if msg_type is message_type(CLOCK):
            callback = self._without_bad_clocks(callback)
        return super().create_subscription(msg_type, topic, callback, *arguments, **options)

    def _without_bad_clocks(self, callback: Callable[..., None]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            if message.clock.sec < 0:
                self.reject(CLOCK, InputError(f'{message.clock.sec} s; a clock begins at 0'))
                return
            callback(message)

        return take

    def publisher_of(self, topic: Topic) -> Publisher:
        """Return a publisher of a topic of the contract."""
        return on_topic(self.create_publisher, topic)

    def subscribe(self, topic: Topic, callback: Callable[[Any], None], stream: bool = False,
                  raw: bool = False) -> Subscription:
        """Subscribe to a topic; a message that `callback` raises Par4Error for is rejected.

        Messages that wait are taken in one turn of the executor, which costs more than a message.

        Args:
            topic: of the contract.
            callback: takes a message.
            stream: whether messages come all the time, so that silence is worth a warning.
            raw: whether the callback takes serialised messages.
        """
        arrivals = self._arrivals[topic.name] = Arrivals(stream)

        def take(message: Any, info: dict[str, Any]) -> None:
            accept_or_reject(message, info)
            take_waiting()

        def take_waiting() -> bool:
            taken = False
            with subscription.handle:
                for _ in range(topic.depth):
                    waiting = subscription.handle.take_message(subscription.msg_type, raw)
                    if waiting is None or self.finished:
                        break
                    accept_or_reject(*waiting)
                    taken = True
            return taken

        def accept_or_reject(message: Any, info: dict[str, Any]) -> None:
            arrivals.take(info['publication_sequence_number'])
            if topic.type == JOINT_STATES.type and not raw:
                arrivals.hear(message)
            try:
                callback(message)
            except Par4Error as error:
                self.reject(topic, error)

        subscription = self._subscription_to(topic, callback=take, raw=raw)
        self._inputs.append(take_waiting)
        return subscription

    def subscribe_raw(self, topic: Topic, callback: Callable[[bytes, dict[str, Any]], None]
                      ) -> Subscription:
        """Subscribe to a topic's serialised messages; `callback` is also given message info."""
        return self._subscription_to(topic, callback=callback, raw=True)

    def _subscription_to(self, topic: Topic, **options: Any) -> Subscription:
        subscription = self._subscribed[topic.name] = on_topic(
            self.create_subscription, topic, **options)
        return subscription

    def warn_of_limits_not_given(self, robot: Robot) -> None:
        """Warn of limits that the robot's file leaves out; for nodes that hold motions to them."""
        for line in limits_not_given(robot):
            self.get_logger().warning(line)

    def serve(self, name: str, action: Callable[[], str]) -> None:
        """Offer a Trigger service; `action` returns its message or raises Par4Error."""

        def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            try:
                response.success, response.message = True, action()
            except Par4Error as error:
                response.success, response.message = False, str(error)
                self.get_logger().error(f'{name}: {error}')
            return response

        self.create_service(Trigger, name, answer)

    def count(self, name: str) -> None:
        """Count something that went wrong; threads may do so at the same time."""
        with self._counting:
            self.counts[name] += 1

    def reject(self, topic: Topic, error: Par4Error) -> None:
        """Count a message that cannot be used and say why, at most once a second."""
        self.count('unreachable_poses' if isinstance(error, UnreachableError)
                   else 'rejected_messages')
        self.get_logger().warning(f'{topic.name}: {error}',
                                  throttle_duration_sec=REPORT_PERIOD,
                                  throttle_time_source_type=self.wall_clock)

    def _on_jump(self) -> None:
        self.count('clock_jumps')
        self.clock_jumped_back()

    def clock_jumped_back(self) -> None:
        """Forget what belongs to a time that will come again; told already."""

    def clocks(self) -> int:
        """Return how many publish the clock that this node would follow."""
        return self.count_publishers(self.resolve_topic_name(CLOCK.name))

    @property
    def simulated_time(self) -> bool:
        """Whether the node follows a published clock."""
        return bool(self.get_parameter(SIMULATED_TIME).value)

    def end(self) -> None:
        """Begin to end, as a signal or ~/stop asks; a node that has more to do sets `finished`."""
        self.finished = True

    def state(self) -> NodeState:
        """Return what the node does now: whether its streams flow and its clock is one."""
        clock = self._clock_watch.state(self.clocks() if self.simulated_time else 0)
        if clock is not None:
            return clock
        if self._arrivals.mixed:
            return NodeState(ERROR, self._arrivals.mixed)
        if self._arrivals.foreign:
            return NodeState(WARN, self._arrivals.foreign)
        for name, subscription in self._subscribed.items():
            reason = unheard(self, name, subscription)
            if reason is not None:
                return NodeState(WARN, *reason)
        waiting, dead = self._arrivals.awaited, self.dead_inputs()
        if dead:
            return NodeState(WARN, f'dead input: {", ".join(dead)} came, but no more')
        return NodeState(OK, f'waiting for {", ".join(waiting)}' if waiting else 'running')

    def dead_inputs(self) -> list[str]:
        """Return the topics of which there was much and is nothing any more, the clock the last."""
        dead = self._arrivals.dead
        if self.simulated_time and self._clock_watch.age > SILENCE:
            dead.append(CLOCK.name)
        return dead

    def has_come(self, topic: Topic) -> bool:
        """Return whether a message of a topic has come."""
        return self._arrivals[topic.name].received > 0

    def _tell_awaited(self) -> None:
        """Say once, after a while, what has not come yet: until then it may be on its way."""
        if self._told_awaited or not self.AWAITS or time.monotonic() - self._began < AWAITED:
            return
        self._told_awaited = True
        clock = [CLOCK] if self.simulated_time and self.get_clock().now().nanoseconds == 0 else []
        awaited = [*clock, *(topic for topic in self.AWAITS if not self.has_come(topic))]
        if awaited:
            told = '; '.join(waited_for(topic, self.count_publishers(
                self.resolve_topic_name(topic.name)) == 0) for topic in awaited)
            self.get_logger().info(f'waiting for {told}')

    def _look_at_runner(self) -> None:
        """Begin to end where who runs this node was killed: nobody else would end it."""
        if self._alone or not runner_has_ended():
            return
        self._alone = True
        self.get_logger().error('the process that runs this node has ended; so does the node')
        self.end()

    def faults(self) -> dict[str, int]:
        """Return what the diagnostics tell of things that went wrong, by name."""
        missed = self._arrivals.missed
        with self._counting:  # a name that comes meanwhile would end the walk through them
            counts = dict(self.counts)
        return {**counts, **({'missed_messages': missed} if missed else {})}

    def expected(self) -> tuple[str, ...]:
        """Return the faults, by name, that are not logged by their counts."""
        return NOT_LOGGED

    def worrying(self, new: dict[str, int]) -> bool:
        """Return whether the new faults of a report, by name, are worth a warning."""
        return bool(new)

    def measures(self) -> dict[str, str]:
        """Return what else the diagnostics tell: of each input its age and how many messages."""
        return self._arrivals.measures

    def traffic(self) -> dict[str, int]:
        """Return what the diagnostics tell beside the faults, by name."""
        return {}

    def now_ns(self) -> int:
        """Return the time that this node's own stamps carry, ns."""
        return self.get_clock().now().nanoseconds

    def report(self) -> None:
        """Tell the state, and faults that are new."""
        self._look_at_runner()
        self._clock_watch.look()
        self._tell_awaited()
        new, state = self._diagnostics.new(self.faults(), self.expected()), self.state()
        self._diagnostics.log(state)
        self._tell(state, new)

    def _tell(self, state: NodeState, new: dict[str, int]) -> None:
        """Tell a state and new faults, by name, on the diagnostics."""
        self._diagnostics.publish(self.now_ns(), state, new, self.worrying(new),
                                  {**self.traffic(), **self.measures()})

    def work(self) -> None:
        """Serve callbacks until the node is finished; what it fails of is told on the diagnostics.

        Raises:
            Par4Error: the node has not done its work.
        """
        try:
            self._serve()
        except Par4Error as error:
            # but not on the terminal, where `run` tells it
            self._tell(NodeState(ERROR, f'ended: {one_line(str(error))}'), {})
            self._diagnostics.wait_until_heard(LAST_WORDS)
            raise

    def _serve(self) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        while not self.finished:
            executor.spin_once(timeout_sec=0.1)
            if self.REST > 0.0:
                self._rest()
        executor.shutdown()
        self._look_at_runner()  # whose end may have ended this node by that of another
        if self.failure is not None:
            raise self.failure

    def _rest(self) -> None:
        """Rest, and again as long as something has come meanwhile, so many looks at the most.

        What comes while the node rests is taken together: to wait for each message by itself is a
        turn of the executor, which costs more than the message.
        """
        time.sleep(self.REST)
        for _ in range(self.LOOKS):
            taken = [take_waiting() for take_waiting in self._inputs]  # each is to be looked at
            if not any(taken):
                return
            time.sleep(self.REST)

    def close(self) -> None:
        """Complete what the node writes and release what it holds; called once at the end."""
