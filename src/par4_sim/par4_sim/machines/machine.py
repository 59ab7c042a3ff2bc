"""The machine as it truly is: what the plants simulate, effects included."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from par4_dynamics.mechanism import STANDARD_GRAVITY, LumpedBodies
from par4_kinematics.geometry import Geometry
from par4_sim.machines.amplifier import Amplifier
from par4_sim.machines.friction import Friction
from par4_sim.machines.platform_forces import PlatformForces
from par4_sim.machines.sensors import Sensors
from par4_sim.machines.transmission import Transmission

LoadTorque = Callable[[float, np.ndarray, np.ndarray], np.ndarray]
"""(time s, q (4,), qd (4,)) -> torque (4,), N m, that the drives must supply on top."""


@dataclass(frozen=True)
class Harmonic:
    """A torque a sin(N q + phi) on one joint that its drive must supply on top.

    N = 0 is a constant, N = 1 a weight on the arm, larger N cogging.

    Attributes:
        joint: 0 to 3.
        amplitude: a, N m.
        periods: N, periods a turn.
        phase: phi, rad.
    """

    joint: int
    amplitude: float
    periods: float
    phase: float

    def torque(self, q: float) -> float:
        """Return the torque, N m, at a joint position, rad."""
        return self.amplitude * math.sin(self.periods * q + self.phase)


@dataclass(frozen=True)
class Machine:
    """A Par4 with friction and disturbances.

    Attributes:
        geometry: true dimensions.
        bodies: lumped masses; rod_mass and bar_mass in them are distributed, 0 = end masses.
        friction: of the four joints.
        gravity: (3,) m/s2 in `base`.
        harmonics: torques that depend on the position of a joint alone.
        platform: forces on the platform and in the passive joints.
        loads: further joint torques, from code; taken once a step, at its middle.
        amplifier, transmission, sensors: what stands between the drives and the mechanism.
    """

    geometry: Geometry
    bodies: LumpedBodies
    friction: Friction
    gravity: np.ndarray = field(default_factory=STANDARD_GRAVITY.copy)
    harmonics: tuple[Harmonic, ...] = ()
    platform: PlatformForces = field(default_factory=PlatformForces)
    loads: tuple[LoadTorque, ...] = ()
    amplifier: Amplifier = field(default_factory=Amplifier)
    transmission: Transmission = field(default_factory=Transmission)
    sensors: Sensors = field(default_factory=Sensors)

    @property
    def harmonic_rows(self) -> np.ndarray:
        """The harmonics as the compiled kernels take them, (H, 4): joint, a, N, phi."""
        rows = [(item.joint, item.amplitude, item.periods, item.phase) for item in self.harmonics]
        return np.array(rows, dtype=float).reshape(-1, 4)
