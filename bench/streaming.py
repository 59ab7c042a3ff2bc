"""References one by one at 1 kHz, and 10^5 points at once: what the simulation loses by them.

    python bench/streaming.py [SECONDS]

Starts `par4_simulation` and `par4_feedforward` in a domain of their own and prints what their
diagnostics tell, and how long before its time the torque of each reference was there.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from rosgraph_msgs.msg import Clock
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from par4_kinematics.interface import CLOCK, DIAGNOSTICS, FEEDFORWARD_TORQUE, REFERENCE
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import read_robot
from par4_kinematics.ros.convert import SECOND, Trajectory, time_ns, write_trajectory
from par4_kinematics.ros.qos import qos_of
from par4_kinematics.workspace import home_pose

LEAD = 0.5
"""Seconds ahead of the clock."""
PERIOD = 1e-3
NODES = {'par4_sim.ros.simulation_node': (),
         'par4_dynamics.ros.feedforward_node': ('-p', 'use_sim_time:=true')}


class Client:
    """Publishes references and notes what comes back."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('streaming')
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.references = self.node.create_publisher(JointTrajectory, REFERENCE.name,
                                                     qos_of(REFERENCE))
        self.clock_ns, self.status, self.sent, self.delays = 0, {}, {}, []
        for topic, kind, take in ((CLOCK, Clock, self._clock),
                                  (DIAGNOSTICS, DiagnosticArray, self._told),
                                  (FEEDFORWARD_TORQUE, JointTrajectory, self._torque)):
            self.node.create_subscription(kind, topic.name, take, qos_of(topic))
        self.home = inverse_kinematics(read_robot('reference').geometry,
                                       home_pose(read_robot('reference')))

    def _clock(self, message: Clock) -> None:
        self.clock_ns = time_ns(message.clock)

    def _told(self, message: DiagnosticArray) -> None:
        status = message.status[0]
        self.status[status.name] = {'says': status.message,
                                    **{pair.key: pair.value for pair in status.values}}

    def _torque(self, message: JointTrajectory) -> None:
        sent = self.sent.pop(time_ns(message.header.stamp), None)
        if sent is not None:
            self.delays.append(time.monotonic() - sent)

    def publish(self, start_ns: int, count: int) -> None:
        """Publish a slow wave of `count` points that begins at `start_ns`."""
        after = np.arange(count) * round(PERIOD * SECOND)
        t = (start_ns + after) / SECOND
        wave = np.outer(np.sin(t), np.full(4, 0.05))
        message = JointTrajectory()
        write_trajectory(message, JointTrajectoryPoint, Trajectory(
            start_ns, after, self.home + wave, np.outer(np.cos(t), np.full(4, 0.05)), -wave))
        self.sent[start_ns] = time.monotonic()
        self.references.publish(message)

    def spin(self, seconds: float) -> None:
        """Serve callbacks."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.002)

    def report(self, title: str) -> None:
        """Print what the nodes told last."""
        self.spin(2.5)
        print(title)
        for name, told in sorted(self.status.items()):
            print(f'  {name}: {told}')


def main() -> None:
    """Run the two floods."""
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    os.environ |= {'ROS_DOMAIN_ID': '77', 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    nodes = [subprocess.Popen([sys.executable, '-m', node, '--ros-args', *arguments,
                               '-p', 'fidelity:=exact'][:None if 'sim.' in node else -2])
             for node, arguments in NODES.items()]
    rclpy.init()
    client = Client()
    try:
        while client.references.get_subscription_count() < 2 or client.clock_ns == 0:
            client.spin(0.1)
        client.spin(3.0)
        client.report('before')
        begun, begun_ns = time.monotonic(), client.clock_ns
        first_ns = (client.clock_ns + round(LEAD * SECOND)) // 1_000_000 * 1_000_000
        count = round(seconds / PERIOD)
        for index in range(count):
            client.publish(first_ns + index * 1_000_000, 1)
            client.executor.spin_once(timeout_sec=0.0)
            time.sleep(max(0.0, begun + (index + 1) * PERIOD - time.monotonic()))
        took = time.monotonic() - begun
        print(f'{count} single points in {took:.2f} s, simulated '
              f'{(client.clock_ns - begun_ns) / SECOND:.2f} s')
        client.report('after the stream')
        delays = 1e3 * np.array(client.delays)
        print(f'torque there after: p50 {np.percentile(delays, 50):.2f} ms, p99 '
              f'{np.percentile(delays, 99):.2f} ms, of {len(delays)}')
        client.publish(client.clock_ns + 20 * SECOND, 100_000)
        client.report('after 10^5 points in one message')
        client.spin(5.0)
        client.report('later')
    finally:
        for node in nodes:
            node.terminate()
        for node in nodes:
            node.wait()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
