"""Pulses of torque that the motion answers: a drive made them, and no fault of the recording.

A feedforward at the edges of a motion, or of a motion of few points, asks for other torques for
some samples. In the readings they look like a loose plug. But bodies that they moved leave far less
of (22) with the pulses than without, and a plug moves no body.
"""

from __future__ import annotations

import numpy as np

from par4_identification.logs.log import Log
from par4_identification.setup_check.equations import (
    TORQUE_HZ,
    Equations,
    equations_or_none,
    stretches_of,
)
from par4_identification.setup_check.mending import despiked
from par4_kinematics.geometry import Geometry

LEFT = 0.5
"""Most of what is left without the pulses, in squares beside them, that true ones leave."""
BESIDE = 1.0 / TORQUE_HZ
"""s from a pulse over which the filters spread it."""


def joints_that_answer(log: Log, pulses: np.ndarray, geometry: Geometry | None) -> np.ndarray:
    """Return of which joints (J,) the motion answers the pulses of torque.

    Args:
        log: with the pulses.
        pulses: which torques are part of one, (n, J).
        geometry: dimensions; None for a single axis.
    """
    recorded = equations_or_none(stretches_of([log]), geometry)
    calm = equations_or_none(stretches_of([despiked(log, 'tau', pulses)]), geometry)
    if recorded is None or calm is None:
        return np.zeros(pulses.shape[1], dtype=bool)
    return np.array([_left_beside(recorded, joint, log.t[mask]) < LEFT * _left_beside(
        calm, joint, log.t[mask]) for joint, mask in enumerate(pulses.T)])


def _left_beside(rows: Equations, joint: int, times: np.ndarray) -> float:
    """Return the squares that the fit leaves of a joint's torque near some times, s; N2 m2."""
    instants = np.floor(rows.t[rows.valid[:, joint]] / BESIDE)
    beside = np.isin(instants, np.floor(times / BESIDE)[:, None] + np.arange(-1, 2))
    return float(np.sum(rows.left(joint)[beside] ** 2))
