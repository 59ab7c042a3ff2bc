"""The sensors as they truly are: what encoders tell and how the torque is recorded.

    reading = steps of (q + offset + d sin(q + phi))
    velocity reading = (1 + d cos(q + phi)) qd, its derivative, without steps
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numba
import numpy as np

from par4_kinematics.geometry import LEGS


def _zeros() -> np.ndarray:
    return np.zeros(LEGS)


@dataclass(frozen=True)
class Sensors:
    """Errors of the encoders, which the drives see too, and of the recorded torque.

    Attributes:
        encoder_offset: reading - truth, (4,) rad.
        eccentricity: d of the reading q + d sin(q + phi), (4,) rad.
        eccentricity_phase: phi, (4,) rad.
        position_step: of the encoder, (4,) rad, where it is coarser than its counts.
        torque_step: of the recorded torque, (4,) N m; 0 = none.
        torque_delay: the recorded torque is that of d seconds ago, tau(t - d), s; one for the
            machine, of either sign.
    """

    encoder_offset: np.ndarray = field(default_factory=_zeros)
    eccentricity: np.ndarray = field(default_factory=_zeros)
    eccentricity_phase: np.ndarray = field(default_factory=_zeros)
    position_step: np.ndarray = field(default_factory=_zeros)
    torque_step: np.ndarray = field(default_factory=_zeros)
    torque_delay: float = 0.0

    def encoders(self, counts: int) -> np.ndarray:
        """Return offset, d, phi and step (4, 4) as `read_encoders` takes them.

        Args:
            counts: of the encoders a turn of the arm, 0 = ideal.
        """
        counted = 2.0 * math.pi / counts if counts else 0.0
        return np.stack([np.broadcast_to(part, (LEGS,)).astype(float) for part in (
            self.encoder_offset, self.eccentricity, self.eccentricity_phase,
            np.maximum(counted, self.position_step))])


@numba.njit(cache=True, error_model='numpy')
def round_to(value, step):
    """Return the multiple of `step` nearest to `value`; a step of 0 rounds nothing."""
    return value if step == 0.0 else math.floor(value / step + 0.5) * step


@numba.njit(cache=True, error_model='numpy')
def read_encoders(encoders, q, qd, noise, reading, rate):
    """Write what the encoders tell of the true q, qd (4,).

    Args:
        encoders: `Sensors.encoders`.
        q, qd: rad, rad/s.
        noise: on the position before it is rounded, (4,) rad.
        reading, rate: positions and velocities (4,), rad, rad/s, written.
    """
    for joint in range(4):
        size, angle = encoders[1, joint], q[joint] + encoders[2, joint]
        told = q[joint] + encoders[0, joint] + size * math.sin(angle) + noise[joint]
        reading[joint] = round_to(told, encoders[3, joint])
        rate[joint] = qd[joint] * (1.0 + size * math.cos(angle))
