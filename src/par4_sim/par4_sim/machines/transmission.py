"""The transmissions between motors and arms as they truly are."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from par4_kinematics.geometry import LEGS


@dataclass(frozen=True)
class Transmission:
    """Springs and gaps between four motors and their arms.

    Attributes:
        stiffness: k (4,), N m/rad; inf = rigid.
        gap: total lost motion (4,), rad; 0 = none.
        motor_share: share of the actuator inertia on the motor's side. A rigid machine shows the
            sum alone.
        damping_ratio: of the spring, relative to the critical damping of motor against arm.
    """

    stiffness: np.ndarray = field(default_factory=lambda: np.full(LEGS, np.inf))
    gap: np.ndarray = field(default_factory=lambda: np.zeros(LEGS))
    motor_share: float = 0.5
    damping_ratio: float = 0.02

    @property
    def is_rigid(self) -> bool:
        """Whether motors and arms move as one on every joint."""
        return bool(np.all(np.isinf(self.stiffness)) and np.all(np.asarray(self.gap) == 0.0))
