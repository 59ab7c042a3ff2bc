"""A force sensor under the simulated machine: a stiff horizontal plate on which D presses."""

from __future__ import annotations

import math

import numba
import numpy as np

from par4_kinematics.acceleration import closed_legs, platform_speed
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import HOME, LEGS, Geometry
from par4_kinematics.position import forward_sample, mid_height_home

STIFFNESS = 4e4
"""N/m; under 250 N it yields 6 mm: far enough for joints to slide, slowly enough to be static."""


@numba.njit(cache=True, error_model='numpy')
def press(packed, plate, home, poses, told, count, time, q, torque):
    """Write the torque (4,), N m, against a plate at joint positions q (4,); note its reading.

    Args:
        packed: of the geometry.
        plate: height, m, stiffness, N/m, and period of the readings, s.
        home: pose from which the mechanism is closed where the pose before does not lead there.
        poses: (1, 4) near that of q, moved there.
        told: times and forces of the readings, (m, 2) s, N, with room for one more.
        count: how many there are, (1,), raised where one is due.
        time: s.
        q: rad.
        torque: written.

    Returns:
        Whether the mechanism closes with q.
    """
    directions, before = np.empty((2, 4)), poses[0].copy()
    for joint in range(4):
        directions[0, joint], directions[1, joint] = math.cos(q[joint]), math.sin(q[joint])
    if forward_sample(packed, directions[:1], directions[1:], 0, poses) < 0:
        poses[0] = home
        if forward_sample(packed, directions[:1], directions[1:], 0, poses) < 0:
            poses[0] = before
            return False
    force = max(0.0, plate[1] * (plate[0] - poses[0, 2]))
    if time >= count[0] * plate[2]:
        told[count[0], 0], told[count[0], 1] = time, force
        count[0] += 1
    torque[:] = 0.0
    if force > 0.0:
        reaches, inverse = closed_legs(packed, poses[0, 0], poses[0, 1], poses[0, 2],
                                       math.cos(poses[0, 3]), math.sin(poses[0, 3]))
        for joint in range(4):
            unit = (1.0 if joint == 0 else 0.0, 1.0 if joint == 1 else 0.0,
                    1.0 if joint == 2 else 0.0, 1.0 if joint == 3 else 0.0)
            torque[joint] = -force * platform_speed(packed, reaches, inverse, unit)[2]
    return True


class ForcePlate:
    """A plate that pushes back with stiffness x depth, without friction, and measures it.

    A `LoadTorque` of a `Machine`: called once a physics step it returns the torque that the drives
    must supply against it, and notes the force. The exact plant takes it in compiled steps.

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
        self._drawn = np.empty(0)
        self._packed = geometry.packed
        self._plate = np.array((height, stiffness, period), dtype=float)
        self._home = mid_height_home(geometry).copy()
        self._poses = np.array(HOME, dtype=float)[None]
        self._told, self._count = np.empty((0, 2)), np.zeros(1, dtype=np.int64)

    def kernel_state(self, steps: int) -> tuple[np.ndarray, ...]:
        """Return what `press` takes in front of the time, with room for readings of `steps`."""
        needed = int(self._count[0]) + steps
        if needed > len(self._told):
            more = np.empty((max(needed, 2 * len(self._told)) - len(self._told), 2))
            self._told = np.concatenate((self._told, more))
        return (self._packed, self._plate, self._home, self._poses, self._told,
                self._count)

    def __call__(self, time: float, q: np.ndarray, qd: np.ndarray) -> np.ndarray:  # noqa: ARG002
        """Return the torque (4,), N m, against the plate at joint positions q (4,), rad.

        Raises:
            UnreachableError: the mechanism does not close with q.
        """
        torque = np.empty(LEGS)
        if not press(*self.kernel_state(1), time, q, torque):
            raise UnreachableError(f'on the force plate after {time:.4f} s the mechanism does not '
                                   f'close with the joint positions {np.round(q, 4).tolist()}')
        return torque

    @property
    def readings(self) -> np.ndarray:
        """Time since the machine's start, s, and the force on D in `base`, N, (n, 4)."""
        told = self._told[:int(self._count[0])]
        more = self._random.standard_normal(len(told) - len(self._drawn))
        self._drawn = np.concatenate((self._drawn, more))
        rest = np.zeros((len(told), 2))
        return np.column_stack((told[:, 0], rest, told[:, 1] + self._noise * self._drawn))
