"""Coulomb friction of what the encoders do not see directly, where it rests."""

from __future__ import annotations

import numpy as np

AT_REST = 0.03
"""rad/s below which a joint of platform or forearms counts as resting. Friction then holds against
any torque up to that of Coulomb, and the sign of the rate is the sign of its noise."""


def fading_sign(rate: np.ndarray) -> np.ndarray:
    """Return the sign of angular velocities, rad/s, fading at rest: r / sqrt(r^2 + AT_REST^2)."""
    return rate / np.hypot(rate, AT_REST)
