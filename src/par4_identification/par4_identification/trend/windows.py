"""How long the stretches are in which a machine is watched, and how many are learnt from."""

from __future__ import annotations

WINDOW = 2.0
"""Seconds of a window."""
LEARNING = 60
"""Windows from which the scatter is learnt."""
