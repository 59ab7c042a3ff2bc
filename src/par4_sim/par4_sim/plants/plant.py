"""What a simulated machine offers, whatever computes it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike


class Plant(Protocol):
    """A mechanism with friction that is stepped with actuator torques.

    Reading convention: after k steps `q` is the joint position at t_k = k dt and `qd` the
    velocity at t_k + `velocity_offset`. The torque given to step k acts, at second order, as if at
    t_k + `torque_offset`.

    Attributes:
        dt: physics step, s.
        velocity_offset, torque_offset: s; 0 and dt/2 for an engine that integrates a held torque
            exactly, -dt/2 and 0 for symplectic Euler.
    """

    dt: float
    velocity_offset: float
    torque_offset: float

    @property
    def time(self) -> float:
        """Time of the reading, s since the last reset."""

    @property
    def q(self) -> np.ndarray:
        """Joint positions (4,), rad."""

    @property
    def qd(self) -> np.ndarray:
        """Joint velocities (4,), rad/s."""

    @property
    def x(self) -> np.ndarray:
        """Pose of D and theta (4,), m, rad."""

    @property
    def xd(self) -> np.ndarray:
        """Velocity of D and thetadot (4,)."""

    def reset(self, x: ArrayLike) -> None:
        """Put the machine at rest at pose x (4,); raises UnreachableError."""

    def step(self, tau: ArrayLike) -> None:
        """Advance by dt with actuator torques tau (4,), N m, held."""

    def passive_joints(self) -> dict[str, float]:
        """Return name -> position, rad or m, of the joints of `robot_description` without a motor.

        With the four of `q` they close the picture of a viewer.
        """

    def loop_opening(self) -> float:
        """Return the largest opening of a kinematic loop, m."""

    def close(self) -> None:
        """Release what the engine holds; the plant cannot be used afterwards."""
