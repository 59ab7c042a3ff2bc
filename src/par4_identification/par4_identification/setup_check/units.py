"""Degrees where radians belong, milliseconds where seconds do."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from par4_identification.logs.log import Log
from par4_identification.logs.stamps import SHORTEST_PERIOD
from par4_identification.setup_check.finding import Finding, SetupCheck
from par4_identification.setup_check.mending import slowed
from par4_kinematics.position import closes
from par4_kinematics.robot import Robot
from par4_sim.report.words import number

TURN = 3.5
"""rad; no arm of a Par4 comes so far from the horizontal."""
LEAST_CLOSED = 0.95
"""Share of samples with which the mechanism closes once they are in radians."""
PROBES = 200
LONGEST_PAR4_PERIOD = 0.05
"""s from sample to sample from which stamps of a Par4 count another unit."""
THOUSAND = 1e3
QUICKER = 3.0
"""Most by which a joint may exceed the speed limit of the robot file."""

Mend = tuple[Finding, Callable[[Log], Log]]
"""A finding and what mends a log of it."""


def in_si(check: SetupCheck) -> SetupCheck:
    """Return the check with positions in radians and times in seconds."""
    if not isinstance(check.machine, Robot):
        return check
    for number_of_log, log in enumerate(check.logs):
        mended = log
        for found in (_milliseconds(mended, check.machine), _degrees(mended, check.machine)):
            if found is not None:
                finding, mend = found
                mended = mend(mended)
                logs = list(check.logs)
                logs[number_of_log] = mended
                already = any(other.finding == finding.finding
                              and other.mend == finding.mend for other in check.findings)
                check = check.after(() if already else (finding,), logs)
    return check


def _degrees(log: Log, robot: Robot) -> Mend | None:
    """Return the finding that positions are in degrees, and how to mend it; or None."""
    probes = log.q[::max(1, len(log.q) // PROBES)]
    largest = float(np.quantile(np.abs(probes), 0.95))
    if largest < TURN or np.mean(closes(robot.geometry, np.radians(probes))) < LEAST_CLOSED:
        return None
    joints = tuple(range(log.q.shape[1]))
    return Finding(
        'wrong_unit', joints, None,
        f'positions reach {number(largest, 3)}, which as radians is more than half a turn of an '
        f'arm, and as degrees {number(math.radians(largest), 3)} rad, with which the mechanism '
        'closes',
        'Log positions in radians, value in degrees * pi / 180, or give par4_bag the unit deg.',
        True), lambda log: replace(log, q=np.radians(log.q))


def _milliseconds(log: Log, robot: Robot) -> Mend | None:
    """Return the finding that stamps count another unit, and how to mend it; or None."""
    if SHORTEST_PERIOD < log.period < LONGEST_PAR4_PERIOD:
        return None
    factor = 1.0 / THOUSAND if log.period >= LONGEST_PAR4_PERIOD else THOUSAND
    period = factor * log.period
    speed = np.abs(np.diff(log.q, axis=0)) / period
    fastest = float(np.quantile(speed, 0.99)) if len(speed) else 0.0
    if not (SHORTEST_PERIOD < period < LONGEST_PAR4_PERIOD
            and 0.0 < fastest < QUICKER * robot.limits.joint_speed):
        return None
    joints = tuple(range(log.q.shape[1]))
    unit = 'milliseconds' if factor < 1.0 else 'thousands of seconds'
    return Finding(
        'wrong_unit', joints, None,
        f'samples are {number(log.period, 3)} s apart by their stamps, at which the joints would '
        f'move at {number(factor * fastest, 2)} rad/s; the stamps count {unit}, samples being '
        f'{number(1e3 * period, 3)} ms apart and speeds up to {number(fastest, 2)} rad/s',
        'Fill sec and nanosec of the header stamp from seconds and nanoseconds, or give par4_bag '
        'the unit of the time.', True
    ), lambda log: slowed(log, factor)
