"""How far a law of the drives is from instability, over the whole workspace.

On the joints the mechanism is M(q) qdd + ... = tau = S command: M has the true bodies and
dimensions, S, diagonal, is the share of its command that a drive delivers. Both are symmetric and
positive, and the loops have the same gains on every joint; so the loops fall apart into four of one
joint each, whose inertias are the eigenvalues of S^-1 M. Computed torque sees M^-1 S M_model
instead of M^-1 S; its loops have the reciprocal eigenvalues of that, whose imaginary parts, of
second order in the differences between the joints, are left out. Each is a sampled loop: torque is
held for a step, behind the lags of current and actuators; the derivative is the measured speed, as
in the drives. Friction, which damps, and eccentric encoders are left out; with springs or gaps in
the transmissions none of this holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from par4_dynamics.mechanism import joint_mass_matrix
from par4_dynamics.model import Model
from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.reach import unreached_legs
from par4_kinematics.robot import Drives, Robot
from par4_kinematics.workspace import reachable, workspace_grid
from par4_sim.choices import STEP
from par4_sim.drives.computed_torque import mean_inertia
from par4_sim.machines.machine import Machine

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
        inertia: at which the modulus is smallest, as `inertias_at` tells them.
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


def lags_of(robot: Robot, machine: Machine) -> tuple[float, float]:
    """Return the time constants between command and torque, s: of the currents, the actuators."""
    return robot.drives.current_lag, machine.amplifier.time_constant


def inertias_at(robot: Robot, machine: Machine, poses: ArrayLike, known: Model | None = None
                ) -> np.ndarray:
    """Return the inertias (n,) that the loops meet at poses, ascending.

    Where the torque of the motors has a ripple, those of its crests and of its troughs.

    Args:
        robot: nominal geometry.
        machine: as it truly is.
        poses: (..., 4) m, rad; of D and theta, taken for those that the model sees, too.
        known: model of computed torque, whose loops meet M relative to its own; None for the
            loops of the drives, which meet M itself, kg m2, over the share of the torque that
            is delivered.

    Raises:
        UnreachableError: a pose that a leg cannot reach.
    """
    mass = joint_mass_matrix(machine.geometry, machine.bodies, poses).reshape(-1, LEGS, LEGS)
    model = None if known is None else joint_mass_matrix(
        robot.geometry, known.lumped_bodies(), poses).reshape(-1, LEGS, LEGS)
    amplifier, found = machine.amplifier, []
    wave = np.abs(amplifier.ripple.reshape(LEGS, -1)).sum(axis=1)
    for side in (-1.0, 1.0) if wave.any() else (0.0,):
        asked = (1.0 + amplifier.gain_error) * (1.0 + side * wave)  # of what is delivered
        if model is None:
            root = np.sqrt(asked)
            found.append(np.linalg.eigvalsh(root[:, None] * mass * root))
        else:
            found.append(np.linalg.eigvals(np.linalg.solve(model, asked[:, None] * mass)).real)
    return np.sort(np.concatenate(found), axis=None)


def inertias_of_workspace(robot: Robot, machine: Machine, known: Model | None = None
                          ) -> np.ndarray:
    """Return the inertias (n,) that the loops meet over the workspace limits, ascending.

    Args:
        robot: nominal geometry and workspace.
        machine, known: as `inertias_at`.

    Raises:
        InputError: no pose of the workspace limits is reachable.
    """
    grid = workspace_grid(robot)
    poses = grid[reachable(robot.geometry, grid) & reachable(machine.geometry, grid)]
    if not len(poses):
        raise InputError(f'robot {robot.name}: its legs reach no pose of its workspace limits '
                         f'({unreached_legs(machine.geometry, grid[0])}); set limits.workspace '
                         f'in its file to where it can work')
    return inertias_at(robot, machine, poses, known)


def margin_over(gains: Gains, inertias: np.ndarray, dt: float = STEP, *lags: float) -> Margin:
    """Return the worst margin of a law over a range of inertias.

    Args:
        gains: of the law.
        inertias: met, (n,); what counts is the range.
        dt: s between commands.
        lags: time constants between command and torque, s.
    """
    margins = [margin_at(gains, inertia, dt, *lags)
               for inertia in np.geomspace(inertias.min(), inertias.max(), INERTIAS)]
    worst = min(margins, key=lambda margin: margin.modulus)
    return Margin(worst.modulus, min(margin.gain for margin in margins),
                  min(margin.delay for margin in margins), worst.inertia)


def margin_at(gains: Gains, inertia: float, dt: float = STEP, *lags: float) -> Margin:
    """Return the margin of the loop on one inertia; zeros where it is unstable."""
    if not is_stable(gains, inertia, dt, *lags):
        return Margin(0.0, 0.0, 0.0, inertia)
    rate = np.geomspace(1.0, math.pi / dt, FREQUENCIES)
    opened = _open_loop(gains, inertia, dt, lags, np.exp(1j * rate * dt))
    size = np.abs(opened)
    crossings = np.flatnonzero((size[:-1] - 1.0) * (size[1:] - 1.0) <= 0.0)
    # a sample beside the crossing may lie beyond -1 where the crossing does not
    before, after = np.log(size[crossings]), np.log(size[crossings + 1])
    crossing = rate[crossings] * (rate[1] / rate[0]) ** (before / (before - after))
    phase = np.angle(-_open_loop(gains, inertia, dt, lags, np.exp(1j * crossing * dt)))
    # a phase beyond -1 comes there again only after nearly a turn
    delay = float(np.min(phase % (2.0 * math.pi) / crossing, initial=math.inf))
    low, high = 1.0, 1.0
    while high < LARGEST_FACTOR and is_stable(gains.scaled(high), inertia, dt, *lags):
        low, high = high, 1.5 * high
    while high / low > 1.0 + 1e-4:
        middle = math.sqrt(low * high)
        stable = is_stable(gains.scaled(middle), inertia, dt, *lags)
        low, high = (middle, high) if stable else (low, middle)
    return Margin(float(np.abs(1.0 + opened).min()), low, delay, inertia)


def is_stable(gains: Gains, inertia: float, dt: float = STEP, *lags: float) -> bool:
    """Return whether the sampled loop on an inertia is stable: all poles inside the unit circle."""
    step, given = _held(dt, lags)
    given = given / inertia
    size = len(given)
    closed = np.zeros((size + 1, size + 1))
    feedback = np.zeros(size)
    feedback[:2] = gains.stiffness, gains.damping
    closed[:size, :size] = step - np.outer(given, feedback)
    closed[:size, size] = -gains.integral * given
    closed[size, 0], closed[size, size] = dt, 1.0
    return bool(np.abs(np.linalg.eigvals(closed)).max() < 1.0)


def _open_loop(gains: Gains, inertia: float, dt: float, lags: tuple[float, ...], z: np.ndarray
               ) -> np.ndarray:
    """Return the open loop at points z (n,) of the unit circle."""
    step, given = _held(dt, lags)
    given = given / inertia
    size = len(given)
    states = np.linalg.solve(z[:, None, None] * np.eye(size) - step, given[:, None])[..., 0]
    return (gains.stiffness + gains.integral * dt / (z - 1.0)) * states[:, 0] + (
        gains.damping * states[:, 1])


@lru_cache
def _held(dt: float, lags: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Return what a step does to position, speed and currents, and what a held command adds.

    Of an inertia of one; on another one the currents, and what the command adds, are over it.
    """
    constants = [lag for lag in lags if lag > 0.0]
    size = 2 + len(constants)
    rates = np.zeros((size + 1, size + 1))  # of position, speed, currents from the last, command
    rates[0, 1] = rates[1, 2] = 1.0
    for row, constant in enumerate(constants, start=2):
        rates[row, row], rates[row, row + 1] = -1.0 / constant, 1.0 / constant
    moved = expm(rates * dt)
    return moved[:size, :size], moved[:size, size]
