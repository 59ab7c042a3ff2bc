"""The exact plant: the mechanism in its four coordinates, whose joints truly stick.

Loops are closed by construction; `exact_steps` says how it moves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS
from par4_kinematics.position import inverse_kinematics
from par4_kinematics.robot import JOINT_NAMES
from par4_sim.choices import STEP
from par4_sim.description.robot_tree import tree_joint_positions
from par4_sim.machines.machine import LoadTorque, Machine
from par4_sim.plants.exact_steps import (
    FREE,
    LOST,
    MODE,
    OPEN,
    QD,
    STUCK,
    WORK_ROWS,
    XD,
    Q,
    X,
    advance,
    machine_constants,
)


class ExactPlant:
    """The machine in reduced coordinates; implements `Plant`.

    Args:
        machine: what it is.
        dt: physics step, s.
    """

    def __init__(self, machine: Machine, dt: float = STEP) -> None:
        self.dt = dt
        self.velocity_offset = 0.0
        self.torque_offset = 0.5 * dt
        self._machine = machine
        self._constants = machine_constants(machine)
        self._friction = machine.friction.packed
        self._harmonics = machine.harmonic_rows
        self._state = np.zeros((6, LEGS))
        self._work = np.zeros((WORK_ROWS, LEGS))
        self._steps = 0

    @property
    def kernel_state(self) -> tuple[np.ndarray, ...]:
        """Constants, friction, harmonics, state and work as `advance` takes them."""
        return self._constants, self._friction, self._harmonics, self._state, self._work

    @property
    def loads(self) -> tuple[LoadTorque, ...]:
        """Torques on the joints that are not compiled."""
        return self._machine.loads

    @property
    def steps(self) -> int:
        """Physics steps since the last reset."""
        return self._steps

    @property
    def time(self) -> float:
        """Seconds since the last reset."""
        return self._steps * self.dt

    @property
    def q(self) -> np.ndarray:
        """Joint positions (4,), rad."""
        return self._state[Q].copy()

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities (4,), rad/s."""
        return self._state[QD].copy()

    @property
    def x(self) -> np.ndarray:
        """Pose of D and theta (4,), m, rad."""
        return self._state[X].copy()

    @property
    def xd(self) -> np.ndarray:
        """Velocity of D and thetadot (4,)."""
        return self._state[XD].copy()

    def reset(self, x: ArrayLike) -> None:
        """Put the machine at rest at pose x (4,); raises UnreachableError."""
        q = inverse_kinematics(self._machine.geometry, x)
        self._state[:] = 0.0
        self._state[X], self._state[Q] = x, q
        self._state[MODE] = np.where(self._machine.friction.is_dry, STUCK, FREE)
        self._steps = 0

    def step(self, tau: ArrayLike) -> None:
        """Advance by dt with actuator torques tau (4,), N m, held.

        Raises:
            UnreachableError: the platform was driven out of reach.
        """
        torque = np.asarray(tau, dtype=float)
        for load in self._machine.loads:
            q, qd = self._state[Q], self._state[QD]
            torque = torque - load(self.time + 0.5 * self.dt, q + 0.5 * self.dt * qd, qd.copy())
        leg = advance(self._constants, self._friction, self._harmonics, self._state, self._work,
                      self.time, torque, self.dt)
        self.count_steps(int(leg < 0), leg)

    def count_steps(self, done: int, leg: int) -> None:
        """Count physics steps that `advance` did, and say what ended them early.

        Args:
            done: steps.
            leg: what `advance` returned last, or OPEN.

        Raises:
            UnreachableError: the platform was driven out of reach.
        """
        self._steps += done
        if leg >= 0:
            at = f'leg {leg} was driven out of reach' if leg < LEGS else {
                LOST: 'the motion is not finite', OPEN: 'the mechanism does not close'}[leg]
            raise UnreachableError(
                f'after {self.time:.4f} s {at} at pose {np.round(self._state[X], 4).tolist()}; '
                f'check the torques and the motion')

    def passive_joints(self) -> dict[str, float]:
        """Return name -> position, rad or m, of the joints of `robot_description` without a motor.
        """
        positions = tree_joint_positions(self._machine.geometry, self.x)
        return {name: positions[name] for name in positions if name not in JOINT_NAMES}

    def loop_opening(self) -> float:
        """Return 0.0 m: loops are closed by construction."""
        return 0.0

    def close(self) -> None:
        """Do nothing: the plant holds no engine."""
