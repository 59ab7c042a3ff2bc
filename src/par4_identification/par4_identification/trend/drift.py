"""Whether a machine drifts away from its model, from window to window of measured torque.

Each window of a log gives the residual of a model, filtered as for identification. It is projected
on what a joint can do that a model does not know: a constant torque, Coulomb friction, viscous
friction, inertia. The first windows say how these projections scatter on this machine on its own
work, errors of the model included. From then on each runs in two cumulative sums (Page 1954), one
upward and one downward: they add up what lies more than SLACK standard deviations from the mean,
and alarm at LEVEL. A sum tells since when it has been growing. It does not tell what the residual
acts like: beside a strong cause every sum that resembles it grows as fast as CLIP lets it. That is
the word along which most torque has come together since its sum began to grow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from par4_dynamics.model import Model
from par4_identification.logs.log import Log
from par4_identification.signals.rows import runs_of_log
from par4_identification.trend.windows import LEARNING
from par4_kinematics.robot import Robot

SLACK = 1.5
"""Standard deviations by which a window may lie off the mean without anything being added."""
LEVEL = 20.0
"""Standard deviations, added up, that alarm: far above what chance adds up, because what was learnt
from some windows is itself off by chance. docs/benchmarks.md has the rate that was measured."""
QUIET = 0.75 * LEVEL
"""Sum below which an alarm ends: about its level it would come and go with every window."""
HIGHEST = 1.75 * LEVEL
"""Of a sum: after a repair an alarm lasts no longer than some windows, however old it is."""
CLIP = 5.0
"""Largest deviation of one window that is added: no single window alarms."""
LEAST = 1e-6
"""N m: smallest scatter of a projection, which no machine has and rounding does not reach. Windows
of equal torque, such as of a simulation without noise, scatter by nothing at all."""
MOVING = 0.2
"""Share of a window's rows in which a joint must move."""
WORDS = {'constant torque': 'N m', 'Coulomb friction': 'N m', 'viscous friction': 'N m s/rad',
         'inertia': 'kg m2'}
"""What a residual can act like, with the unit of its size."""


@dataclass(frozen=True)
class Drift:
    """A joint that no longer does what its model says.

    Attributes:
        joint: index.
        acts_like: one of WORDS.
        size: by how much more than on the windows learnt from, in the unit of WORDS.
        since: time of the last window without it, s; NaN if that was before the clock was set back.
    """

    joint: int
    acts_like: str
    size: float
    since: float

    def __str__(self) -> str:
        """Return it in words."""
        since = ('before the clock was set back' if math.isnan(self.since) else
                 f'{self.since:.0f} s')
        return (f'joint {self.joint} has {self.size:+.3g} {WORDS[self.acts_like]} of '
                f'{self.acts_like} beside its model since {since}')


def projections(log: Log, robot: Robot, model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what the residual of a window looks like.

    Returns:
        Projections (J, 4) of the residual on the unit vector of each of WORDS, N m; the length of
        that vector before it was made one, (J, 4), so that projection / length is a size; and the
        residual's rms (J,), N m. NaN for a joint that hardly moves.

    Raises:
        InputError: a window too short or too slow for the filters.
        UnreachableError: positions with which the mechanism does not close.
    """
    run, = runs_of_log(log, robot)
    state = run.state
    columns = run.rows(np.stack((np.ones_like(state.qd), state.direction, state.qd, state.qdd),
                                axis=-1))
    residual = run.tau - run.rows(model.torque(state))
    shape = (residual.shape[1], len(WORDS))
    projected, lengths = np.full(shape, np.nan), np.full(shape, np.nan)
    rms = np.full(shape[0], np.nan)
    for joint in range(shape[0]):
        valid = run.valid[:, joint]
        if valid.mean() < MOVING:
            continue
        directions, left = columns[valid, joint], residual[valid, joint]
        lengths[joint] = np.linalg.norm(directions, axis=0)
        projected[joint] = left @ directions / lengths[joint]
        rms[joint] = math.sqrt(np.mean(left ** 2))
    return projected, lengths, rms


class DriftWatch:
    """Cumulative sums over the windows of one machine on its work.

    Args:
        joints: number of them.
        learning: windows to learn from.

    Attributes:
        windows: how many were taken.
    """

    def __init__(self, joints: int, learning: int = LEARNING) -> None:
        self.windows = 0
        self._wanted = learning
        self._learnt: list[list[np.ndarray]] = [[] for _ in range(joints)]
        self._mean = np.zeros((joints, len(WORDS)))
        self._scatter = np.ones((joints, len(WORDS)))
        self._sums = np.zeros((2, joints, len(WORDS)))
        self._since = np.zeros((2, joints, len(WORDS)))
        self._excess = np.zeros((2, joints, len(WORDS)))
        self._size = np.zeros((2, joints, len(WORDS)))
        self._grown = np.zeros((2, joints, len(WORDS)))
        self._alarmed = np.zeros(joints, dtype=bool)

    @property
    def learning(self) -> int:
        """How many windows are still needed to know what is normal of a first joint.

        Each joint is watched from then on, be it that another one always rests.
        """
        return max(0, self._wanted - max(map(len, self._learnt)))

    @property
    def unknown(self) -> tuple[int, ...]:
        """Joints of which it is not known yet what is normal."""
        return tuple(joint for joint, learnt in enumerate(self._learnt)
                     if len(learnt) < self._wanted)

    def take(self, end: float, projected: np.ndarray, lengths: np.ndarray) -> None:
        """Take the `projections` (J, 4) of the window that ends at `end`, s."""
        self.windows += 1
        there = ~np.isnan(projected)
        for joint, learnt in enumerate(self._learnt):
            if len(learnt) == self._wanted:
                continue
            if there[joint].all():
                learnt.append(projected[joint])
                self._since[:, joint] = end
                if len(learnt) == self._wanted:
                    self._mean[joint] = np.mean(learnt, axis=0)
                    self._scatter[joint] = np.maximum(np.std(learnt, axis=0, ddof=1), LEAST)
            there[joint] = False
        excess = np.where(there, projected - self._mean, 0.0)
        size = np.where(there, excess / lengths, 0.0)
        for side, sign in enumerate((1.0, -1.0)):
            step = np.where(there, np.minimum(sign * excess / self._scatter, CLIP) - SLACK, 0.0)
            self._sums[side] = np.clip(self._sums[side] + step, 0.0, HIGHEST)
            rests = self._sums[side] == 0.0
            self._since[side][rests & there] = end
            self._grown[side] = np.where(rests, 0.0, self._grown[side] + there)
            self._excess[side] = np.where(rests, 0.0, self._excess[side] + excess)
            self._size[side] = np.where(rests, 0.0, self._size[side] + size)
        highest = self._sums.max(axis=(0, 2))
        self._alarmed = highest >= np.where(self._alarmed, QUIET, LEVEL)

    def clock_set_back(self) -> None:
        """Forget when what is there began: its time may come again."""
        self._since[:] = np.nan

    @property
    def drifts(self) -> list[Drift]:
        """What alarms now, one a joint: along what most torque has come together."""
        found = []
        for joint in np.flatnonzero(self._alarmed):
            side, kind = np.unravel_index(np.argmax(np.abs(self._excess[:, joint])),
                                          self._excess[:, joint].shape)
            found.append(Drift(int(joint), list(WORDS)[kind],
                               float(self._size[side, joint, kind]
                                     / self._grown[side, joint, kind]),
                               float(self._since[side, joint, kind])))
        return found
