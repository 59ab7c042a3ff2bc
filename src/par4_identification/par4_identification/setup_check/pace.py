"""Samples that came faster or slower than their stamps say: a wrong rate or a wrong clock.

Gravity does not know the clock. Where all times are too long by a factor f, speeds are too small by
f and accelerations by its square, while weights stay what they are; no masses then explain both.
A force on the platform that is constant and vertical changes the balance as a small factor does, so
that only factors which no such force could imitate are looked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from par4_identification.logs.log import Log
from par4_identification.setup_check.equations import Stretch, equations_of
from par4_identification.setup_check.finding import Finding
from par4_kinematics.geometry import Geometry
from par4_sim.report.words import number, percent

SUSPICIOUS = 0.02
"""|residual| / |torque| from which the pace is looked at."""
LEAST = 1.25
"""Smallest factor of the times that is taken for a mistake of the setup: a vertical force of
half of the platform's weight looks like a factor of 1.22."""
PROBES = np.log((0.2, 0.5, 2.0, 5.0))
"""Logarithms of the factors that are tried first. With one of them the residual must be less than
`PROMISING` times that with the stamps as they are; else no further ones are tried."""
PROMISING = 0.8
PLACES = np.log(12.0) * np.linspace(-1.0, 1.0, 37)
"""Logarithms of the factors that are tried then."""
FEWEST = 50
"""Rows of each joint."""
LEFT, FEWER = 0.04, 0.35
"""Most that the right pace may leave, of the torque and of what the stamps leave."""
WHOLE = 0.06
"""Deviation, in logarithm, within which a factor is taken for a whole number or for one over it."""


@dataclass(frozen=True)
class TimeFactor:
    """By which factor the times of a log are too short or too long.

    Attributes:
        factor: true time over stamped time.
        before, after: |residual| / |torque| without and with it.
    """

    factor: float
    before: float
    after: float

    @property
    def is_whole(self) -> bool:
        """Whether it is a whole number or one over it, as factors of wrong rates mostly are."""
        return self.factor == self._whole

    @property
    def _whole(self) -> float:
        nearest = round(max(self.factor, 1.0 / self.factor))
        return float(nearest) if self.factor > 1.0 else 1.0 / nearest

    def rounded(self) -> TimeFactor:
        """Return the pace by a whole number, or one over it, if it is one but for its error."""
        near = abs(np.log(self.factor / self._whole)) < WHOLE
        return replace(self, factor=self._whole) if near else self


def pace_of(stretches: Sequence[Stretch], geometry: Geometry) -> TimeFactor | None:
    """Return the factor by which the times of stretches are off; None where they may be right.

    Raises:
        UnreachableError: joint positions with which the mechanism does not close.
    """
    def error(logarithm: float) -> float:
        """Return |residual| / |torque|, nothing taken out, with times that are longer."""
        rows = equations_of([_paced(part, float(np.exp(logarithm))) for part in stretches],
                            geometry)
        enough = (rows.valid.sum(axis=0) >= FEWEST).all()
        return float(np.sqrt(max(1.0 - rows.explained(), 0.0))) if enough else np.inf

    if not stretches:
        return None
    before = error(0.0)
    if not SUSPICIOUS < before < np.inf or min(map(error, PROBES)) > PROMISING * before:
        return None
    left = [error(place) for place in PLACES]
    lowest = int(np.argmin(left))
    if lowest in (0, len(PLACES) - 1):
        return None  # no bottom within reach
    found = scipy.optimize.minimize_scalar(
        error, bounds=PLACES[[lowest - 1, lowest + 1]], method='bounded', options={'xatol': 1e-3})
    pace = TimeFactor(float(np.exp(found.x)), before, float(found.fun)).rounded()
    if abs(np.log(pace.factor)) < np.log(LEAST) or pace.after > min(LEFT, FEWER * before):
        return None
    return pace


def _paced(part: Stretch, factor: float) -> Stretch:
    """Return a stretch whose times are longer by a factor."""
    return replace(part, period=factor * part.period, t=factor * part.t, qd=part.qd / factor,
                   qdd=part.qdd / factor ** 2, cutoff_hz=part.cutoff_hz / factor)


def pace_finding(pace: TimeFactor, log: Log) -> Finding:
    """Return what the times of a log are off by, as a finding."""
    rate, stamped = 1.0 / (pace.factor * log.period), 1.0 / log.period
    return Finding(
        'wrong_unit', tuple(range(log.q.shape[1])), None,
        f'weights and accelerations in {log.name} go together only if its samples came at '
        f'{number(rate, 3)} a second, not at the {number(stamped, 3)} of their stamps: so read, '
        f'the rigid bodies leave {percent(pace.after)} of the torque instead of '
        f'{percent(pace.before)}',
        'Check the rate that was given for the samples, or the clock that stamped them, and '
        'record or convert the log again.', pace.is_whole, not pace.is_whole)
