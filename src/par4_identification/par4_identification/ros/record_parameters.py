"""What the node `par4_record` does and can be told: its help, apart from its work."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from par4_kinematics.ros.parameters import NodeParameters, parameter
from par4_sim.choices import REPAIR, STORAGES


@dataclass(frozen=True)
class RecordParameters(NodeParameters):
    """Records joint_states, amplifier_voltage, reference and feedforward_torque from its start.

    For programs that show a bag: platform_pose, robot_description and /diagnostics, too.
    ~/stop completes the bag, ~/start begins the next (OUTPUT_2 and so on). Publishers number
    their messages: a missing number is a lost message and is counted, for each publisher.
    `par4_record --repair BAG [--output OUT]` mends a bag that was cut off.
    """

    NAME: ClassVar[str] = 'par4_record'
    EXAMPLE: ClassVar[str] = '-p output:=node_bag -p use_sim_time:=true'

    output: str = parameter('recording', 'bag to write; it must not exist')
    duration: float = parameter(0.0, 's from the first message of the robot, on the ROS clock; 0 = '
                                     'until stopped', 0.0)
    storage: str = parameter('mcap', 'of the bag', choices=STORAGES)


def asked_to_mend(arguments: Sequence[str]) -> bool:
    """Return whether arguments ask `par4_record` to mend a bag instead of recording one."""
    return any(argument.split('=')[0] == REPAIR for argument in arguments)
