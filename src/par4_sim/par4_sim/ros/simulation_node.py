"""Node `par4_simulation`: the simulated Par4, paced by the wall clock, publishing its clock."""

from __future__ import annotations

import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.model_from_file import read_model
from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    CLOCK,
    FEEDFORWARD_TORQUE,
    JOINT_STATES,
    REFERENCE,
    ROBOT_DESCRIPTION,
    Topic,
)
from par4_kinematics.limits import EndSwitches, check_torque
from par4_kinematics.robot import read_robot
from par4_kinematics.ros.convert import Trajectory
from par4_kinematics.ros.diagnostics import ERROR, OK, WARN, NodeState
from par4_kinematics.ros.node import REPORT_PERIOD, Par4Node
from par4_kinematics.ros.process import run
from par4_kinematics.ros.serialised_trajectory import (
    SerialisedTrajectory,
    read_serialised_trajectory,
)
from par4_kinematics.stamps import SECOND
from par4_kinematics.workspace import home_pose
from par4_sim.choices import LOOKED_AHEAD, PREDICTIVE
from par4_sim.closed_loop.simulation import Sample, Simulation, build_simulation
from par4_sim.description.robot_description import complete_description
from par4_sim.drives.laws import KNOWING
from par4_sim.machines.machine_effects import read_true_model
from par4_sim.pictures.window import Window
from par4_sim.ros.compiled_limits import compiled_limits
from par4_sim.ros.kept_memory import keep_memory
from par4_sim.ros.pace import Pace
from par4_sim.ros.physics_loop import End, PhysicsLoop
from par4_sim.ros.sample_publisher import SamplePublisher
from par4_sim.ros.simulation_parameters import SimulationParameters
from par4_sim.ros.zero_stamp import ZeroStamps

SWITCH_INTERVAL = 2e-4
"""Seconds for which the thread of the callbacks may run while that of the physics waits."""
FAULT_PERIOD = 0.05
"""Seconds of wall time between looks for a fault: it is told at once, not with the next report."""
LEAST_REAL_TIME_FACTOR = 1e-3
"""Simulated seconds a second below which nothing seems to happen."""
RESET = 'reset: references are refused until one begins at rest'
"""State of a simulation after a restart."""
LATE_SHARE = 0.05
"""Share of late samples that is worth a warning."""
STRANGE_NS = 1000 * SECOND
"""A trajectory that starts farther ahead of the clock, or ended as long before it, was stamped by
another clock."""


class SimulationNode(Par4Node):
    """The node `par4_simulation`; `SimulationParameters` says what it does."""

    REST, LOOKS = 0.001, 10
    AWAITS = (REFERENCE,)
    PARAMETERS = SimulationParameters
    parameters: SimulationParameters

    def __init__(self) -> None:
        super().__init__()
        asked = self.parameters
        if 0.0 < asked.real_time_factor < LEAST_REAL_TIME_FACTOR:
            raise InputError(f'parameter real_time_factor: {asked.real_time_factor:g} is less than '
                             f'{LEAST_REAL_TIME_FACTOR:g}; give more, or 0 for as fast as it can')
        self._robot = read_robot(asked.robot_file)
        self.warn_of_limits_not_given(self._robot)
        self._window = None
        if asked.window:
            self._window = Window(self._robot, home_pose(self._robot))
            self.create_timer(1.0, self._notice_closed_window, clock=self.wall_clock)
        self._limits = compiled_limits(self._robot)
        simulation = self._build()
        self._samples = SamplePublisher(self, self._robot, self._description(),
                                        asked.publish_clock)
        self._pace = Pace(asked.real_time_factor, asked.fidelity, asked.physics_step)
        self._physics = PhysicsLoop(
            simulation, self._publish, lambda error: self.reject(REFERENCE, error),
            asked.real_time_factor, asked.feedforward_timeout, asked.following_error_limit,
            EndSwitches(self._robot), self._pace)
        self._fault = ''
        self._told_unaided = False
        self.create_timer(FAULT_PERIOD, self._tell_new_fault, clock=self.wall_clock)
        self.create_timer(REPORT_PERIOD, self._tell_unaided, clock=self.wall_clock)
        self._zero_stamps = ZeroStamps()
        self._published = 0
        self.subscribe(REFERENCE, self._on_reference, raw=True)
        self.subscribe(FEEDFORWARD_TORQUE, self._on_effort, raw=True)
        for name, action in (('reset', self._reset), ('reload_model', self._reload_model),
                             ('pause', self._pause), ('resume', self._resume),
                             ('stop', self._stop)):
            self.serve(f'~/{name}', action)
        self.get_logger().info(
            f'robot {self._robot.name}, machine {asked.model_file}, fidelity {asked.fidelity}, '
            f'{asked.publish_rate_hz:g} Hz, {asked.real_time_factor:g} x real time, '
            f'drives: {asked.law}')

    def _description(self) -> str:
        """Return the URDF, without masses where those of rods and bars do not fit the machine."""
        try:
            return complete_description(self._robot, read_model(
                self.parameters.model_file, self._robot).lumped_bodies())
        except InputError as error:
            self.get_logger().warning(f'{ROBOT_DESCRIPTION.name} without masses: {error}')
            return complete_description(self._robot)

    def _build(self) -> Simulation:
        asked = self.parameters
        model = read_true_model(asked.model_file, self._robot)
        return build_simulation(
            self._robot, model, asked.fidelity, 1.0 / asked.publish_rate_hz, asked.seed,
            torque_noise=asked.torque_noise, correlation_time=asked.noise_correlation_time,
            law=asked.law, known=self._known(), position_noise=asked.position_noise,
            stamp_jitter=asked.stamp_jitter, limits=self._limits,
            step=asked.physics_step)

    def _known(self) -> Model | None:
        """Return what the law of the drives knows of the machine, None where it needs nothing."""
        if self.parameters.law not in KNOWING:
            return None
        return read_model(self.parameters.controller_model, self._robot)

    def _publish(self, now_ns: int, sample: Sample) -> None:
        self._samples.publish(now_ns, sample)
        window = self._window  # another thread may let go of it
        if window is not None:
            window.show(sample.true_pose)

    def _notice_closed_window(self) -> None:
        if self._window is not None and not self._window.open:
            self._window = None
            self.get_logger().warning('the window is closed; the simulation goes on')

    def _on_reference(self, message: bytes) -> None:
        points = read_serialised_trajectory(message)
        self._limits.check(points.times(0), np.hstack(points.motion()))
        self._physics.queue_reference(self._start_ns(REFERENCE, points), points)

    def _on_effort(self, message: bytes) -> None:
        torques = SerialisedTrajectory(message)
        named = torques.stamp_ns == 0 and torques.tells('positions')
        points = torques.read(('effort', 'positions') if named else ('effort',))
        factor = LOOKED_AHEAD if self.parameters.law == PREDICTIVE else 1.0
        check_torque(self._robot, points.rows('effort'), factor * self._physics.torque_limit)
        self._physics.queue_effort(self._start_ns(FEEDFORWARD_TORQUE, points), points)

    def _start_ns(self, topic: Topic, points: Trajectory) -> int:
        """Return when a trajectory starts.

        Raises:
            InputError: another clock has stamped it.
        """
        now_ns = self._physics.now_ns
        start_ns = self._zero_stamps.start_ns(topic, points, now_ns)
        since_end_ns = now_ns - start_ns - int(points.from_start_ns[-1])
        if max(start_ns - now_ns, since_end_ns) > STRANGE_NS:
            away = (f'starts {(start_ns - now_ns) / SECOND:.4g} s ahead of' if start_ns > now_ns
                    else f'ended {since_end_ns / SECOND:.4g} s before')
            raise InputError(f'{away} the clock; set use_sim_time where it comes from')
        return start_ns

    def _reset(self) -> str:
        self._physics.restart()
        return 'at rest at home'

    def _reload_model(self) -> str:
        self._physics.restart(self._build())
        self._samples.describe(self._description())
        return f'read {self.parameters.model_file}; at rest at home'

    def _pause(self) -> str:
        self._physics.pause()
        return 'paused'

    def _resume(self) -> str:
        if self._physics.fault:
            raise InputError(self._physics.fault)
        self._physics.paused = False
        return 'running'

    def _stop(self) -> str:
        self.end()
        return 'stopping'

    def end(self) -> None:
        """End once the machine rests: its drives do not leave it in motion."""
        self._physics.end()

    def _tell_new_fault(self) -> None:
        """Tell on the diagnostics that there is a fault, or another, or none any more.

        Or that references are refused for another reason: who sends them may ask why.
        """
        fault = self._physics.fault or (RESET if self._physics.restarted else '')
        if self._fault != fault:
            self._fault = fault
            self.report()

    def _tell_unaided(self) -> None:
        """Say once that nobody gives torques, which is no fault."""
        if not self._told_unaided and self._unaided() and self._physics.counts['missing_effort']:
            self._told_unaided = True
            self.get_logger().info(f'no {FEEDFORWARD_TORQUE.name} comes: driven without it')

    def state(self) -> NodeState:
        """Return whether the simulation runs, and why if not."""
        physics = self._physics
        self._pace.measure(physics.now_ns, bool(physics.paused or physics.waiting))
        if physics.fault:
            return NodeState(ERROR, physics.fault)
        others = (self.clocks() if self.parameters.publish_clock else 0,
                  self.count_publishers(self.resolve_topic_name(AMPLIFIER_VOLTAGE.name)))
        for topic, count in zip((CLOCK, AMPLIFIER_VOLTAGE), others, strict=True):
            if count > 1:
                return NodeState(ERROR, f'{count} publish {topic.name}: another simulation or '
                                        f'robot is in this domain; give each a ROS_DOMAIN_ID',
                                 'one that was killed counts for some 20 s more')
        if physics.paused:
            return NodeState(WARN, 'paused')
        if physics.ending:
            return NodeState(WARN, 'ending: waits until the machine rests')
        if physics.waiting:
            return NodeState(WARN, f'waiting for {FEEDFORWARD_TORQUE.name}')
        if physics.unaided:
            return NodeState(WARN, f'running without {FEEDFORWARD_TORQUE.name}: waited '
                                   f'{self.parameters.feedforward_timeout:g} s in vain')
        if physics.restarted:
            return NodeState(WARN, RESET)
        if physics.starved:
            return NodeState(WARN, f'starved: {REFERENCE.name} ended in motion, braked')
        if self._pace.complaint:
            asked = self.parameters.real_time_factor
            return NodeState(WARN, f'running, too slow for {asked:g} x real time',
                             self._pace.complaint)
        return NodeState(OK, 'running')

    def measures(self) -> dict[str, str]:
        """Return the measured pace and the ages of the inputs."""
        return {'real_time_factor': f'{self._pace.factor:.3f}', **super().measures()}

    def worrying(self, new: dict[str, int]) -> bool:
        """Return whether new faults are worth a warning; late steps are above a share only."""
        published = self._samples.published[JOINT_STATES.name]
        share = new.get('late_steps', 0) / max(1, published - self._published)
        self._published = published
        return share > LATE_SHARE or bool(new.keys() - {'late_steps', *self._unaided()})

    def expected(self) -> tuple[str, ...]:
        """Return the faults that are not logged: that nobody gives torques is said once."""
        return (*super().expected(), *self._unaided())

    def _unaided(self) -> tuple[str, ...]:
        """Return what is no fault of a machine that has never had a feedforward torque."""
        return () if self._arrivals[FEEDFORWARD_TORQUE.name].received else ('missing_effort',)

    def now_ns(self) -> int:
        """Return the simulated time, ns."""
        return self._physics.now_ns

    def faults(self) -> dict[str, int]:
        """Return the counts of the node, the drives and the loop."""
        return dict(Counter(self._physics.counts) + Counter(super().faults()))

    def traffic(self) -> dict[str, int]:
        """Return how many messages were published, by topic."""
        return dict(self._samples.published)

    def work(self) -> None:
        """Simulate in this thread and serve callbacks in another until the node is finished."""
        sys.setswitchinterval(SWITCH_INTERVAL)
        with ThreadPoolExecutor(1) as thread:
            callbacks = thread.submit(self._serve_callbacks)
            try:
                while not (self.finished or self._physics.ended):
                    self._simulate()
                self._tell_end()
            finally:
                self.finished = True
        callbacks.result()

    def _serve_callbacks(self) -> None:
        keep_memory()
        try:
            super().work()
        finally:
            self.finished = True

    def _simulate(self) -> None:
        try:
            self._physics.run(lambda: self.finished)
        except UnreachableError as error:
            self.count('unreachable_poses')
            self._physics.fault = f'out of reach: {error}; paused: call ~/reset, then ~/resume'
            self._physics.paused = True

    def _tell_end(self) -> None:
        ended = self._physics.ended
        if ended in (End.BRAKED, End.IN_MOTION):
            self.get_logger().warning(f'asked to end in motion; ended {ended.value}')

    def close(self) -> None:
        """Release the plant and the window; who listens hears how it ended."""
        self._samples.close()
        self._physics.close()
        if self._window is not None:
            self._window.close()


def main() -> int:
    """Run the node; return its exit code."""
    return run(SimulationNode)


if __name__ == '__main__':
    sys.exit(main())
