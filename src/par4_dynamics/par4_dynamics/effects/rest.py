"""Coulomb friction at rest of joints that the encoders do not see directly."""

from __future__ import annotations

import numpy as np

RESTING_RATE = 0.03
"""rad/s below which a joint of platform or forearms counts as resting. Friction then has
any value up to that of Coulomb, and the sign of the measured rate is the sign of its noise."""
MAY_REST = 3.0 * RESTING_RATE
"""rad/s below which such a joint may stick, or turn back a moment before or after what is measured.
"""


def fading_sign(rate: np.ndarray) -> np.ndarray:
    """Return the sign of angular velocities r, rad/s: r / sqrt(r^2 + RESTING_RATE^2)."""
    return rate / np.hypot(rate, RESTING_RATE)


def may_rest(rate: np.ndarray) -> np.ndarray:
    """Return where angular velocities, rad/s, are below `MAY_REST`."""
    return np.abs(rate) < MAY_REST
