"""Imposed displacement: the torque that a simulated mechanism needs along a given motion.

The paper's experiment in Adams (IV.C): no drives, no control; the arms go where the motion says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from par4_dynamics.mechanism import LumpedBodies
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.motion import Motion
from par4_sim.choices import STEP
from par4_sim.description.chains import Fidelity
from par4_sim.drives.reference import TARGET, interpolate
from par4_sim.drives.reference_curve import COLUMNS
from par4_sim.machines.friction import Friction
from par4_sim.machines.machine import Machine

START_SPEED = 1e-3
"""rad/s up to which a motion begins at rest. To begin at speed means a blow whose echo takes the
engine some steps to close."""


@dataclass(frozen=True)
class ImposedRun:
    """What a mechanism needed; every row is valid at its time.

    Attributes:
        t: s since the start of the motion, (n,).
        q, qd, qdd: of the joints as realised, (n, 4): positions, and their central differences.
        torque: applied by the motors, (n, 4), N m.
        position_error: largest distance of a joint from where the motion wants it, rad.
        opening: of the loops at the end, m.
    """

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    qdd: np.ndarray
    torque: np.ndarray
    position_error: float
    opening: float


def imposed_run(geometry: Geometry, bodies: LumpedBodies, motion: Motion,
                fidelity: Fidelity = 'accurate', dt: float = STEP) -> ImposedRun:
    """Return what rigid bodies without friction need along a motion, in pybullet.

    The ends of the motion are left out: they have no central differences.

    Args:
        geometry: dimensions.
        bodies: masses; see `Machine`.
        motion: from rest; interpolated where its samples are not the physics steps.
        fidelity: of the plant.
        dt: physics step, s.

    Raises:
        InputError: the motion begins at speed, or the lumped masses leave a body without mass or
            inertia.
        UnreachableError: a motion that the mechanism cannot follow.
    """
    from par4_sim.plants.bullet import BulletPlant  # pybullet is slow to load

    fastest = float(np.abs(motion.qd[0]).max())
    if fastest > START_SPEED:
        raise InputError(f'motion {motion.name}: it begins at {fastest:.3g} rad/s, imposed motion '
                         f'begins at rest; let it start with a phase of acceleration')
    wanted = _positions(motion, dt)
    plant = BulletPlant(Machine(geometry, bodies, Friction()), fidelity, dt)
    try:
        plant.reset(motion.x[0])
        reached, torque = [plant.q], []
        for target in wanted[1:]:
            torque.append(plant.impose(target))
            reached.append(plant.q)
        opening = plant.loop_opening()
    finally:
        plant.close()
    q = np.array(reached)  # (steps + 1, 4)
    return ImposedRun(
        dt * np.arange(1, len(q) - 1), q[1:-1], (q[2:] - q[:-2]) / (2.0 * dt),
        (q[2:] - 2.0 * q[1:-1] + q[:-2]) / dt ** 2, np.array(torque)[1:],
        float(np.abs(q - wanted).max()), opening)


def _positions(motion: Motion, dt: float) -> np.ndarray:
    """Return joint positions (steps + 1, 4) of a motion at the physics steps, rad."""
    points = np.zeros((len(motion.t), COLUMNS))
    points[:, :3 * LEGS] = np.concatenate((motion.q, motion.qd, motion.qdd), axis=1)
    steps = max(2, math.floor(motion.duration / dt + 1e-9))
    target, positions = np.empty(TARGET), np.empty((steps + 1, LEGS))
    for step in range(steps + 1):
        interpolate(motion.t, points, step * dt, 0.0, target)
        positions[step] = target[:LEGS]
    return positions
