"""What an excitation may ask of a machine, and how much of that a motion uses."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import State, state_of_platform
from par4_identification.excitation.request import ACCELERATION
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.acceleration import half_plate_accelerations
from par4_kinematics.errors import InputError
from par4_kinematics.excitation import FAST_SPEED_SHARE, reachable_region
from par4_kinematics.motion import Motion
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import require_positive
from par4_kinematics.workspace import home_pose

KINDS = ('workspace', 'joint position', 'joint speed', 'acceleration', 'torque')
TORQUE_SHARE = 0.9
"""Of the drives' torque that a model may ask for."""


@dataclass(frozen=True)
class MotionLimits:
    """Limits of a motion; the workspace is that of the quasi-random excitation.

    Attributes:
        middle: of the workspace, in `base`, (4,), m and rad.
        extent: radius of the cylinder of D, half its height, range of |theta - middle|, (3,).
        joint_position: lowest and highest, rad.
        joint_speed: rad/s.
        acceleration: of either half plate (D and D'), m/s2.
        torque: of a joint, N m.
    """

    middle: np.ndarray
    extent: np.ndarray
    joint_position: tuple[float, float]
    joint_speed: float
    acceleration: float
    torque: float

    def slower(self, joint_speed: float, acceleration: float) -> MotionLimits:
        """Return the same limits with speed and acceleration at most so high."""
        return replace(self, joint_speed=min(joint_speed, self.joint_speed),
                       acceleration=min(acceleration, self.acceleration))

    def gentler(self, share: float) -> MotionLimits:
        """Return the same workspace with that share of speed, acceleration and torque."""
        return replace(self, joint_speed=share * self.joint_speed,
                       acceleration=share * self.acceleration, torque=share * self.torque)

    def within(self, share: float) -> MotionLimits:
        """Return that share of every limit, about the middle of its range."""
        low, high = self.joint_position
        spare = 0.5 * (1.0 - share) * (high - low)
        return replace(self.gentler(share), extent=share * self.extent,
                       joint_position=(low + spare, high - spare))

    def nearest(self, x: np.ndarray) -> np.ndarray:
        """Return the poses of the workspace nearest to poses x (n, 4), in each coordinate."""
        offset = x - self.middle
        radius = np.hypot(offset[:, 0], offset[:, 1])
        inward = np.minimum(1.0, self.extent[0] / np.maximum(radius, 1e-12))
        offset[:, :2] *= inward[:, None]
        offset[:, 2:] = np.clip(offset[:, 2:], -self.extent[1:], self.extent[1:])
        return self.middle + offset

    def loads(self, state: State, x: np.ndarray, tau: np.ndarray) -> dict[str, np.ndarray]:
        """Return the share of each limit that a motion uses, kind -> (n, k); 1 is the limit.

        Args:
            state: the motion.
            x: poses (n, 4) asked for, of which `state` has the nearest in the workspace.
            tau: torques (n, 4), N m.
        """
        offset = x - self.middle
        low, high = self.joint_position
        workspace = np.column_stack((np.hypot(offset[:, 0], offset[:, 1]), np.abs(offset[:, 2:])))
        return dict(zip(KINDS, (
            workspace / self.extent,
            np.abs(state.q - 0.5 * (low + high)) / (0.5 * (high - low)),
            np.abs(state.qd) / self.joint_speed,
            np.linalg.norm(half_plate_accelerations(
                *state.platform), axis=-1).T / self.acceleration,
            np.abs(tau) / self.torque), strict=True))


def largest_loads(limits: MotionLimits, motion: Motion, robot: Robot, model: Model
                  ) -> dict[str, float]:
    """Return the largest share of each limit that any sample of a motion uses, by kind."""
    state = State(motion.t, motion.q, motion.qd, motion.qdd, robot.geometry, motion.x, motion.xd,
                  motion.xdd)
    loads = limits.loads(state, motion.x, model.torque(state))
    return {kind: float(load.max()) for kind, load in loads.items()}


def limits_of(robot: Robot, model: Model, joint_speed: float | None = None,
              acceleration: float = ACCELERATION, torque: float | None = None) -> MotionLimits:
    """Return the limits of a robot: the workspace that its legs reach within their range.

    Args:
        robot: the machine.
        model: whose own torque limit rules where it has one.
        joint_speed: rad/s; None for that of the quasi-random excitation.
        acceleration: of either half plate, m/s2.
        torque: N m; None for nine tenths of what the drives have, the rest being for control.

    Raises:
        InputError: a value that is not positive, a speed or torque that the machine does not have,
            a speed of which no rows are used, a torque that does not even hold it, or workspace
            limits that its legs do not reach.
    """
    drives = model.limit_of_drives(robot)
    if joint_speed is None:
        joint_speed = FAST_SPEED_SHARE * robot.limits.joint_speed
    if torque is None:
        torque = TORQUE_SHARE * drives
    require_positive({'joint_speed': joint_speed, 'acceleration': acceleration,
                      'torque_limit': torque}, 'excitation design')
    for name, asked, most, unit in (('joint_speed', joint_speed, robot.limits.joint_speed, 'rad/s'),
                                    ('torque_limit', torque, drives, 'N m')):
        if asked > most:
            raise InputError(f'excitation design: {name} {asked:g} {unit} asked; robot '
                             f'{robot.name} has {most:g} {unit}; ask for less')
    if joint_speed <= (low := Conditioning().low_speed):
        raise InputError(f'excitation design: joint_speed {joint_speed:g} rad/s asked; rows are '
                         f'used above {low:g} rad/s only; allow more')
    home = home_pose(robot)
    region = reachable_region(robot, home)
    middle = home + region.middle
    still = np.zeros((1, len(robot.joint_names)))
    at_rest = state_of_platform(robot.geometry, np.zeros(1), middle[None], still, still)
    creeping = float((np.abs(model.torque(at_rest)[0]) + model.values['coulomb_friction']).max())
    if creeping >= torque:
        raise InputError(f'excitation design: torque_limit {torque:g} N m asked; holding and '
                         f'moving the platform at all takes {creeping:.3g} N m; allow more')
    return MotionLimits(
        middle, np.array((region.radius, region.half_height, region.theta)),
        robot.limits.joint_position, joint_speed, acceleration, torque)
