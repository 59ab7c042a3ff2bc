"""Node `par4_kinematics`: joint_states -> platform_pose."""

from __future__ import annotations

import sys

import numpy as np
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from par4_kinematics.geometry import HOME
from par4_kinematics.interface import JOINT_STATES, PLATFORM_POSE
from par4_kinematics.position import forward_kinematics
from par4_kinematics.robot import read_robot
from par4_kinematics.ros.convert import is_foreign, joint_values, time_ns, write_pose
from par4_kinematics.ros.kinematics_parameters import KinematicsParameters
from par4_kinematics.ros.node import Par4Node
from par4_kinematics.ros.process import run


class KinematicsNode(Par4Node):
    """The node `par4_kinematics`; `KinematicsParameters` says what it does."""

    AWAITS = (JOINT_STATES,)
    PARAMETERS = KinematicsParameters
    parameters: KinematicsParameters

    def __init__(self) -> None:
        super().__init__()
        self._geometry = read_robot(self.parameters.robot_file).geometry
        self._last_pose = np.array(HOME)
        self._message = PoseStamped()
        self._publisher = self.publisher_of(PLATFORM_POSE)
        self.subscribe(JOINT_STATES, self._on_joint_state, stream=True)

    def clock_jumped_back(self) -> None:
        """Look for the next pose from home: the robot may be anywhere."""
        self._last_pose = np.array(HOME)

    def _on_joint_state(self, message: JointState) -> None:
        if is_foreign(message):
            return
        q = joint_values(message, 'position')
        self._last_pose = forward_kinematics(self._geometry, q, start=self._last_pose)
        write_pose(self._message, time_ns(message.header.stamp), self._last_pose,
                   self._geometry.rotation_amplification)
        self._publisher.publish(self._message)


def main() -> int:
    """Run the node; return its exit code."""
    return run(KinematicsNode)


if __name__ == '__main__':
    sys.exit(main())
