"""The paper's quasi-random excitation under the limits of a design, to compare with."""

from __future__ import annotations

from par4_dynamics.model import Model
from par4_identification.excitation.motion_limits import MotionLimits, largest_loads
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import excitation_motion
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot

SLOWER = 0.95
"""Factor by which speed and acceleration are lowered until the torque keeps its limit."""
TRIALS = 80


def quasi_random_within(robot: Robot, model: Model, limits: MotionLimits, duration: float,
                        seed: int) -> Motion:
    """Return the quasi-random excitation with the same limits, as fast as the torque allows.

    It fills the limit of speed or of acceleration by itself.

    Raises:
        InputError: too short, or a torque that is exceeded however slow it is.
    """
    share = 1.0
    for _ in range(TRIALS):
        motion = excitation_motion(robot, duration, seed, acceleration=share * limits.acceleration,
                                   joint_speed=share * limits.joint_speed)
        if largest_loads(limits, motion, robot, model)['torque'] <= 1.0:
            return motion
        share *= SLOWER
    raise InputError(f'excitation: quasi-random motions exceed a torque of {limits.torque:g} N m '
                     f'however slow; allow more')
