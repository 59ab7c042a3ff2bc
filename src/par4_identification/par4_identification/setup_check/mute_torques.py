"""Torques without a sensor: they stand still while the joint turns round, or are another's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches
from par4_identification.setup_check.held_readings import FEWEST

MUTE, OUT_AND_BACK = 0.1, 0.2
"""A torque that stays exactly the same for so many seconds is not measured if its joint meanwhile
goes out and back by so much of its range: turning round takes torque, for friction and inertia."""
LASTING = 0.9
"""Least speed at the end over that at the beginning, of a joint that something drives."""
COPIED, APART_WAY = 1.0, 0.2
"""Of two torques that are equal to the last bit for so many seconds one is a copy, if the two
joints meanwhile move apart by so much of the range of one."""


@dataclass(frozen=True)
class Mute:
    """A stretch over which the torque of a joint is not its own.

    Attributes:
        start, end: rows, the end excluded.
        joint: whose torque it is.
        copied_from: the joint whose torque is told again; None where the torque stands still.
    """

    start: int
    end: int
    joint: int
    copied_from: int | None


def mute_torques(log: Log, swings: bool = True) -> list[Mute]:
    """Return where a torque stands still while its joint turns round, or is that of another.

    A drive at its limit may turn a joint round, and one without power lets it swing. So a torque
    that moves elsewhere must stand below its largest, and beside torques that move unless nothing
    `swings` the joint but its drive. Without power a joint slows down, so that a torque of nothing
    at a lasting speed is none that moves the joint.
    """
    way, top = np.ptp(log.q, axis=0), np.abs(log.tau).max(axis=0)
    dead = np.ptp(log.tau, axis=0) == 0.0
    found = []
    for segment in log.segments:
        q, tau = log.q[segment], log.tau[segment]
        for joint in range(q.shape[1]):
            for start, last in stretches(np.diff(tau[:, joint]) == 0.0):
                end = last + 1
                if end - start < max(FEWEST, MUTE / log.period):
                    continue
                own, beside = q[start:end, joint], np.delete(tau[start:end], joint, axis=1)
                silent = dead[joint] or (abs(tau[start, joint]) < top[joint] and (
                    not swings or bool(np.ptp(beside, axis=0).any())))
                turns = np.ptp(own) - abs(own[-1] - own[0]) > OUT_AND_BACK * way[joint] > 0.0
                carried = (tau[start, joint] == 0.0 and (end - start) * log.period >= COPIED
                           and np.ptp(own) > OUT_AND_BACK * way[joint] > 0.0 and _lasts(own))
                if (silent and turns) or carried:
                    found.append(Mute(segment.start + start, segment.start + end, joint, None))
            for other in range(joint):
                for start, end in stretches(tau[:, joint] == tau[:, other]):
                    apart = np.ptp(q[start:end, joint] - q[start:end, other])
                    if (end - start) * log.period >= COPIED and apart > APART_WAY * way[joint] and (
                            np.ptp(tau[start:end, joint]) > 0.0):
                        found.append(Mute(segment.start + start, segment.start + end, joint, other))
    return found


def _lasts(q: np.ndarray) -> bool:
    """Return whether a joint whose positions are (n,) ends no slower than it begins."""
    quarter = len(q) // 4
    before, after = q[quarter] - q[0], q[-1] - q[-1 - quarter]
    return bool(before * after > LASTING * before ** 2)
