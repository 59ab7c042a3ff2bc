"""Which first moments an arm may have beyond those that (20) knows."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Base, Values, beyond
from par4_dynamics.state import GRAVITY

OF_AN_ARM, LEAST = 2.0, 1.0
"""Largest weight over that of an arm, and what is believed of the lightest arm, N m."""


def unlike_an_arm(values: Values, std: Values, base: Base, what: str) -> str | None:
    """Return why no arm has so large a `first_moment`, kg m; None if one may.

    `what` it is in words; for the others see `Effect.implausible`.
    """
    torque, spread = GRAVITY * values['first_moment'], GRAVITY * std['first_moment']
    along = float(np.max(np.abs(base['arm_gravity'])))
    largest = max(OF_AN_ARM * along, LEAST)
    worst = beyond(torque, spread, -largest, largest)
    if worst is None:
        return None
    return (f'{abs(torque[worst]):.3g} N m of {what} is more than twice what lies along an arm, '
            f'{along:.3g} N m')
