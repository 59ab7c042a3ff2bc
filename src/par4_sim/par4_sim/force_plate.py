"""A force sensor under the simulated machine: a stiff horizontal plate on which D presses."""

from __future__ import annotations

import numpy as np

from par4_dynamics.state import state_of_platform
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.position import forward_kinematics

STIFFNESS = 4e4
"""N/m; under 250 N it yields 6 mm: far enough for joints to slide, slowly enough to be static."""


class ForcePlate:
    """A plate that pushes back with stiffness x depth, without friction, and measures it.

    A `LoadTorque` of a `Machine`: called once a physics step it returns the torque that the drives
    must supply against it, and notes the force.

    Args:
        geometry: true dimensions of the machine.
        height: z of the unloaded plate in `base`, m.
        stiffness: N/m.
        period: between readings, s.
        noise: of the readings, N rms.
        seed: of the noise.
    """

    def __init__(self, geometry: Geometry, height: float, stiffness: float = STIFFNESS,
                 period: float = 1e-3, noise: float = 0.0, seed: int = 0) -> None:
        self.geometry, self.height, self.stiffness, self.period = (geometry, height, stiffness,
                                                                   period)
        self._noise, self._random = noise, np.random.default_rng(seed)
        self._pose: np.ndarray | None = None
        self._readings: list[tuple[float, float]] = []

    def __call__(self, time: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """Return the torque (4,), N m, against the plate at joint positions q (4,), rad."""
        start = {} if self._pose is None else {'start': self._pose}
        self._pose = forward_kinematics(self.geometry, q, **start)
        force = max(0.0, self.stiffness * (self.height - self._pose[2]))
        if time >= len(self._readings) * self.period:
            self._readings.append((time, force + self._noise * self._random.standard_normal()))
        if force == 0.0:
            return np.zeros(LEGS)
        rest = np.zeros((1, LEGS))
        state = state_of_platform(self.geometry, np.zeros(1), self._pose[None], rest, rest)
        return -state.torque_of_force((0.0, 0.0, force, 0.0))[0]

    @property
    def readings(self) -> np.ndarray:
        """Time since the machine's start, s, and the force on D in `base`, N, (n, 4)."""
        told = np.array(self._readings).reshape(-1, 2)
        return np.column_stack((told[:, 0], np.zeros((len(told), 2)), told[:, 1]))
