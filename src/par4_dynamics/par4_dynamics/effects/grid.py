"""Grids of shape parameters whose resolution is a ratio."""

from __future__ import annotations

from par4_dynamics.effects.effect import Shape


def around(name: str, centre: float, ratio: float) -> tuple[Shape, ...]:
    """Return the shapes half a spacing of `ratio` below, at and above `centre`."""
    return tuple({name: centre * ratio ** power} for power in (-0.5, 0.0, 0.5))
