"""Whether the parts of a friction, as estimated, can be those of a friction."""

from __future__ import annotations

NEGATIVE_SHARE = 0.25
"""A part that is zero in truth is estimated a little below it; more than this share of the whole
is no estimation error of a friction that shows."""


def feeds_energy(*parts: float) -> bool:
    """Return True if friction of these parts, at a typical speed each, does not dissipate."""
    whole = sum(parts)
    return whole <= 0.0 or min(parts) < -NEGATIVE_SHARE * whole
