"""How hard the drives answer a count of their encoders: a scale of the torque from their gains.

Faster than any motion there are the steps from count to count, and what the drives' loops make of
them: velocity_gain x position_gain of torque per radian, the other way. So torque and reading tell
that product of gains together, and the robot file tells it, too. The recorder holds or averages the
commands on either side of a sample, of which at least one answers the reading: between half of the
product and all of it shows. That is so for drives with a speed of their own, as from a tachometer.
Drives that take the speed from the encoder answer its steps once more, by the change since the last
reading; how hard depends on their filters, so that their answer tells no scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_identification.logs.log import Log
from par4_identification.signals.filtering import low_pass
from par4_kinematics.robot import Drives

TOLD_IN_FILE = {'velocity_gain', 'position_gain', 'encoder_counts'}
ABOVE = 0.15
"""Frequency, in samples, above which no motion is."""
LEAST_RATE_HZ = 400.0
PIECE, PIECES = 0.5, 10
"""s of a piece from which the answer is taken, and pieces that are needed; the median counts."""
DIFFERENCED = 0.1
"""Answer to the change of a reading over that to the reading, above which the drives difference it.
"""
DEVIATIONS = 6.0
"""Standard deviations that the answer must be from zero."""
LEAST_SHOWN, MOST_SHOWN = 0.4, 1.2
"""Bounds of the answer in the product of the gains."""


@dataclass(frozen=True)
class DriveAnswer:
    """What torque answers readings.

    Attributes:
        measured: N m/rad, median over pieces of the logs.
        expected: velocity_gain x position_gain of the robot file, N m/rad.
    """

    measured: float
    expected: float

    def scaled_by(self, factor: float) -> bool:
        """Return whether the torque is so many times too large, and cannot be right as it is.

        A factor within which right answers differ from each other is none that tells.
        """
        def within(share: float) -> bool:
            return LEAST_SHOWN < share < MOST_SHOWN

        share = self.measured / self.expected
        tells = max(factor, 1.0 / factor) > MOST_SHOWN / LEAST_SHOWN
        return tells and within(share / factor) and not within(share)


def answer_of(logs: Sequence[Log], drives: Drives) -> DriveAnswer | None:
    """Return how hard the drives answer, or None where that does not show or tells no scale.

    Args:
        logs: with readings in counts.
        drives: of the robot file; gains that it leaves to their defaults tell nothing.
    """
    expected = drives.velocity_gain * drives.position_gain
    if not drives.model_fields_set >= TOLD_IN_FILE or not expected or not drives.encoder_counts:
        return None
    found, of_changes = [], []
    for log in logs:
        if log.period * LEAST_RATE_HZ > 1.0:
            continue
        length = round(PIECE / log.period)
        for segment in log.segments:
            if segment.stop - segment.start < 2 * length:
                continue
            fast = [values[segment] - low_pass(values[segment], ABOVE / log.period, log.period)
                    for values in (log.q, log.tau)]
            for start in range(0, len(fast[0]) - length + 1, length):
                q, tau = (part[start:start + length] for part in fast)
                power = float(np.sum(q ** 2))
                if power > 0.0:
                    found.append(-float(np.sum(q * tau)) / power)
                    both = np.stack((q[1:].ravel(), np.diff(q, axis=0).ravel()), axis=1)
                    of_changes.append(-np.linalg.lstsq(both, tau[1:].ravel(), rcond=1e-9)[0][1])
    if len(found) < PIECES or np.median(of_changes) > DIFFERENCED * np.median(found):
        return None
    middle = float(np.median(found))
    std = 1.4826 * float(np.median(np.abs(np.array(found) - middle))) / np.sqrt(len(found))
    return DriveAnswer(middle, expected) if middle > DEVIATIONS * std > 0.0 else None
