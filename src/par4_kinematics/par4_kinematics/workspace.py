"""Where a robot can go: reachable poses, its cylinder of limits, home, conditioning over it."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.arrays import as_rows
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import HOME, LEGS, Geometry
from par4_kinematics.position import inverse_sample
from par4_kinematics.reach import unreached_legs
from par4_kinematics.robot import Robot
from par4_kinematics.velocity import condition_number


@numba.njit(cache=True, error_model='numpy')
def _reachable_rows(packed, x, reached):
    angles = np.empty(LEGS)
    for row in range(x.shape[0]):
        reached[row] = inverse_sample(packed, x[row], angles) < 0


def reachable(geometry: Geometry, x: ArrayLike) -> np.ndarray:
    """Return whether all four legs reach the poses x (..., 4), booleans (...,).

    Raises:
        InputError: wrong shape or a value that is not finite.
    """
    rows, leading = as_rows(x, 'pose x')
    reached = np.empty(len(rows), dtype=np.bool_)
    _reachable_rows(geometry.packed, rows, reached)
    return reached.reshape(leading)


def inside(robot: Robot, x: ArrayLike) -> np.ndarray:
    """Return whether poses x (..., 4) keep the robot's workspace limits, booleans (...,).

    The limits are a cylinder for D and a range of |theta|. A pose within them may still be out of
    reach of a leg, see `reachable`.

    Raises:
        InputError: wrong shape or a value that is not finite.
    """
    rows, leading = as_rows(x, 'pose x')
    space = robot.limits.workspace
    low, high = space.z
    kept = ((np.hypot(rows[:, 0], rows[:, 1]) <= space.radius)
            & (rows[:, 2] >= low) & (rows[:, 2] <= high) & (np.abs(rows[:, 3]) <= space.theta))
    return kept.reshape(leading)


def home_pose(robot: Robot) -> np.ndarray:
    """Return the pose (4,), m and rad, where motions start.

    It is HOME if that lies within the robot's workspace limits, else the middle of these.

    Raises:
        InputError: the legs do not reach the middle of the robot's workspace limits.
    """
    home = np.array(HOME)
    if not (inside(robot, home) and reachable(robot.geometry, home)):
        home[2] = np.mean(robot.limits.workspace.z)
    if not reachable(robot.geometry, home):
        raise InputError(
            f'robot {robot.name}: the middle of its workspace (z {home[2]:.4g} m) is out of reach: '
            f'{unreached_legs(robot.geometry, home)}; set limits.workspace in its file to where it '
            f'can work')
    return home


def workspace_grid(robot: Robot) -> np.ndarray:
    """Return poses (n, 4) that span the robot's workspace limits, their boundary included."""
    space = robot.limits.workspace
    radius, azimuth, height, theta = (part.ravel() for part in np.meshgrid(
        np.linspace(0.0, space.radius, 6),
        np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False),
        np.linspace(*space.z, 8),
        np.linspace(-space.theta, space.theta, 9), indexing='ij'))
    return np.column_stack((radius * np.cos(azimuth), radius * np.sin(azimuth), height, theta))


@dataclass(frozen=True)
class PoseConditioning:
    """cond(J_x) over the workspace limits of a robot.

    Attributes:
        reachable_fraction: share of the poses that the legs reach.
        best, median, worst: condition number over the reachable poses.
        worst_pose: where it is worst, (4,).
    """

    reachable_fraction: float
    best: float
    median: float
    worst: float
    worst_pose: np.ndarray


def conditioning(robot: Robot) -> PoseConditioning:
    """Return a summary of the condition number over the robot's workspace limits.

    Raises:
        InputError: no pose of the workspace limits is reachable.
    """
    grid = workspace_grid(robot)
    reached = reachable(robot.geometry, grid)
    if not reached.any():
        raise InputError(f'robot {robot.name}: its legs reach no pose of its workspace limits; '
                         f'set limits.workspace in its file to where it can work')
    poses = grid[reached]
    condition = condition_number(robot.geometry, poses)
    worst = int(np.argmax(condition))
    return PoseConditioning(float(reached.mean()), float(condition.min()),
                            float(np.median(condition)), float(condition[worst]), poses[worst])
