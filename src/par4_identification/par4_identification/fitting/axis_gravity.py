"""Whether an axis of which nobody says so lifts a load: the data tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.base_terms import HANGING_TERMS
from par4_identification.fitting.identification import identify
from par4_identification.logs.log import Log
from par4_identification.signals.rows import Conditioning
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

TOLD = 5.0
"""Standard deviations from zero from which on a load of gravity is told."""
LEAST = 0.02
"""Load over the torque (rms) from which on: less may come from errors of the other terms."""


def with_gravity_told(machine: Robot | Axis, logs: Sequence[Log], conditioning: Conditioning
                      ) -> Robot | Axis:
    """Return the machine; an axis of unknown gravity has it where the data tell of it.

    The load is fitted beside the other base terms. Where its values are within `TOLD` standard
    deviations of zero or less than `LEAST` of the torque, or cannot be told at all, the axis has
    none.
    """
    if not isinstance(machine, Axis) or machine.gravity != 'unknown':
        return machine
    without = machine.model_copy(update={'gravity': 'none'})
    try:
        estimate = identify(list(logs), machine, conditioning=conditioning).estimate
    except InputError:
        return without
    names = {term.name for hanging, terms in HANGING_TERMS.items() if hanging == machine.hanging
             for term in terms}
    torque = float(np.sqrt(np.mean(np.concatenate([log.tau for log in logs]) ** 2)))
    told = any(abs(value) > max(TOLD * std, LEAST * torque) for label, value, std in zip(
        estimate.labels, estimate.values, estimate.std, strict=True) if label.name in names)
    return machine.model_copy(update={'gravity': 'vertical'}) if told else without
