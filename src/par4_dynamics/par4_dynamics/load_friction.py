"""Friction of joints that turn with the load, behind springs: theta and the passive joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class LoadFriction:
    """Joints of the load that take coulomb w / |w| (fading at rest) + viscous w to turn at w.

    At rest all fade as that of theta does, by w / sqrt(w^2 + RESTING_RATE^2), in the steps of
    springs; the passive joints' own effect has a tanh, which differs by 7 % at most and by 1 % from
    0.2 rad/s on.

    Attributes:
        turning: w of G joints by the speeds of the actuated ones, (n, G, 3, J).
        coulomb: of each, (G,), N m.
        viscous: the same, N m s/rad.
    """

    turning: np.ndarray
    coulomb: np.ndarray
    viscous: np.ndarray


def none_at_all(joints: int) -> LoadFriction:
    """Return the friction of a load of J joints that has none, for one sample."""
    return LoadFriction(np.zeros((1, 0, 3, joints)), np.zeros(0), np.zeros(0))


def together(parts: Sequence[LoadFriction]) -> LoadFriction:
    """Return several frictions as one; there is at least one."""
    return LoadFriction(*(np.concatenate([getattr(part, name) for part in parts], axis=axis)
                          for name, axis in (('turning', 1), ('coulomb', 0), ('viscous', 0))))
