"""How a motion is stopped on its way: slower and slower along its own path, until it rests."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BPoly  # not when it is first used: loading it then costs 0.2 s

from par4_kinematics.motion import Motion

BRAKING_TIME = 0.2
"""Seconds from full pace to rest; half as much of the motion is still played."""
Ramp = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Times (n,), s, and q, qd, qdd (n, 4) of a way to rest."""


def braked(motion: Motion, start: float) -> Ramp:
    """Return how the joints come to rest on the path of a motion.

    The pace, motion seconds a second, falls from 1 to 0 as a cubic of time, so that velocity and
    acceleration go on without a jump: with s(t) = motion time, q = q(s), qd = q' s',
    qdd = q'' s'^2 + q' s''. Speeds are never above those of the motion; the pace adds at most
    1.5 / BRAKING_TIME times them to the accelerations.

    Args:
        motion: what is played.
        start: motion time at which it begins to brake, s.

    Returns:
        Times (n,) on the clock of the motion, from the first sample at or after `start` on, and q,
        qd, qdd (n, 4). Where the motion ends before it would rest, its own end, unchanged; where
        it has not begun, its first sample alone.
    """
    if start < 0.0:
        return motion.t[:1], motion.q[:1], np.zeros((1, 4)), np.zeros((1, 4))
    first = min(int(np.searchsorted(motion.t, start - 1e-9)), len(motion.t) - 1)
    last = int(np.searchsorted(motion.t, start + 0.5 * BRAKING_TIME)) + 1
    if last >= len(motion.t):
        rest = slice(first, None)
        return motion.t[rest], motion.q[rest], motion.qd[rest], motion.qdd[rest]
    begin = motion.t[first]
    elapsed = np.arange(int(np.ceil(BRAKING_TIME / motion.period)) + 1) * motion.period
    u = np.minimum(elapsed / BRAKING_TIME, 1.0)
    s = begin + BRAKING_TIME * (u - u ** 3 + 0.5 * u ** 4)
    pace = (1.0 - 3.0 * u ** 2 + 2.0 * u ** 3)[:, None]
    slowing = (6.0 * (u ** 2 - u) / BRAKING_TIME)[:, None]
    piece = slice(first, last + 1)
    path = BPoly.from_derivatives(
        motion.t[piece], np.stack((motion.q[piece], motion.qd[piece], motion.qdd[piece]), axis=1))
    slope = path.derivative()
    return (begin + elapsed, path(s), pace * slope(s),
            pace ** 2 * slope.derivative()(s) + slowing * slope(s))


def ways_to_rest(motion: Motion, now: float, lead: float, sent: float) -> list[Ramp]:
    """Return ways to rest of which at least one is in time, however late they arrive.

    A way that begins soon arrives too late on a busy machine. So there are several: the first
    begins after `lead`, each further one after twice as long, and the last where the points that
    have been sent end, from where nothing can be overtaken. They do not overlap in time. Sent from
    the last to the first, each that is in time replaces those before it, and one that is not is
    refused by the drives and leaves the others as they are.

    Args:
        motion: what is played.
        now: motion time, s.
        lead: seconds from now to where the first way begins.
        sent: motion time of the last point that has been sent, s.

    Returns:
        Ways of `braked`, from the first to the last; none where the motion ends before it could
        rest on the way.
    """
    ways: list[Ramp] = []
    ahead = lead
    while now + ahead < sent:
        way = braked(motion, now + ahead)
        if way[0][-1] >= sent:
            break
        ways.append(way)
        ahead = max(2.0 * ahead, way[0][-1] - now + motion.period)
    last = braked(motion, sent)
    if last[0][-1] < motion.t[-1]:
        ways.append(last)
    return ways
