"""Node `par4_feedforward`: reference -> feedforward_torque."""

from __future__ import annotations

import sys

from par4_dynamics.feedforward import Feedforward
from par4_dynamics.model_from_file import read_model
from par4_dynamics.ros.feedforward_parameters import FeedforwardParameters
from par4_kinematics.interface import FEEDFORWARD_TORQUE, REFERENCE
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import read_robot
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.process import run
from par4_kinematics.ros.serialised_trajectory import SerialisedTrajectory, serialised_rest
from par4_kinematics.workspace import home_pose


class FeedforwardNode(Par4Node):
    """The node `par4_feedforward`; `FeedforwardParameters` says what it does."""

    REST, LOOKS = 0.0005, 20
    AWAITS = (REFERENCE,)
    PARAMETERS = FeedforwardParameters
    parameters: FeedforwardParameters

    def __init__(self) -> None:
        super().__init__()
        self._robot = read_robot(self.parameters.robot_file)
        self._read()
        # compile before anyone can find this node: the first torque must not come seconds late
        home = inverse_kinematics(self._robot.geometry, home_pose(self._robot))
        for count in (1, 2):
            self._answer(serialised_rest(home, count))
        self._publisher = self.publisher_of(FEEDFORWARD_TORQUE)
        self.subscribe(REFERENCE, self._on_reference, raw=True)
        self.serve('~/reload_model', self._reload_model)
        self.get_logger().info(f'torques of {self.parameters.model_file} for robot '
                               f'{self._robot.name}')

    def _read(self) -> None:
        model = read_model(self.parameters.model_file, self._robot)
        self._feedforward = Feedforward(self._robot, model, self.parameters.torque_factor)
        if self._feedforward.around:
            self.get_logger().warning(
                f'{", ".join(self._feedforward.around)} of {self.parameters.model_file}: this '
                f'torque follows from the motion around a point, so that a reference of a single '
                f'point gets none or a wrong one of it; send a motion in one reference')

    def _reload_model(self) -> str:
        self._read()
        return f'read {self.parameters.model_file}'

    def _on_reference(self, message: bytes) -> None:
        self._publisher.publish(self._answer(message))

    def _answer(self, message: bytes) -> bytes:
        """Return a serialised reference with its torques."""
        reference = SerialisedTrajectory(message)
        points = reference.read()
        return reference.with_effort(self._feedforward.effort(
            points.stamp_ns, points.from_start_ns, *points.motion()))


def main() -> int:
    """Run the node; return its exit code."""
    return run(FeedforwardNode)


if __name__ == '__main__':
    sys.exit(main())
