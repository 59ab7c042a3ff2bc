"""How far a law of the drives is from instability, over the whole workspace.

On the joints the mechanism is M(q) qdd + ... = tau. M is symmetric and positive, and the loops
have the same gains on every joint; so the loops fall apart into four of one joint each, whose
inertias are the eigenvalues of M. Computed torque sees M^-1 M_model instead of M^-1; its loops
have the reciprocal eigenvalues of that. Each is a sampled loop: torque is held for a step, behind
the lag of the current; the derivative is the measured speed, as in the drives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from par4_dynamics.mechanism import joint_mass_matrix
from par4_dynamics.model import Model
from par4_kinematics.errors import InputError
from par4_kinematics.reach import unreached_legs
from par4_kinematics.robot import Drives, Robot
from par4_kinematics.workspace import reachable, workspace_grid
from par4_sim.drives.computed_torque import mean_inertia
from par4_sim.plants.plant import STEP

FREQUENCIES = 4000
"""Between 1 rad/s and half the sampling rate, evenly on a logarithmic scale."""
INERTIAS = 24
"""Between the smallest and the largest of the workspace."""
LARGEST_FACTOR = 1e3
"""Gain margins are looked for up to here."""


@dataclass(frozen=True)
class Gains:
    """Feedback torque = damping edot + stiffness e + integral times the integral of e.

    Per joint, N m s/rad, N m/rad, N m/(rad s); or per inertia, 1/s, 1/s2, 1/s3.
    """

    damping: float
    stiffness: float
    integral: float

    def scaled(self, factor: float) -> Gains:
        """Return all gains times a factor."""
        return Gains(factor * self.damping, factor * self.stiffness, factor * self.integral)

    def poles(self, inertia: float) -> np.ndarray:
        """Return the poles (3,), 1/s, of the loop in continuous time on an inertia."""
        return np.roots((inertia, self.damping, self.stiffness, self.integral))


@dataclass(frozen=True)
class Margin:
    """Distance of sampled loops from instability, the worst of several inertias.

    Attributes:
        modulus: smallest distance of the open loop from -1; the sensitivity peaks at its
            reciprocal.
        gain: factor by which all gains may rise.
        delay: further delay that may come into the loop, s.
        inertia: at which the modulus is smallest.
    """

    modulus: float
    gain: float
    delay: float
    inertia: float


def gains_of_loops(drives: Drives) -> Gains:
    """Return the gains of the paper's loops."""
    return Gains(drives.velocity_gain, drives.velocity_gain * drives.position_gain,
                 drives.velocity_gain * drives.integral_gain)


def gains_of_computed_torque(robot: Robot, model: Model) -> Gains:
    """Return the gains of computed torque, per inertia."""
    return gains_of_loops(robot.drives).scaled(1.0 / mean_inertia(robot, model))


def inertias_of_workspace(robot: Robot, machine: Model, known: Model | None = None) -> np.ndarray:
    """Return the inertias (n,) that the loops meet over the workspace limits, ascending.

    Args:
        robot: geometry and workspace.
        machine: as it truly is.
        known: model of computed torque, whose loops meet M relative to its own; None for the
            loops of the drives, which meet M itself, kg m2.

    Raises:
        InputError: no pose of the workspace limits is reachable.
    """
    grid = workspace_grid(robot)
    poses = grid[reachable(robot.geometry, grid)]
    if not len(poses):
        raise InputError(f'robot {robot.name}: its legs reach no pose of its workspace limits '
                         f'({unreached_legs(robot.geometry, grid[0])}); set limits.workspace in '
                         f'its file to where it can work')
    mass = joint_mass_matrix(robot.geometry, machine.lumped_bodies(), poses)
    if known is None:
        return np.sort(np.linalg.eigvalsh(mass).ravel())
    model = joint_mass_matrix(robot.geometry, known.lumped_bodies(), poses)
    return np.sort(np.linalg.eigvals(np.linalg.solve(model, mass)).real.ravel())


def margin_over(gains: Gains, inertias: np.ndarray, dt: float = STEP, lag: float = 0.0) -> Margin:
    """Return the worst margin of a law over a range of inertias.

    Args:
        gains: of the law.
        inertias: met, (n,); what counts is the range.
        dt: s between commands.
        lag: time constant of the current, s.
    """
    margins = [margin_at(gains, inertia, dt, lag)
               for inertia in np.geomspace(inertias.min(), inertias.max(), INERTIAS)]
    worst = min(margins, key=lambda margin: margin.modulus)
    return Margin(worst.modulus, min(margin.gain for margin in margins),
                  min(margin.delay for margin in margins), worst.inertia)


def margin_at(gains: Gains, inertia: float, dt: float = STEP, lag: float = 0.0) -> Margin:
    """Return the margin of the loop on one inertia; zeros where it is unstable."""
    if not is_stable(gains, inertia, dt, lag):
        return Margin(0.0, 0.0, 0.0, inertia)
    rate = np.geomspace(1.0, math.pi / dt, FREQUENCIES)
    opened = _open_loop(gains, inertia, dt, lag, np.exp(1j * rate * dt))
    size = np.abs(opened)
    crossings = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) <= 0.0)
    phase = np.angle(-opened[crossings]) % (2.0 * math.pi)
    delay = float(np.min(phase / rate[crossings], initial=math.inf))
    low, high = 1.0, 1.0
    while high < LARGEST_FACTOR and is_stable(gains.scaled(high), inertia, dt, lag):
        low, high = high, 1.5 * high
    while high / low > 1.0 + 1e-4:
        middle = math.sqrt(low * high)
        stable = is_stable(gains.scaled(middle), inertia, dt, lag)
        low, high = (middle, high) if stable else (low, middle)
    return Margin(float(np.abs(1.0 + opened).min()), low, delay, inertia)


def is_stable(gains: Gains, inertia: float, dt: float = STEP, lag: float = 0.0) -> bool:
    """Return whether the sampled loop on an inertia is stable: all poles inside the unit circle."""
    step, given = _held(inertia, dt, lag)
    size = len(given)
    closed = np.zeros((size + 1, size + 1))
    feedback = np.zeros(size)
    feedback[:2] = gains.stiffness, gains.damping
    closed[:size, :size] = step - np.outer(given, feedback)
    closed[:size, size] = -gains.integral * given
    closed[size, 0], closed[size, size] = dt, 1.0
    return bool(np.abs(np.linalg.eigvals(closed)).max() < 1.0)


def _open_loop(gains: Gains, inertia: float, dt: float, lag: float, z: np.ndarray) -> np.ndarray:
    """Return the open loop at points z (n,) of the unit circle."""
    step, given = _held(inertia, dt, lag)
    size = len(given)
    states = np.linalg.solve(z[:, None, None] * np.eye(size) - step, given[:, None])[..., 0]
    return (gains.stiffness + gains.integral * dt / (z - 1.0)) * states[:, 0] + (
        gains.damping * states[:, 1])


def _held(inertia: float, dt: float, lag: float) -> tuple[np.ndarray, np.ndarray]:
    """Return how position, speed and current move in a step, and what a held command adds."""
    if lag == 0.0:
        return (np.array(((1.0, dt), (0.0, 1.0))),
                np.array((0.5 * dt ** 2, dt)) / inertia)
    left = math.exp(-dt / lag)
    speed = lag * (1.0 - left)  # of a current that decays
    way = lag * (dt - speed)
    return (np.array(((1.0, dt, way / inertia), (0.0, 1.0, speed / inertia), (0.0, 0.0, left))),
            np.array(((0.5 * dt ** 2 - way) / inertia, (dt - speed) / inertia, 1.0 - left)))
