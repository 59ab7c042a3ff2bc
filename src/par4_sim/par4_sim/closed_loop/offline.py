"""A motion simulated into a bag without ROS: the same loop, the same topics."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np

from par4_dynamics.model import Model
from par4_dynamics.state import state_of_joints
from par4_kinematics.approach import with_approach
from par4_kinematics.errors import InputError
from par4_kinematics.files import written_atomically
from par4_kinematics.interface import (
    AMPLIFIER_VOLTAGE,
    FEEDFORWARD_TORQUE,
    JOINT_STATES,
    REFERENCE,
)
from par4_kinematics.motion import Motion
from par4_kinematics.robot import JOINT_NAMES, Robot
from par4_kinematics.stamps import SECOND
from par4_sim.bags.bag_writer import BagWriter
from par4_sim.closed_loop.simulation import Simulation

DWELL = 0.5
"""Seconds of rest before and after the motion: they show the noise of a resting machine."""
CHUNK = 0.25
"""Seconds of reference a message."""
AT_A_TIME = 200
"""Samples that are simulated before they are written."""


def simulate_to_bag(simulation: Simulation, motion: Motion, robot: Robot, path: str | Path,
                    feedforward: Model | None = None, storage: str = 'mcap',
                    progress: Callable[[float], object] | None = None, began: int = 0
                    ) -> dict[str, int]:
    """Write the bag of a motion and return the simulation's counts.

    Args:
        simulation: at rest at home; this function closes it, also where it raises.
        motion: that the drives follow. If it begins elsewhere, an approach from home comes first.
        robot: for the limits of the approach.
        path: of the bag, which must not exist; it appears only when complete.
        feedforward: model whose torques the drives get, or None.
        storage: 'mcap' or 'sqlite3'.
        progress: called with the share done, 0 to 1.
        began: stamp, ns, at which the simulation's clock was zero.

    Raises:
        InputError: the path exists, or the approach leaves the limits.
        UnreachableError: the drives moved the machine out of its workspace.
    """
    with closing(simulation):
        if Path(path).exists():
            raise InputError(f'{path}: exists already; give another path or remove it')
        motion = with_approach(motion, robot, simulation.q)
        start = simulation.time + DWELL
        tau = None if feedforward is None else feedforward.torque(
            state_of_joints(robot.geometry, motion.t, motion.q, motion.qd, motion.qdd))
        simulation.queue_reference(start + motion.t, motion.q, motion.qd, motion.qdd)
        if tau is not None:
            simulation.queue_effort(start + motion.t, tau)
        samples = round((motion.duration + 2.0 * DWELL) / simulation.sample_period)
        with (written_atomically(path, new=True) as scratch,
              BagWriter(scratch, storage, path) as bag):
            _write_references(bag, motion, tau, start, began)
            _write_samples(bag, simulation, samples, began, progress)
    return simulation.counts


def _write_references(bag: BagWriter, motion: Motion, tau: np.ndarray | None, start: float,
                      began: int) -> None:
    """Write the points of a motion that begins at `start`, s, and their torques (n, 4), N m."""
    chunk = max(1, round(CHUNK / motion.period))
    for first in range(0, len(motion.t), chunk):
        part = slice(first, first + chunk)
        stamp = began + round((start + motion.t[first]) * SECOND)
        after = np.round((motion.t[part] - motion.t[first]) * SECOND).astype(np.int64)
        # on the bag's clock each chunk is there half a second ahead of its first point
        received = max(1, stamp - SECOND // 2)
        points = (after, motion.q[part], motion.qd[part], motion.qdd[part])
        bag.write_trajectory(f'/{REFERENCE.name}', stamp, JOINT_NAMES, *points, received=received)
        if tau is not None:
            bag.write_trajectory(f'/{FEEDFORWARD_TORQUE.name}', stamp, JOINT_NAMES, *points,
                                 effort=tau[part], received=received)


def _write_samples(bag: BagWriter, simulation: Simulation, samples: int, began: int,
                   progress: Callable[[float], object] | None) -> None:
    """Simulate so many samples and write them."""
    for done in range(0, samples, AT_A_TIME):
        told = simulation.next_samples(min(AT_A_TIME, samples - done))
        for row, stamp in enumerate((began + told.time_ns).tolist()):
            bag.write_joint_state(f'/{JOINT_STATES.name}', stamp, JOINT_NAMES, told.q[row],
                                  told.qd[row], told.effort[row])
            bag.write_joint_state(f'/{AMPLIFIER_VOLTAGE.name}', stamp, JOINT_NAMES,
                                  effort=told.voltage[row])
        if progress:
            progress(done / samples)
