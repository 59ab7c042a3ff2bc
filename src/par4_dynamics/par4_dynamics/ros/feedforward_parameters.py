"""What the node `par4_feedforward` does and can be told: its help, apart from its work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from par4_kinematics.ros.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class FeedforwardParameters(NodeParameters):
    """Sends every reference back with the torque the model needs for it.

    A reference beyond the limits of robot.yaml, or that takes more torque than the drives have, is
    refused. What friction remembers goes on from reference to reference by their stamps:
    `presliding` from the point before, `friction_drift` from the first reference since the model
    was read.
    """

    NAME: ClassVar[str] = 'par4_feedforward'
    EXAMPLE: ClassVar[str] = '-p model_file:=identified/model.yaml -p use_sim_time:=true'

    robot_file: str = parameter('reference', 'robot.yaml: a path or a built-in name')
    model_file: str = parameter('table1', 'model.yaml: a path or a built-in name')
    torque_factor: float = parameter(
        1.0, 'by how much a torque may exceed the limit of the drives; above 1 for drives that '
             'look ahead (controller predictive), which are to know what is asked of them', 1.0)
