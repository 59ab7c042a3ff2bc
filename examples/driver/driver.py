"""A driver of a Par4 on one page: what a robot must do to work with these nodes. No simulation.

    python examples/driver/driver.py [--ros-args -r __ns:=/cell]

Replace `Amplifiers` by what talks to yours and give `ROBOT` its robot.yaml; the rest may stay. This
one stands for a machine that follows perfectly and takes the torque of TABLE 1. docs/hardware.md
explains each step.
"""

from __future__ import annotations

import signal
import sys
import time

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from par4_dynamics import read_model
from par4_kinematics import (
    AMPLIFIER_VOLTAGE,
    FEEDFORWARD_TORQUE,
    JOINT_NAMES,
    JOINT_STATES,
    REFERENCE,
    SECOND,
    START_DELAY,
    Par4Error,
    check_torque,
    home_pose,
    inverse_kinematics,
    limits_not_given,
    read_robot,
)
from par4_kinematics.ros.convert import read_trajectory, write_joint_state
from par4_kinematics.ros.qos import qos_of
from par4_sim import ReferenceQueue
from par4_sim.ros.compiled_limits import compiled_limits

PERIOD = 2e-3
BACKLOG = 250  # cycles that are made up for on a busy machine; those beyond are left out
REST = 0.3  # s at rest before the end, for all who listen
ROBOT = read_robot('reference')
GAIN = np.asarray(ROBOT.drives.gain)


class Amplifiers:
    """Yours. Here: a machine without error, at home."""

    def __init__(self) -> None:
        self._model = read_model('table1', ROBOT)
        self.q = inverse_kinematics(ROBOT.geometry, home_pose(ROBOT))
        self.volts = np.zeros(4)

    def cycle(self, q: np.ndarray, qd: np.ndarray, qdd: np.ndarray, _tau: np.ndarray) -> None:
        """Hand a target and its feedforward torque (4,) to the amplifiers and read them.

        This machine needs no help from the torque.
        """
        self.q = q
        self.volts = self._model.torque_of_joints(ROBOT.geometry, q, qd, qdd) / GAIN


class Driver:
    """Follows `reference` in real time; publishes joint_states and amplifier_voltage."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('driver')
        self.amplifiers = Amplifiers()
        self.limits = compiled_limits(ROBOT)  # a cycle could not wait for it
        # a reference that ends in motion ends in a ramp to rest: nobody else stops the machine
        self.queue = ReferenceQueue(self.amplifiers.q, self.limits)
        self.stopping = False
        self.followed = 0.0  # the newest cycle, s since the start
        self.began_ns = time.time_ns()  # doubles would not tell nanoseconds since 1970 apart
        for topic, take in ((REFERENCE, self.reference), (FEEDFORWARD_TORQUE, self.effort)):
            self.node.create_subscription(JointTrajectory, topic.name, take, qos_of(topic))
        self.states, self.voltages = (
            self.node.create_publisher(JointState, topic.name, qos_of(topic))
            for topic in (JOINT_STATES, AMPLIFIER_VOLTAGE))
        for line in limits_not_given(ROBOT):
            self.node.get_logger().warning(line)

    def times(self, points) -> np.ndarray:
        """Return the times of points, s since the start; a stamp of zero begins 0.2 s from now."""
        start_ns = points.stamp_ns or time.time_ns() + round(START_DELAY * SECOND)
        return points.times(start_ns - self.began_ns)

    def reference(self, message: JointTrajectory) -> None:
        """Queue points within the limits; say what is wrong with others."""
        if self.stopping:
            return
        try:
            points = read_trajectory(message)
            times = self.times(points)
            self.limits.check(times, np.hstack((points.q, points.qd, points.qdd)))
            self.queue.queue(self.followed, times, points.q, points.qd, points.qdd)
        except Par4Error as error:
            self.node.get_logger().error(f'{REFERENCE.name}: {error}')

    def effort(self, message: JointTrajectory) -> None:
        """Queue feedforward torques."""
        try:
            points = read_trajectory(message, ('effort',))
            check_torque(ROBOT, points.effort, ROBOT.drives.torque_limit)
            self.queue.queue_effort(self.times(points), points.effort)
        except Par4Error as error:
            self.node.get_logger().error(f'{FEEDFORWARD_TORQUE.name}: {error}')

    @property
    def now(self) -> float:
        """Seconds since the start."""
        return (time.time_ns() - self.began_ns) / SECOND

    def listen_until(self, now: float, executor: SingleThreadedExecutor) -> None:
        """Serve callbacks until a time, at least one: who is late must not be deaf as well."""
        while True:
            executor.spin_once(timeout_sec=max(0.0, now - self.now))
            if self.now >= now:
                return

    def cycle(self, now: float) -> None:
        """Read, publish, follow: once a period."""
        self.followed = now
        self.queue.foresee(now)
        target = self.queue.target(now)
        self.queue.use_until(now)
        self.amplifiers.cycle(target[:4], target[4:8], target[12:16], target[8:12])
        stamp_ns = self.began_ns + round(now * SECOND)  # when the values are valid
        state, volts = (JointState(name=list(JOINT_NAMES)) for _ in range(2))
        write_joint_state(state, stamp_ns, self.amplifiers.q, effort=GAIN * self.amplifiers.volts)
        write_joint_state(volts, stamp_ns, effort=self.amplifiers.volts)
        self.states.publish(state)
        self.voltages.publish(volts)


def main() -> None:
    """Run until SIGINT, SIGTERM or SIGHUP; then brake and end at rest."""
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    driver, asked = Driver(), []
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: asked.append(True))
    executor = SingleThreadedExecutor()
    executor.add_node(driver.node)
    rest_from, cycles = None, 0
    # all times are the cycles': on a busy machine the wall clock is ahead of what was followed
    while rest_from is None or cycles * PERIOD < rest_from + REST:
        cycles = max(cycles + 1, int(driver.now / PERIOD) - BACKLOG)
        now = cycles * PERIOD
        driver.listen_until(now, executor)
        if asked and rest_from is None:
            target = driver.queue.target(now)
            driver.stopping = True
            driver.queue.brake(now, target[:4], target[4:8])
            rest_from = driver.queue.end
        driver.cycle(now)
    speed = np.abs(driver.queue.target(now)[4:8]).max()
    driver.node.get_logger().info(f'stopped, joints at {speed:.3f} rad/s')
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
