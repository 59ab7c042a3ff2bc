"""Whether the readings of a force sensor are late or early against the torques of the robot.

Force and torque of a push go together at one time only: at any other the growing and the fading
half of a push have different torques at the same force, also where friction is free. The delay at
which the pushes tell the gains best is that of the readings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from par4_identification.gains.known_payload import DriveGains
from par4_identification.gains.static_push import ForceReadings, gains_of_pushes, pushes_of_log
from par4_identification.logs.log import Log
from par4_kinematics.errors import InputError
from par4_kinematics.robot import Robot

PRECISE = 0.005
"""Relative standard deviation of gains below which no delay is looked for: it does not matter."""
REACH = 2.0
"""Longest delay that is looked for, s; pushes last seconds."""
STEPS = (0.1, 0.02, 0.004)
"""Between delays that are tried, s, each around the best of those before."""
GAIN = 3.0
"""Factor by which a delay must reduce the standard deviation of the gains to be believed. Friction
that the pushes do not determine exactly reduces it by less."""


@dataclass(frozen=True)
class LateReadings:
    """A delay of the readings of a force sensor.

    Attributes:
        delay: their stamps less those of the torques that go with them, s; negative if early.
        spread: relative standard deviation of the gains with the stamps as they are.
        mended: the same with the delay taken off.
    """

    delay: float
    spread: float
    mended: float


def relative_std(gains: DriveGains) -> float:
    """Return the largest standard deviation over its gain."""
    return float((gains.std / gains.values).max())


def late_readings(pairs: Sequence[tuple[Log, ForceReadings]], robot: Robot, gains: DriveGains,
                  coulomb_friction: float | None = None) -> LateReadings | None:
    """Return by how much the readings are late, None where nothing says that they are.

    Args:
        pairs: logs and the readings that go with them, all of one delay.
        robot: of the logs.
        gains: as estimated from the readings as they are stamped.
        coulomb_friction: see `gains_of_pushes`.
    """
    spread = relative_std(gains)
    if spread < PRECISE:
        return None

    def mended(delay: float) -> float:
        try:
            pushes = [push for log, readings in pairs for push in pushes_of_log(
                log, replace(readings, t=readings.t - delay), robot)]
            return relative_std(gains_of_pushes(pushes, robot, coulomb_friction))
        except InputError:  # so far off that nothing fits
            return math.inf

    best, reach = 0.0, REACH
    for step in STEPS:
        count = round(reach / step)
        best = min((best + step * np.arange(-count, count + 1)).tolist(), key=mended)
        reach = step
    found = LateReadings(best, spread, mended(best))
    return found if GAIN * found.mended < spread else None
