"""All effects by name."""

from __future__ import annotations

from par4_dynamics.effects.cogging import Cogging
from par4_dynamics.effects.distributed_rods import DistributedRods
from par4_dynamics.effects.effect import Effect
from par4_dynamics.effects.stribeck import Stribeck
from par4_dynamics.effects.torque_offset import TorqueOffset
from par4_kinematics.errors import InputError

CATALOGUE: dict[str, Effect] = {
    effect.name: effect
    for effect in (TorqueOffset(), Stribeck(), Cogging(), DistributedRods())
}


def effect_named(name: str) -> Effect:
    """Return the effect of that name.

    Raises:
        InputError: no such effect; lists those that exist.
    """
    if name not in CATALOGUE:
        raise InputError(f'unknown effect {name!r}; known effects are {", ".join(CATALOGUE)}')
    return CATALOGUE[name]
