"""Whether an axis of which nobody says so lifts a load: the data tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_dynamics.base_terms import HANGING_TERMS
from par4_identification.estimators.estimate import Estimate
from par4_identification.fitting.identification import identify
from par4_identification.logs.log import Log
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Axis, Robot

TOLD = 5.0
"""Standard deviations from zero from which on a load of gravity is told."""
LEAST = 0.02
"""Load over the torque (rms) from which on: less may come from errors of the other terms."""
EXPLAINED = 0.9
"""Share of what the base terms leave, in squares, from which on a load is the likely reason."""


def with_gravity_told(machine: Robot | Axis, logs: Sequence[Log], conditioning: Conditioning
                      ) -> Robot | Axis:
    """Return the machine; an axis of unknown gravity has it where the data tell of it.

    The load is fitted beside the other base terms. Where its values are within `TOLD` standard
    deviations of zero or less than `LEAST` of the torque, or cannot be told at all, the axis has
    none.
    """
    if not isinstance(machine, Axis) or machine.gravity != 'unknown':
        return machine
    try:
        estimate = identify(list(logs), machine, conditioning=conditioning).estimate
    except InputError:
        told = False
    else:
        told = _is_told(machine, estimate, logs)
    return machine.model_copy(update={'gravity': 'vertical' if told else 'none'})


def unsaid_load(machine: Robot | Axis, logs: Sequence[Log], conditioning: Conditioning
                ) -> tuple[float, float] | None:
    """Return the size of a load (N m or N) that the file of an axis denies and its data tell.

    With it comes the share of the squares that the load explains of what the base terms leave. None
    where that is less than `EXPLAINED`, where the load is not told, or of another machine.
    """
    if not isinstance(machine, Axis) or machine.gravity != 'none':
        return None
    hanging = machine.model_copy(update={'gravity': 'vertical'})
    try:
        before, after = (identify(list(logs), own, conditioning=conditioning).estimate
                         for own in (machine, hanging))
    except InputError:
        return None
    explained = 1.0 - (after.relative_error / max(before.relative_error, 1e-30)) ** 2
    if explained < EXPLAINED or not _is_told(hanging, after, logs):
        return None
    size = float(np.linalg.norm([value for label, value in zip(
        after.labels, after.values, strict=True) if label.name in _loads(hanging)]))
    return size, explained


def _loads(machine: Axis) -> set[str]:
    """Return the names of the base terms of gravity."""
    return {term.name for hanging, terms in HANGING_TERMS.items() if hanging == machine.hanging
            for term in terms}


def _is_told(machine: Axis, estimate: Estimate, logs: Sequence[Log]) -> bool:
    """Return whether a load that was fitted is neither chance nor an error of the other terms."""
    torque = float(np.sqrt(np.mean(np.concatenate([log.tau for log in logs]) ** 2)))
    return any(abs(value) > max(TOLD * std, LEAST * torque) for label, value, std in zip(
        estimate.labels, estimate.values, estimate.std, strict=True)
        if label.name in _loads(machine))
