"""Which friction rotations may have that no drive turns."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import Values, beyond


def unlike_friction(values: Values, std: Values, rate: float, largest: float, of: str, takes: str
                    ) -> str | None:
    """Return why nothing has such `coulomb` and `viscous` friction; None if something may.

    Args:
        values, std: see `Effect.implausible`.
        rate: of turning, rad/s, at which both are compared.
        largest: their sum there, N m, ten times what is usual.
        of: what turns, in words.
        takes: what takes a tenth of it, in words.
    """
    units = np.array((1.0, rate))
    torque, spread = (units * (part['coulomb'][0], part['viscous'][0]) for part in (values, std))
    if beyond(torque, spread, low=0.0) is not None:
        return (f'friction of {of} must dissipate, found {values["coulomb"][0]:.3g} N m and '
                f'{values["viscous"][0]:.3g} N m s/rad')
    if beyond(torque.sum(), spread.sum(), high=largest) is not None:
        return (f'friction of {of} of {torque.sum():.3g} N m at {rate:g} rad/s is ten times what '
                f'{takes}')
    return None
