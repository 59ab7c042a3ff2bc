"""Phases of teeth by the true angles of joints, where the zero of an encoder is wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from par4_dynamics.effects.encoder_offset import EncoderOffset
from par4_dynamics.parameters import Parameter
from par4_identification.diagnosis.evidence.doubt import nested
from par4_identification.diagnosis.verdict.answer import Cause


def by_true_angles(causes: Sequence[Cause]) -> list[Cause]:
    """Return causes whose phases are those by the true angles, as a model with both has them.

    A search fits what is bound to where a joint is by the angle that is read, q + o with the error
    o of its zero: a sin(N (q + o) + phase) has the phase N o + phase by the true angle q.
    """
    zero = next((cause for cause in causes if cause.effect.name == EncoderOffset.name), None)
    if zero is None:
        return list(causes)
    offset = zero.parameters['offset']
    errors, stds = np.broadcast_arrays(offset.value, 0.0 if offset.std is None else offset.std)
    zeros = dict(zip(zero.joints, zip(errors, stds, strict=True), strict=True))
    return [replace(cause, parameters=_moved(cause, zeros)) if cause.effect.of_angle else cause
            for cause in causes]


def _moved(cause: Cause, zeros: dict[int, tuple[float, float]]) -> dict[str, Parameter]:
    """Return the parameters of teeth by the true angle; zeros are error and deviation, rad."""
    phase, periods = cause.parameters['phase'], np.asarray(cause.parameters['periods'].value)
    error, std = np.array([zeros.get(joint, (0.0, 0.0)) for joint in cause.joints]).T
    told = np.asarray(phase.value, dtype=float)  # (J,), or (K, J) of K orders
    turns = periods[:, None] if told.ndim > 1 and periods.ndim == 1 else periods
    value = np.remainder(told + turns * error + np.pi, 2.0 * np.pi) - np.pi
    spread = None if phase.std is None else nested(
        np.hypot(np.asarray(phase.std, dtype=float), turns * std).tolist())
    return {**cause.parameters, 'phase': phase.model_copy(update={
        'value': nested(value.tolist()), 'std': spread})}
