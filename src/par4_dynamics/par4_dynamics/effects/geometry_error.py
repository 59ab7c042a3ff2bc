"""Dimensions that differ from those of the robot file."""

from __future__ import annotations

import numpy as np

from par4_dynamics.effects.effect import (
    Base,
    Effect,
    EffectParameter,
    Shape,
    Signature,
    Values,
    beyond,
)
from par4_dynamics.state import State

DIMENSIONS = ('arm_length', 'forearm_length', 'base_radius', 'platform_radius',
              'platform_bar_length')
STEP = 1e-5
"""m; small against any dimension, large against the rounding of (20)."""
LARGEST = 0.03
"""m: a part for another robot may be 20 mm longer. More would be another robot."""


class GeometryError(Effect):
    """tau += sum (dtau/d dimension) error, the machine's dimension being nominal + error.

    Of one size on all four legs, at the same q, qd, qdd and base parameters. The slopes are those
    halfway between nominal and true dimensions (`Effect.halfway`).
    """

    name = 'geometry_error'
    phrase = 'dimensions other than those of the robot file'
    parameters = tuple(EffectParameter(name, 'm', 'machine', default=0.0) for name in DIMENSIONS)
    shared = True
    separable = ((0,), (1,), (2,), (3,), (4,))
    needs_platform = True
    needs_nominal = True
    variables = 3

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        motion = state.halfway
        columns = []
        for name in DIMENSIONS:
            ends = []
            for step in (-STEP, STEP):
                changed = motion.platform.geometry.with_errors(**{name: step})
                ends.append(state.known.moved_load(
                    motion.nearby(changed, motion.q, motion.qd, motion.qdd)))
            columns.append((ends[1] - ends[0]) / (2.0 * STEP))
        return np.stack(columns, axis=-1)

    def halfway(self, state: State, values: Values) -> State:
        changed = state.platform.geometry.with_errors(
            **{name: 0.5 * value[0] for name, value in values.items()})
        return state.moved(state.q, state.qd, state.qdd, changed)

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        errors, spread = (np.array([part[name][0] for name in DIMENSIONS])
                          for part in (values, std))
        worst = beyond(errors, spread, -LARGEST, LARGEST)
        if worst is not None:
            return (f'an error of {1e3 * errors[worst]:.3g} mm in {DIMENSIONS[worst]} makes it '
                    f'another robot, expected at most {1e3 * LARGEST:g} mm')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
