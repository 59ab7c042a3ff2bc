"""References one by one at 1 kHz, and 10^5 points at once: what the simulation loses by them.

Starts `par4_simulation` and `par4_feedforward` in a domain of their own and prints what their
diagnostics tell, how long after a reference its torque is there, how much of it came before it was
due, and the processor time of a reference. The last lines hold that against what is asked: they
mean something on an idle machine only, so the load is told first; processor time hardly depends on
it.
"""

from __future__ import annotations

import argparse
import os
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from par4_kinematics.interface import CLOCK, DIAGNOSTICS, FEEDFORWARD_TORQUE, REFERENCE, Topic
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import read_robot
from par4_kinematics.ros.convert import Trajectory, write_trajectory
from par4_kinematics.ros.qos import qos_of
from par4_kinematics.stamps import SECOND
from par4_kinematics.workspace import home_pose

LEAD = 0.5
"""Seconds ahead of the clock."""
PERIOD = 1e-3
IDLE = 5.0
"""Seconds for which the nodes are watched before the stream."""
ASKED_P99 = 3.0
"""Milliseconds from a reference to its torque, 99 % of them, on an idle machine."""
NODES = {'par4_sim.ros.simulation_node': (),
         'par4_dynamics.ros.feedforward_node': ('-p', 'use_sim_time:=true')}


def first_time_ns(message: bytes) -> int:
    """Return the time with which a serialised message begins: its stamp, or that of the clock."""
    seconds, nanoseconds = struct.unpack_from('<iI', message, 4)
    return seconds * SECOND + nanoseconds


class Client:
    """Publishes references and notes what comes back.

    No executor: a turn of one costs more than all that is done here, and would be measured.
    """

    def __init__(self) -> None:
        self.node = rclpy.create_node('streaming')
        self.references = self.node.create_publisher(JointTrajectory, REFERENCE.name,
                                                     qos_of(REFERENCE))
        self.clock_ns, self.status, self.sent = 0, {}, {}
        self.delays, self.ahead = [], []
        self._streams = [self._stream(*stream) for stream in (
            (CLOCK, Clock, True, self._clock), (DIAGNOSTICS, DiagnosticArray, False, self._told),
            (FEEDFORWARD_TORQUE, JointTrajectory, True, self._torque))]
        self.home = inverse_kinematics(read_robot('reference').geometry,
                                       home_pose(read_robot('reference')))

    def _stream(self, topic: Topic, kind: type, raw: bool, take: Callable[[Any, int], None]
                ) -> tuple[Any, type, bool, Callable[[Any, int], None]]:
        subscription = self.node.create_subscription(kind, topic.name, lambda _: None,
                                                     qos_of(topic), raw=raw)
        return subscription.handle, kind, raw, take

    def _clock(self, message: bytes, _received_ns: int) -> None:
        self.clock_ns = first_time_ns(message)

    def _told(self, message: DiagnosticArray, _received_ns: int) -> None:
        status = message.status[0]
        self.status[status.name] = {'says': status.message,
                                    **{pair.key: pair.value for pair in status.values}}

    def _torque(self, message: bytes, received_ns: int) -> None:
        stamp_ns = first_time_ns(message)
        sent_ns = self.sent.pop(stamp_ns, None)
        if sent_ns is not None:
            self.delays.append((received_ns - sent_ns) / SECOND)
            self.ahead.append((stamp_ns - self.clock_ns) / SECOND)

    def wave(self, start_ns: int, count: int) -> JointTrajectory:
        """Return a slow wave of `count` points that begins at `start_ns`."""
        after = np.arange(count) * round(PERIOD * SECOND)
        t = (start_ns + after) / SECOND
        wave = np.outer(np.sin(t), np.full(4, 0.05))
        message = JointTrajectory()
        write_trajectory(message, JointTrajectoryPoint, Trajectory(
            start_ns, after, self.home + wave, np.outer(np.cos(t), np.full(4, 0.05)), -wave))
        return message

    def publish(self, message: JointTrajectory) -> None:
        """Publish a reference and note when."""
        stamp = message.header.stamp
        self.sent[stamp.sec * SECOND + stamp.nanosec] = time.time_ns()
        self.references.publish(message)

    def spin(self, seconds: float) -> None:
        """Take what comes."""
        end = time.monotonic() + seconds
        while True:
            for handle, kind, raw, take in self._streams:
                with handle:
                    while (taken := handle.take_message(kind, raw)) is not None:
                        take(taken[0], taken[1]['received_timestamp'])
            if (left := end - time.monotonic()) <= 0.0:
                return
            # leaves the cores to the nodes that are measured; receipt is stamped by the middleware
            time.sleep(min(left, PERIOD))

    def report(self, title: str) -> None:
        """Print what the nodes told last."""
        self.spin(2.5)
        print(title)
        for name, told in sorted(self.status.items()):
            print(f'  {name}: {told}')


def judged(what: str, found: float, asked: float) -> bool:
    """Print a figure beside the largest that is asked and return whether it is kept."""
    kept = found <= asked
    print(f'  {what}: {found:.4g}, at most {asked:g} asked: {"kept" if kept else "MISSED"}')
    return kept


def judge(client: Client, count: int, behind: float, stall: float) -> bool:
    """Print what is asked of a stream of `count` references and return whether all is kept."""
    if not client.delays:
        print('no reference was answered')
        return False
    delays, ahead = 1e3 * np.array(client.delays), np.array(client.ahead)
    missing = sum(int(told.get(name, 0)) for told in client.status.values()
                  for name in ('missed_messages', 'late_points'))
    print(f'load of this machine now {os.getloadavg()[0]:.2f}, {os.cpu_count()} cores; this client '
          f'fell behind its own beat by {1e3 * behind:.1f} ms at the most')
    print(f'  torque there after p50 {np.percentile(delays, 50):.2f} ms, longest '
          f'{delays.max():.1f} ms; the latest came {1e3 * ahead.min():.0f} ms before it was due')
    return all((judged('p99 of torque there after, ms', np.percentile(delays, 99), ASKED_P99),
                judged('references without an answer', count - len(delays), 0),
                judged('torques that came after they were due', int((ahead < 0.0).sum()), 0),
                judged('messages missed and points late, as told', missing, 0),
                judged('longest stand of the simulated clock, s', stall, 0.1)))


def processor_time(process: subprocess.Popen) -> float:
    """Return the seconds of a core that a running process has used (Linux)."""
    told = Path(f'/proc/{process.pid}/stat').read_text(encoding='utf-8')
    fields = told.rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def late_steps(client: Client, seconds: float) -> int:
    """Return how many late steps the simulation counts more after so many seconds."""
    def told() -> int:
        return int(next(told for name, told in client.status.items()
                        if name.endswith('par4_simulation')).get('late_steps', 0))

    before = told()
    client.spin(seconds)
    return told() - before


def main() -> None:
    """Run the two floods."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('seconds', nargs='?', type=float, default=30.0,
                        help='length of the stream, s (default 30; 600 is what is asked)')
    parser.add_argument('--strict', action='store_true', help='make a miss the exit code 1')
    asked = parser.parse_args()
    if not 0.1 <= asked.seconds <= 1e5:
        parser.error(f'seconds: expected 0.1 to 100000, found {asked.seconds:g}')
    kept = False
    print(f'load of this machine before {os.getloadavg()[0]:.2f}')
    os.environ |= {'ROS_DOMAIN_ID': '101', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    nodes = [subprocess.Popen([sys.executable, '-m', node, '--ros-args', *given,
                               '-p', 'fidelity:=exact'][:None if 'sim.' in node else -2])
             for node, given in NODES.items()]
    rclpy.init()
    client = Client()
    try:
        while client.references.get_subscription_count() < 2 or client.clock_ns == 0:
            client.spin(0.1)
            if any(node.poll() is not None for node in nodes):
                sys.exit('error: a node has ended; what it said stands above')
        client.spin(3.0)
        client.report('before')
        used = [processor_time(node) for node in nodes]
        client.spin(IDLE)
        idle = [1e3 * (processor_time(node) - before) * PERIOD / IDLE
                for node, before in zip(nodes, used, strict=True)]
        begun, begun_ns = time.monotonic(), client.clock_ns
        first_ns = (client.clock_ns + round(LEAD * SECOND)) // 1_000_000 * 1_000_000
        used, own = [processor_time(node) for node in nodes], time.process_time()
        count, behind, stall = round(asked.seconds / PERIOD), 0.0, 0.0
        seen_ns, seen = client.clock_ns, begun
        for index in range(count):
            client.publish(client.wave(first_ns + index * 1_000_000, 1))
            left = begun + (index + 1) * PERIOD - time.monotonic()
            behind = max(behind, -left)
            client.spin(max(0.0, left))
            if client.clock_ns != seen_ns:
                stall = max(stall, time.monotonic() - seen)
                seen_ns, seen = client.clock_ns, time.monotonic()
        took = time.monotonic() - begun
        print(f'{count} single points in {took:.2f} s, simulated '
              f'{(client.clock_ns - begun_ns) / SECOND:.2f} s')
        own = 1e3 * (time.process_time() - own) / count
        spent_ms = [1e3 * (processor_time(node) - before) / count
                    for node, before in zip(nodes, used, strict=True)]
        client.report('after the stream')
        for name, spent, without in zip(NODES, spent_ms, idle, strict=True):
            print(f'  {name} used {spent:.2f} ms of a core a reference; {without:.2f} ms in the '
                  f'same time without any')
        print(f'  this client used {own:.2f} ms')
        kept = judge(client, count, behind, stall)
        usual = late_steps(client, 10.0)
        # making the message takes seconds of a core, which are not those of sending it; what the
        # nodes tell is a second old. Much later, the way to its first point breaks limits
        message = client.wave(client.clock_ns + 10 * SECOND, 100_000)
        client.spin(2.5)
        client.publish(message)
        found = late_steps(client, 10.0)
        client.report('after 10^5 points in one message')
        kept = judged('late steps in 10 s with 10^5 points in a message, beyond those in 10 s '
                      'without', found - usual, 0) and kept
    finally:
        for node in nodes:
            node.terminate()
        for node in nodes:
            node.wait()
        rclpy.try_shutdown()
    if asked.strict and not kept:
        sys.exit(1)


if __name__ == '__main__':
    main()
