"""What the node `par4_kinematics` does and can be told: its help, apart from its work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from par4_kinematics.ros.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class KinematicsParameters(NodeParameters):
    """Publishes the pose of D for every valid joint state, with its stamp."""

    NAME: ClassVar[str] = 'par4_kinematics'
    EXAMPLE: ClassVar[str] = '-p robot_file:=robot.yaml -p use_sim_time:=true'

    robot_file: str = parameter('reference', 'robot.yaml: a path or a built-in name')
