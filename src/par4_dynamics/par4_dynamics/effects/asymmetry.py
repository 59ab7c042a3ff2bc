"""How far friction may differ between the directions of a joint."""

from __future__ import annotations

from par4_dynamics.effects.effect import Base, Values, beyond

ASYMMETRY = 'coulomb_asymmetry'
"""Half the difference of dry friction between the directions, N m, beside base parameters."""


def driving_one_way(values: Values, std: Values, base: Base, friction: str, unit: str
                    ) -> str | None:
    """Return why no friction has so large an `asymmetry`, in `unit`; None if one may.

    `friction` it is of, 'Coulomb' or 'viscous'; for the others see `Effect.implausible`.
    """
    asymmetry, level = values['asymmetry'], base[f'{friction.lower()}_friction']
    worst = beyond(asymmetry, std['asymmetry'], -level, level)
    return None if worst is None else (
        f'an asymmetry of {asymmetry[worst]:.3g} {unit} is not less than the {friction} friction '
        f'{level[worst]:.3g} {unit}: it would drive the joint in one direction')
