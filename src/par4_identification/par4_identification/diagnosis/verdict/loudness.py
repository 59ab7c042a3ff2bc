"""Whether what a model leaves is louder where the machine does something: then it is no noise.

A load that bounces in a gap, a tool on a belt or a stop leave what no function of the motion
follows. But they leave it where joints are fast, where they accelerate or where little torque
presses them to one side. Noise that wanders is as loud everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from par4_identification.diagnosis.verdict.unrelated import Left

PARTS = 4
"""Parts of the rows, from those where a joint does least to those where it does most."""
LOUDER = 4.0
"""Ratio of the mean squares of two such parts above which what is left follows the motion."""
FEWEST = 50
"""Rows of a part that tell its loudness."""


def follows_in_size(fit: Sequence[Left], heldout: Sequence[Left]) -> bool:
    """Return whether what is left is far louder where a joint moves in some way.

    Rows to fit say in which way and where, rows held out how much. By what the causes may be wrong
    counts for nothing where it is loud.

    Args:
        fit, heldout: what the model leaves, see `unrelated.left_of`.
    """
    return any(_ratio(fit, heldout, joint) > LOUDER for joint in range(fit[0][1].shape[1]))


def _ratio(fit: Sequence[Left], heldout: Sequence[Left], joint: int) -> float:
    """Return the mean square of the loudest part over that of the quietest, of rows held out."""
    if not (fit and heldout):
        return 1.0
    here, there = _rows_of(fit, joint), _rows_of(heldout, joint)
    if min(len(here[0]), len(there[0])) < PARTS * FEWEST:
        return 1.0
    best = 0.0, 1.0
    for own, other in zip(here[2].T, there[2].T):
        edges = np.quantile(own, np.arange(1, PARTS) / PARTS)
        seen, told = np.searchsorted(edges, own), np.searchsorted(edges, other)
        enough = np.flatnonzero(np.bincount(told, minlength=PARTS) >= FEWEST)
        if len(enough) < 2:
            continue
        squares = np.bincount(seen, here[0], PARTS) / np.maximum(np.bincount(seen, None, PARTS), 1)
        loud, quiet = (int(enough[pick(squares[enough])]) for pick in (np.argmax, np.argmin))
        again = np.mean(there[0][told == loud] - there[1][told == loud])
        ratio = float(again / max(np.mean(there[0][told == quiet]), 1e-30))
        best = max(best, (float(squares[loud] / max(squares[quiet], 1e-30)), ratio))
    return best[1]


def _rows_of(parts: Sequence[Left], joint: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return of a joint's rows the squares left, those that may be wrong, and what it does.

    The first two are (n,), N2 m2; the last are speed, acceleration and torque without their signs,
    (n, 3).
    """
    found = []
    for run, left, wrong in parts:
        valid = run.valid[:, joint]
        does = np.abs(np.stack((run.speed[:, joint], run.at_rows(run.state.qdd)[:, joint],
                                run.tau[:, joint] - left[:, joint]), axis=1))
        found.append((left[valid, joint] ** 2, wrong[valid, joint] ** 2, does[valid]))
    squares, wrong, does = (np.concatenate(part) for part in zip(*found))
    return squares, wrong, does
