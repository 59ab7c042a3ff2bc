"""What the node `par4_motion` does and can be told: its help, apart from its work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from par4_kinematics.ros.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class MotionParameters(NodeParameters):
    """Plays a motion as `reference`: waits for clock, robot and a listener, sends, ends.

    Points go out a second ahead of the clock. If the robot stands elsewhere than the motion
    begins, a slow move takes it there first. A signal or ~/stop brakes on the path of the motion
    and ends. With motion:=action it plays goals of the action ~/follow_joint_trajectory until a
    signal ends it; ~/stop brakes the goal.
    """

    NAME: ClassVar[str] = 'par4_motion'
    EXAMPLE: ClassVar[str] = '-p motion:=adept -p duration:=5.0 -p use_sim_time:=true'

    robot_file: str = parameter('reference', 'robot.yaml: a path or a built-in name')
    motion: str = parameter('excitation', 'excitation, adept, circle or the path of a motion.yaml; '
                                          'action: goals of ~/follow_joint_trajectory')
    duration: float = parameter(0.0, 's, of a named motion; 0 = its own', 0.0)
    seed: int = parameter(0, 'of an excitation', 0)
    period: float = parameter(1e-3, 's between points, of a named motion; torque is interpolated '
                                      'linearly between them', 2e-4, 0.1)
    listeners: int = parameter(1, 'subscribers of reference to wait for: robot, feedforward, '
                                  'recorder', 1)
