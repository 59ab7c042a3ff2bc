"""Node `par4_feedforward`: reference -> feedforward_torque."""

from __future__ import annotations

import sys

import numpy as np

from par4_dynamics.model import read_model
from par4_dynamics.ros.feedforward_parameters import FeedforwardParameters
from par4_kinematics.geometry import LEGS
from par4_kinematics.interface import FEEDFORWARD_TORQUE, REFERENCE
from par4_kinematics.limits import check_points, check_torque
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import read_robot
from par4_kinematics.ros.convert import Trajectory
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.process import run
from par4_kinematics.ros.serialised_trajectory import SerialisedTrajectory, serialised_rest
from par4_kinematics.workspace import home_pose


class FeedforwardNode(Par4Node):
    """The node `par4_feedforward`; `FeedforwardParameters` says what it does."""

    REST, LOOKS = 0.0005, 20
    PARAMETERS = FeedforwardParameters
    parameters: FeedforwardParameters

    def __init__(self) -> None:
        super().__init__()
        self._robot = read_robot(self.parameters.robot_file)
        self._model = read_model(self.parameters.model_file, self._robot)
        # compile before anyone can find this node: the first torque must not come seconds late
        home = inverse_kinematics(self._robot.geometry, home_pose(self._robot))
        for count in (1, 2):
            self._answer(serialised_rest(home, count))
        self._publisher = self.publisher_of(FEEDFORWARD_TORQUE)
        self.subscribe(REFERENCE, self._on_reference, raw=True)
        self.serve('~/reload_model', self._reload_model)
        self.get_logger().info(f'torques of {self.parameters.model_file} for robot '
                               f'{self._robot.name}')

    def _torque(self, points: Trajectory) -> np.ndarray:
        """Return the torques (n, 4), N m, of the points; a stream of single ones is quick."""
        q, qd, qdd = points.motion()
        if len(q) == 1:
            q, qd, qdd = q[0], qd[0], qdd[0]
        times = points.times(points.stamp_ns).reshape(q.shape[:-1])
        return self._model.torque_of_joints(self._robot.geometry, q, qd, qdd,
                                            times).reshape(-1, LEGS)

    def _reload_model(self) -> str:
        self._model = read_model(self.parameters.model_file, self._robot)
        return f'read {self.parameters.model_file}'

    def _on_reference(self, message: bytes) -> None:
        self._publisher.publish(self._answer(message))

    def _answer(self, message: bytes) -> bytes:
        """Return a serialised reference with its torques."""
        reference = SerialisedTrajectory(message)
        points = reference.read()
        check_points(self._robot, *points.motion())
        effort = self._torque(points)
        limit = self._model.limit_of_drives(self._robot)
        check_torque(self._robot, effort, self.parameters.torque_factor * limit)
        return reference.with_effort(effort)


def main() -> int:
    """Run the node; return its exit code."""
    return run(FeedforwardNode)


if __name__ == '__main__':
    sys.exit(main())
