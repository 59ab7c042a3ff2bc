"""Arms and forearms of single legs that are longer or shorter than those of the robot file."""

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
from par4_dynamics.effects.geometry_error import LARGEST
from par4_dynamics.state import State
from par4_kinematics.geometry import LEGS

LENGTHS = ('arm_length', 'forearm_length')
STEP = 1e-6
"""m: slopes to one side are off by some 1e-6, and cost half of those to both."""


class LegLengthError(Effect):
    """tau += sum_i (dtau/d length_i) error_i, arm or forearm of leg i being nominal + error_i long.

    At the same q, qd, qdd and base parameters. A leg of another length moves the platform and
    changes the torque of all joints, so the coefficients are shared: the errors of arm and forearm
    of each leg. The slopes are those halfway between nominal and true lengths (`Effect.halfway`).
    An error of all legs is a `GeometryError`, in fewer numbers.
    """

    name = 'leg_length_error'
    phrase = 'a leg with an arm or a forearm of another length'
    parameters = tuple(EffectParameter(name, 'm', 'joint', default=0.0) for name in LENGTHS)
    shared = True
    separable = ((0, 1), (2, 3), (4, 5), (6, 7))
    needs_platform = True
    needs_nominal = True
    variables = 3

    def columns(self, state: State, shape: Shape) -> np.ndarray:
        motion = state.halfway
        here, columns = state.known.moved_load(motion), []
        for leg in range(LEGS):
            for name in LENGTHS:
                changed = motion.platform.geometry.with_errors(
                    **{f'{name}_errors': STEP * np.eye(LEGS)[leg]})
                there = state.known.moved_load(motion.nearby(
                    changed, motion.q, motion.qd, motion.qdd))
                columns.append((there - here) / STEP)
        return np.stack(columns, axis=-1)

    def halfway(self, state: State, values: Values) -> State:
        changed = state.platform.geometry.with_errors(
            **{f'{name}_errors': 0.5 * np.asarray(error) for name, error in values.items()})
        return state.moved(state.q, state.qd, state.qdd, changed)

    def coefficients(self, values: Values) -> np.ndarray:
        errors = np.stack([values[name] for name in LENGTHS], axis=1)
        return np.tile(errors.reshape(-1, 1), LEGS)

    def values(self, coefficients: np.ndarray, shape: Shape) -> dict[str, np.ndarray]:
        return {name: np.diagonal(coefficients[first::len(LENGTHS)]).copy()
                for first, name in enumerate(LENGTHS)}

    def implausible(self, values: Values, std: Values, base: Base) -> str | None:
        for name in LENGTHS:
            worst = beyond(values[name], std[name], -LARGEST, LARGEST)
            if worst is not None:
                return (f'an error of {1e3 * values[name][worst]:.3g} mm in the {name} of leg '
                        f'{worst} makes it another robot, expected at most {1e3 * LARGEST:g} mm')
        return None

    def signature(self, state: State) -> Signature:
        return Signature(state.q, 'joint position, rad')
