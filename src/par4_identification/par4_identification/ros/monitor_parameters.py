"""What the node `par4_monitor` does and can be told: its help, apart from its work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from par4_identification.trend.windows import LEARNING
from par4_kinematics.ros.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class MonitorParameters(NodeParameters):
    """Compares measured with model torque and warns where a joint drifts away from its model.

    Learns for two minutes of motion how far apart the two are on this machine and its work. Torque
    is gain x amplifier_voltage where that is published, else the effort of joint_states.
    ~/reload_model reads the model again and learns anew.
    """

    NAME: ClassVar[str] = 'par4_monitor'
    EXAMPLE: ClassVar[str] = '-p model_file:=identified/model.yaml -p use_sim_time:=true'

    robot_file: str = parameter('reference', 'robot.yaml: a path or a built-in name')
    model_file: str = parameter('table1', 'model.yaml of the healthy machine: a path or a '
                                          'built-in name')
    learning: int = parameter(LEARNING, 'windows of 2 s of motion to learn from', 10)
