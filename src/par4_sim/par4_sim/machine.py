"""The machine as it truly is: what the plants simulate, effects included."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from par4_dynamics.mechanism import LumpedBodies
from par4_kinematics.geometry import Geometry
from par4_sim.friction import Friction

LoadTorque = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""(time s, q (4,), qd (4,)) -> torque (4,), N m, that the drives must supply on top."""


@dataclass(frozen=True)
class Machine:
    """A Par4 with friction and disturbances.

    Attributes:
        geometry: dimensions.
        bodies: lumped masses; rod_mass and bar_mass in them are distributed, 0 = end masses.
        friction: of the four joints.
        loads: further joint torques that depend on time, position and velocity.
    """

    geometry: Geometry
    bodies: LumpedBodies
    friction: Friction
    loads: tuple[LoadTorque, ...] = ()
