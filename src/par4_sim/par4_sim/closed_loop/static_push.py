"""The paper's static push on a fixed force sensor, simulated: a bag and a file of force readings.

Over several places the platform is lowered on a plate, slowly enough to be static, deeper until it
presses with the force asked, and raised again. Friction points up in one direction and down in the
other, so that pushes both ways tell it from the torque that carries the force.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from par4_dynamics.model import Model
from par4_kinematics.errors import InputError
from par4_kinematics.files import write_text
from par4_kinematics.motion import Motion, check_limits, waypoints_motion
from par4_kinematics.robot import Robot
from par4_kinematics.time_laws import require_positive
from par4_kinematics.workspace import home_pose
from par4_sim.closed_loop.force_plate import ForcePlate
from par4_sim.closed_loop.offline import simulate_to_bag
from par4_sim.closed_loop.simulation import build_simulation

FORCE_COLUMNS = ('t', 'fx', 'fy', 'fz')
"""Header of a file of force readings: stamp, s, on the clock of the bag, and the force on D, N."""
HOVER = 2e-3
"""Height over the plate from which pushes begin, m."""
SPEED = 6e-3
"""Speed of D during pushes, m/s: acceleration and viscous friction are negligible."""


def push_poses(robot: Robot) -> np.ndarray:
    """Return five poses (5, 4) on a plate: its middle, and towards each leg.

    It lies half-way between home and the bottom of the workspace.
    """
    azimuth = np.array(robot.geometry.actuator_azimuth)
    poses = np.zeros((5, 4))
    poses[1:, :2] = 0.4 * robot.limits.workspace.radius * np.stack(
        (np.cos(azimuth), np.sin(azimuth)), axis=1)
    poses[:, 2] = 0.5 * (home_pose(robot)[2] + robot.limits.workspace.z[0])
    poses[:, 3] = 0.5 * robot.limits.workspace.theta * np.array((0.0, 1.0, -1.0, 1.0, -1.0))
    return poses


def push_motion(robot: Robot, poses: np.ndarray, depth: float, pushes: int = 2) -> Motion:
    """Return `pushes` slow pushes, m deep, on each of the poses (n, 4), which lie on the plate.

    Raises:
        InputError: sizes that are not positive, or poses outside the robot's limits.
        UnreachableError: a pose that a leg cannot reach.
    """
    require_positive({'depth': depth, 'pushes': pushes}, 'static push')
    parts: list[Motion] = []
    up, down = np.array((0.0, 0.0, HOVER, 0.0)), np.array((0.0, 0.0, -depth, 0.0))
    for index, pose in enumerate(poses):
        if index:
            parts.append(waypoints_motion(robot, (poses[index - 1] + up, pose + up), speed=0.3,
                                          acceleration=2.0, jerk=50.0))
        parts.append(waypoints_motion(
            robot, [pose + up, *([pose + down, pose + up] * pushes)], speed=SPEED,
            acceleration=20.0 * SPEED, jerk=800.0 * SPEED))
    ends = np.cumsum([0.0, *(part.t[-1] + part.period for part in parts)])
    motion = Motion(
        'static push', np.concatenate([part.t + end for part, end in zip(parts, ends)]),
        *(np.concatenate([getattr(part, name) for part in parts])
          for name in ('q', 'qd', 'qdd', 'x', 'xd', 'xdd')))
    check_limits(motion, robot)
    return motion


def simulate_push(robot: Robot, model: Model, bag: str | Path, readings: str | Path,
                  force: float = 250.0, fidelity: str = 'exact', seed: int = 0,
                  torque_noise: float = 0.0, force_noise: float = 0.0,
                  poses: np.ndarray | None = None, pushes: int = 2,
                  progress: Callable[[float], object] | None = None) -> None:
    """Write the bag of static pushes on a force plate, and its readings as CSV.

    Args:
        robot: geometry, drives, limits.
        model: the machine as it truly is.
        bag: path, which must not exist.
        readings: path of the CSV with the header `FORCE_COLUMNS`, which must not exist either.
        force: largest, N.
        fidelity: of the plant.
        seed: of the noise.
        torque_noise: on the recorded voltage, as torque, N m rms.
        force_noise: of the readings, N rms.
        poses: (n, 4) on the plate, all of one height; by default `push_poses`.
        pushes: on each pose.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: bag or readings exist or cannot be written, or poses outside the robot's limits.
        UnreachableError: a pose that a leg cannot reach.
    """
    for path in map(Path, (bag, readings)):
        if path.exists():
            raise InputError(f'{path}: exists already; give another path or remove it')
    poses = push_poses(robot) if poses is None else np.asarray(poses, dtype=float)
    if np.ptp(poses[:, 2]) > 0.0:
        raise InputError(f'static push: poses at heights {sorted(set(poses[:, 2].tolist()))}; the '
                         f'plate is level, give one height')
    plate = ForcePlate(robot.geometry, float(poses[0, 2]), noise=force_noise, seed=seed)
    motion = push_motion(robot, poses, force / plate.stiffness, pushes)
    simulation = build_simulation(robot, model, fidelity, seed=seed, loads=(plate,),
                                  torque_noise=torque_noise)
    started = simulation.time  # stamp at which the plant's time is zero
    simulate_to_bag(simulation, motion, robot, bag, progress=progress)
    told = plate.readings + (started, 0.0, 0.0, 0.0)
    try:
        write_text(readings, '\n'.join((','.join(FORCE_COLUMNS), *(
            ','.join(map(repr, row)) for row in told.tolist()), '')))
    except InputError:
        shutil.rmtree(bag)  # which is of no use without them
        raise
