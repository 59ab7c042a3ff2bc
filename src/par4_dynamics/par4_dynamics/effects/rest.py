"""Coulomb friction at rest of joints that the encoders do not see directly."""

from __future__ import annotations

import numpy as np

RESTING_RATE = 0.03
"""rad/s below which a joint of platform or forearms counts as resting. Friction then has
any value up to that of Coulomb, and the sign of the measured rate is the sign of its noise."""


def fading_sign(rate: np.ndarray) -> np.ndarray:
    """Return the sign of angular velocities r, rad/s: r / sqrt(r^2 + RESTING_RATE^2)."""
    return rate / np.hypot(rate, RESTING_RATE)
