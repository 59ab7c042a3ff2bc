"""Torques of a converter that clips: it repeats its largest value."""

from __future__ import annotations

import numpy as np

from par4_identification.logs.clips import FLAT, FLAT_RUNS, FLATS, SWITCHED
from par4_identification.logs.log import Log
from par4_identification.logs.masks import stretches

PILED = 4.0
"""Ratio of the samples at that value to those at the one next to it, at the least."""


def flat_tops(log: Log) -> np.ndarray:
    """Return which torques (n, J) stand at their end as those of a full converter do.

    Both ends are looked at, which need not be as far from zero. A torque in coarse steps stands at
    its largest value, too, but hardly more often than at the one beside it, and one that switches
    between levels comes from another level.
    """
    flat = np.zeros(log.tau.shape, dtype=bool)
    for joint, tau in enumerate(log.tau.T):
        least, most = tau.min(), tau.max()
        if least == most:
            continue
        often = np.unique(tau[(least < tau) & (tau < most)], return_counts=True)[1]
        ends = [end for end, outward, beside in ((least, least < 0.0, often[:1].sum()),
                                                 (most, most > 0.0, often[-1:].sum()))
                if outward and np.count_nonzero(tau == end) > PILED * beside]
        runs = [run for end in ends for run in stretches(tau == end) if run[1] - run[0] >= FLAT]
        steps = np.abs(np.diff(tau))[[row - 1 for run in runs for row in run if 0 < row < len(tau)]]
        switches = len(steps) > 0 and np.median(steps) > SWITCHED * (most - least)
        if (len(runs) >= FLAT_RUNS and not switches
                and sum(end - start for start, end in runs) >= FLATS):
            flat[:, joint] = np.isin(tau, ends)
    return flat
