"""Samples between those of a slow log of an axis, where its joint turns back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy

from par4_identification.logs.log import Log
from par4_kinematics.robot import Axis, Robot

FINE_HZ = 1000.0
"""Rate of the samples of an axis from which columns are computed, at the least."""


def parts_of_sample(log: Log, machine: Robot | Axis) -> int:
    """Return how many samples `finer` makes of one of a log."""
    return 1 if isinstance(machine, Robot) else max(1, int(np.ceil(FINE_HZ * log.period - 1e-6)))


def finer(log: Log, machine: Robot | Axis) -> Log:
    """Return the log of an axis with samples between those of a slow one, by cubic splines.

    Positions and torques are smooth, as far as filters let them through. Friction is not: it
    changes its sign between two samples, and a column that changes it at a sample is wrong by half
    a sample at every reversal, which looks like a delay or like presliding.
    """
    parts = parts_of_sample(log, machine)
    if parts <= 1:
        return log
    period, pieces, end = log.period / parts, [], 0
    segments = []
    for segment in log.segments:
        t = log.t[segment]
        if len(t) < 2:
            continue
        times = t[0] + period * np.arange(parts * (len(t) - 1) + 1)
        doubtful = None if log.doubtful is None else log.doubtful[segment][
            np.round(np.arange(len(times)) / parts).astype(int)]
        pieces.append((times, *(scipy.interpolate.CubicSpline(t, values[segment])(times)
                                for values in (log.q, log.tau)), doubtful))
        segments.append(slice(end, end + len(times)))
        end += len(times)
    t, q, tau = (np.concatenate([piece[index] for piece in pieces]) for index in range(3))
    return replace(log, period=period, t=t, q=q, tau=tau, segments=tuple(segments), reference=None,
                   doubtful=None if log.doubtful is None else np.concatenate(
                       [piece[3] for piece in pieces]))
