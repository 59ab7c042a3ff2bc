"""A bench for tests of nodes: a client in a domain of its own, and the processes it starts."""

from __future__ import annotations

import itertools
import os
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from node_server import MODULES, ForkedNode
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from par4_dynamics.model_from_file import read_model
from par4_dynamics.state import state_of_joints
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    DIAGNOSTICS,
    JOINT_STATES,
    Topic,
)
from par4_kinematics.motion import Motion, motion_of_joints
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES, read_robot
from par4_kinematics.ros.convert import (
    Trajectory,
    joint_values,
    time_ns,
    write_joint_state,
    write_trajectory,
)
from par4_kinematics.ros.qos import message_type, qos_of
from par4_kinematics.stamps import SECOND
from par4_kinematics.time_laws import Quintic
from par4_kinematics.workspace import home_pose

ROBOT = read_robot('reference')
GAIN = np.asarray(ROBOT.drives.gain)
HOME_Q = inverse_kinematics(ROBOT.geometry, home_pose(ROBOT))
AWAY_Q = inverse_kinematics(ROBOT.geometry, home_pose(ROBOT) + (0.12, -0.06, 0.05, 0.3))
DEADLINE = 200.0
"""Seconds after which something that should happen counts as not happening. It only ends what
hangs: nothing takes as long on the busiest machine."""
DOMAINS = 100
"""ROS domains from 1 on that tests may use; above 101 their ports are ephemeral ones."""
COUNTER = itertools.count(11 * os.getpid())
"""Every bench begins to look for a domain one further than the one before it."""
UNHEARD = 100_000
"""Messages of a simulation or another node that wait for a bench that gets no turn: more than a
test ever lets come, so that none is lost."""
SIMULATED = {'use_sim_time': 'true'}
MILLISECOND = 1_000_000


class Domain:
    """A ROS domain that no other bench on this machine uses until it is left.

    To hold domain n is to hold the TCP port of the same number as its UDP port of discovery,
    7400 + 250 n (DDSI-RTPS 2.5, 9.6.2), which nothing else uses. The system takes it back when the
    process ends, in whatever way; any number of workers, of any number of runs, may ask.
    """

    def __init__(self, first: int) -> None:
        """Take the first domain that is free from `first` on, round and round."""
        for number in range(first, first + DOMAINS):
            self.number = 1 + number % DOMAINS
            self._port = socket.socket()
            try:
                self._port.bind(('127.0.0.1', 7400 + 250 * self.number))
            except OSError:
                self._port.close()
            else:
                return
        pytest.fail(f'{DOMAINS} ROS domains asked for, none is free; end other runs of these tests')

    def leave(self) -> None:
        """Let others take it."""
        self._port.close()


class Bench:
    """A test client in a domain of its own, and the nodes it starts there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._domain = Domain(next(COUNTER))
        self.domain = self._domain.number
        self.environment = os.environ | {'ROS_DOMAIN_ID': str(self.domain),
                                         'ROS_LOG_DIR': str(folder / 'log')}
        self.children: list[ForkedNode | subprocess.Popen] = []
        self._clients: dict[str, Any] = {}
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node('bench', context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def start(self, node: str, remap: tuple[str, ...] = (), **parameters: Any) -> ForkedNode:
        """Start a node with parameters and names that are changed."""
        output = self._output(node)
        output.touch()
        child = ForkedNode(MODULES[node], _ros_arguments(remap, parameters), self.environment,
                           self.folder, output)
        self.children.append(child)
        return child

    def execute(self, node: str, **parameters: Any) -> subprocess.Popen:
        """Start a node as `start` does, but by itself: it imports what it needs, as a user's."""
        with self._output(node).open('w') as output:
            child = subprocess.Popen(
                [sys.executable, '-m', MODULES[node], *_ros_arguments((), parameters)],
                env=self.environment, cwd=self.folder, stdout=output, stderr=subprocess.STDOUT)
        self.children.append(child)
        return child

    def _output(self, node: str) -> Path:
        return self.folder / f'{node}_{len(self.children)}.txt'

    def said(self) -> str:
        """Return what the nodes printed."""
        return '\n'.join(f'{path.name}: {path.read_text()}'
                         for path in sorted(self.folder.glob('par4_*.txt')))

    def wait(self, condition: Callable[[], Any], what: str) -> Any:
        """Serve callbacks until the condition is true and return it."""
        end = time.monotonic() + DEADLINE
        while not (value := condition()):
            if time.monotonic() > end:
                pytest.fail(f'waited {DEADLINE:.0f} s for {what}; nodes said:\n{self.said()}')
            self.executor.spin_once(timeout_sec=0.05)
        return value

    def listen(self, topic: Topic, name: str | None = None) -> list:
        """Return a list to which every message of the topic will be added.

        All that wait are taken at once: a turn of the executor costs more than a message.
        """
        messages: list = []
        profile = qos_of(topic)
        if profile.depth > 1:
            profile.depth = UNHEARD

        def take(message: Any) -> None:
            messages.append(message)
            with subscription.handle:
                while waiting := subscription.handle.take_message(subscription.msg_type, False):
                    messages.append(waiting[0])

        subscription = self.node.create_subscription(message_type(topic), name or topic.name, take,
                                                     profile)
        return messages

    def drain(self, messages: list) -> None:
        """Serve callbacks until no more of these messages wait: a busy client lags behind."""
        seen = -1
        while len(messages) > seen:
            seen = len(messages)
            for _ in range(100):
                self.executor.spin_once(timeout_sec=0.005)

    def publisher(self, topic: Topic, listeners: int = 1, depth: int | None = None) -> Publisher:
        """Return a publisher of the topic that so many nodes, or more, listen to.

        Of what is not heard yet it keeps `depth` messages, by default as many as the nodes do.
        """
        profile = qos_of(topic)
        profile.depth = depth or profile.depth
        publisher = self.node.create_publisher(message_type(topic), topic.name, profile)
        self.wait(lambda: publisher.get_subscription_count() >= listeners,
                  f'subscribers of {topic.name}')
        return publisher

    def until_answered(self, ask: Callable[[], None], answers: list) -> Any:
        """Ask again and again until there is an answer; return the first."""
        end = time.monotonic()

        def answered() -> bool:
            nonlocal end
            if not answers and time.monotonic() > end:
                ask()
                end = time.monotonic() + 0.5
            return bool(answers)

        self.wait(answered, 'an answer')
        return answers[0]

    def call(self, service: str) -> Trigger.Response:
        """Return the response of a Trigger service."""
        client = self._clients.get(service)
        if client is None:  # once: an answer to a client that its server has not met yet is lost
            client = self._clients[service] = self.node.create_client(Trigger, service)
        self.wait(client.service_is_ready, service)
        future = client.call_async(Trigger.Request())
        self.wait(future.done, f'the response of {service}')
        return future.result()

    def statuses(self, diagnostics: list, node: str) -> list:
        """Return the status of a node in each of its /diagnostics."""
        return [message.status[0] for message in diagnostics
                if message.status[0].name == f'/{node}']

    def reports(self, diagnostics: list, node: str) -> list[dict[str, int]]:
        """Return the counts of a node in each of its /diagnostics, but for what it received."""
        return [{pair.key: int(pair.value) for pair in status.values
                 if pair.value.isdigit() and not pair.key.endswith('_received')}
                for status in self.statuses(diagnostics, node)]

    def counts(self, diagnostics: list, node: str) -> dict[str, int]:
        """Return the newest counts of a node on /diagnostics, empty if there are none."""
        return (self.reports(diagnostics, node) or [{}])[-1]

    def ended(self, child: ForkedNode | subprocess.Popen) -> int:
        """Return the exit code of a node that is ending."""
        self.wait(lambda: child.poll() is not None, 'the end of a node')
        return child.returncode

    def close(self) -> None:
        """End the client and every node that still runs."""
        for child in self.children:
            if child.poll() is None:
                child.send_signal(signal.SIGCONT)
                child.terminate()
        for child in self.children:
            try:
                child.wait(timeout=20)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        self._domain.leave()


def _ros_arguments(remap: tuple[str, ...], parameters: dict[str, Any]) -> list[str]:
    """Return the command line that gives a node these parameters and names."""
    arguments = [part for name, value in parameters.items() for part in ('-p', f'{name}:={value}')]
    arguments += [part for rule in remap for part in ('-r', rule)]
    return [*(['--ros-args'] if arguments else []), *arguments]


def joint_state(q, stamp_ns: int = SECOND, names=JOINT_NAMES) -> JointState:
    """Return a joint state with its joints in the order of `names`."""
    message = JointState()
    message.name = list(names)
    values = dict(zip(JOINT_NAMES, q, strict=True))
    write_joint_state(message, stamp_ns, [values.get(name, 0.5) for name in names])
    return message


def quintic_motion(end_q: np.ndarray, period: float = 2e-3) -> Motion:
    """Return a smooth motion in joint space from home."""
    length = float(np.abs(end_q - HOME_Q).max())
    law = Quintic(length, 1.0, 6.0)
    t = np.arange(int(law.duration / period) + 2) * period
    way = (end_q - HOME_Q) / length
    s, sd, sdd = law.sample(t)
    return motion_of_joints('quintic', ROBOT.geometry, t, HOME_Q + np.outer(s, way),
                            np.outer(sd, way), np.outer(sdd, way))


def reference_message(motion: Motion, stamp_ns: int, effort: np.ndarray | None = None
                      ) -> JointTrajectory:
    message = JointTrajectory()
    write_trajectory(message, JointTrajectoryPoint, Trajectory(
        stamp_ns, np.rint(motion.t * SECOND).astype(np.int64), motion.q, motion.qd, motion.qdd,
        effort))
    return message


def torque_of(model: str | Path, motion: Motion) -> np.ndarray:
    return read_model(model, ROBOT).torque(
        state_of_joints(ROBOT.geometry, motion.t, motion.q, motion.qd, motion.qdd))


def torque_steps(voltages: list, since_ns: int) -> np.ndarray:
    """Return how much the commanded torques change within a millisecond, N m, (n, 4)."""
    told = {time_ns(message.header.stamp): GAIN * joint_values(message, 'effort')
            for message in voltages}
    stamps = np.array(sorted(stamp for stamp in told if stamp >= since_ns))
    torque = np.array([told[stamp] for stamp in stamps])
    return np.abs(np.diff(torque, axis=0))[np.diff(stamps) == MILLISECOND]


EVERY_MILLISECOND = {'publish_rate_hz': 1000.0}
"""What the simulation publishes by default; for tests that look at each sample."""
SELDOM = {'publish_rate_hz': 200.0}
"""For all other tests: hearing a thousand samples a second takes longer than simulating them."""


class Simulated:
    """A running simulation and what it publishes, `SELDOM` unless told otherwise.

    The bench hears every sample, however late it gets its turn: both sides keep what is `UNHEARD`.
    """

    def __init__(self, bench: Bench, **parameters: Any) -> None:
        self.bench = bench
        self.diagnostics = bench.listen(DIAGNOSTICS)
        self.states = bench.listen(JOINT_STATES)
        kept = {f'qos_overrides./{name}.publisher.depth': UNHEARD for name in (
            JOINT_STATES.name, AMPLIFIER_VOLTAGE.name, 'par4_simulation/true_pose')}
        self.child = bench.start('par4_simulation',
                                 **({'fidelity': 'exact'} | SELDOM | kept | parameters))
        self.now_ns()

    def now_ns(self) -> int:
        """Return the time of the newest sample that was heard; the simulation may be far ahead."""
        self.bench.wait(lambda: self.states, 'joint_states')
        return time_ns(self.states[-1].header.stamp)

    def wait_until(self, end_ns: int) -> None:
        self.bench.wait(lambda: self.now_ns() >= end_ns, f'simulated time {end_ns}')

    def positions(self) -> dict[int, np.ndarray]:
        return {time_ns(message.header.stamp): joint_values(message, 'position')
                for message in self.states}

    def newest(self) -> DiagnosticArray:
        """Return the newest diagnostics of the simulation."""
        return next(message for message in reversed(self.diagnostics)
                    if message.status[0].name == '/par4_simulation')

    def measures(self) -> dict[str, str]:
        """Return what the newest diagnostics of the simulation tell, by name."""
        return {pair.key: pair.value for pair in self.newest().status[0].values}

    def pause(self) -> None:
        """Let the clock stand, and hear all that was published before."""
        assert self.bench.call('/par4_simulation/pause').success
        self.diagnostics.clear()
        self.bench.wait(lambda: any(status.message.startswith('paused') for status in
                                    self.bench.statuses(self.diagnostics, 'par4_simulation')),
                        'the simulation to tell that it is paused')
        self.wait_until(time_ns(self.newest().header.stamp))

    def resume(self) -> None:
        """Let the clock go on."""
        assert self.bench.call('/par4_simulation/resume').success

    def current_ns(self) -> int:
        """Return the time of the simulation, all that was published before being heard."""
        self.pause()
        now_ns = self.now_ns()
        self.resume()
        return now_ns

    @contextmanager
    def standing(self, **messages: int) -> Iterator[None]:
        """Let the clock stand until so many messages, by topic, have come: nothing can be late."""
        self.pause()

        def received() -> Counter[str]:
            told = self.measures()
            return Counter({name: int(told[f'{name}_received']) for name in messages})

        before = received()
        yield
        self.bench.wait(lambda: self.fresh_counts() and received() - before >= Counter(messages),
                        f'the simulation to hear {messages}')
        self.resume()

    def fresh_counts(self) -> dict[str, int]:
        """Return counts published from now on."""
        self.diagnostics.clear()
        return self.bench.wait(
            lambda: self.bench.counts(self.diagnostics, 'par4_simulation'), 'diagnostics')
