"""The inertia of tool, belt and pulleys, which turn with theta."""

from __future__ import annotations

import numpy as np

from par4_dynamics.base_terms import UNMODELLED, unmodelled_columns
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

LARGEST = 0.05
"""kg m2 at theta; ten times a heavy tool behind its belt."""


class ThetaInertia(Effect):
    """tau += J_1^T (0, 0, 0, I thetadd), I reduced to theta."""

    name = 'theta_inertia'
    phrase = 'inertia turning with theta'
    parameters = (EffectParameter('inertia', 'kg m2', 'machine'),)
    shared = True
    is_body = True
    needs_platform = True

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        return unmodelled_columns(state)[..., [UNMODELLED.index('theta_inertia')]]

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        inertia = float(values['inertia'][0])
        if beyond(inertia, std['inertia'][0], low=0.0) is not None:
            return f'an inertia about theta cannot be negative, found {inertia:.3g} kg m2'
        if beyond(inertia, std['inertia'][0], high=LARGEST) is not None:
            return (f'an inertia of {inertia:.3g} kg m2 about theta is more than ten times that of '
                    f'a heavy tool')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(np.broadcast_to(state.platform.xdd[:, 3:], state.q.shape),
                         'theta acceleration, rad/s2')
