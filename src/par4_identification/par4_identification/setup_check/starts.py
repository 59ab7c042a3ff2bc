"""Where to begin with zeros and dimensions so far off that poses come out which no machine takes.

A machine that was recorded closed its loops and kept away from singular poses. Where the robot file
and the readings say otherwise, some of its poses are wrong; of all combinations of large errors,
those that give possible poses throughout are where Gauss and Newton begin again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from par4_identification.setup_check.equations import Stretch, equations_of
from par4_identification.setup_check.placement import (
    DIMENSIONS,
    ERRORS,
    with_dimensions,
)
from par4_kinematics.errors import UnreachableError
from par4_kinematics.geometry import LEGS, Geometry
from par4_kinematics.position import closes, forward_kinematics
from par4_kinematics.velocity import condition_number

GRID = np.radians((-7.0, -3.5, 0.0, 3.5, 7.0))
"""rad of each zero."""
LENGTHS = (-0.03, -0.015, 0.015, 0.03)
"""m of a dimension."""
PROBES = 24
"""Samples of which the poses are looked at."""
ROWS = 300
"""Samples by which the starts that are left are judged."""
WELL = 2.5
"""Condition number of J_x, in the least of the probes, up to which a pose is an everyday one."""


def possible_starts(stretches: Sequence[Stretch], geometry: Geometry) -> list[np.ndarray]:
    """Return errors (ERRORS,) with which all samples are everyday poses.

    Those come first with which the bodies explain most of the torque.

    Args:
        stretches: with positions as they were read.
        geometry: of the robot file.
    """
    q = np.concatenate([part.q for part in stretches])
    # the ends of the reach are where a mechanism opens first
    ends = np.concatenate((q.argmin(axis=0), q.argmax(axis=0),
                           [np.argmin(q.sum(axis=1)), np.argmax(q.sum(axis=1))]))
    even = np.linspace(0, len(q) - 1, PROBES).astype(int)
    probes = q[np.concatenate((even, ends))]
    trials = [np.concatenate((zeros, np.zeros(ERRORS - LEGS))) for zeros in product(
        GRID, repeat=LEGS) if any(zeros)]
    trials += [length * np.eye(ERRORS)[LEGS + index]
               for index in range(len(DIMENSIONS)) for length in LENGTHS]
    samples = sum(len(part.t) for part in stretches)
    thin = [part.thinned(max(1, samples // ROWS)) for part in stretches]
    found = []
    for values in trials:
        other = with_dimensions(geometry, values[LEGS:])
        if _worst(probes - values[:LEGS], other) > WELL:
            continue
        moved = [replace(part, q=part.q - values[:LEGS]) for part in thin]
        try:
            found.append((equations_of(moved, other, filtered=False).fit().error, values))
        except UnreachableError:
            continue
    return [values for _, values in sorted(found, key=lambda item: item[0])]


def _worst(q: np.ndarray, geometry: Geometry) -> float:
    """Return the largest condition number of J_x over the least; infinite where one is open."""
    if not closes(geometry, q).all():
        return np.inf
    condition = condition_number(geometry, forward_kinematics(geometry, q))
    return float(condition.max() / condition.min())
