"""Torques of references that come message by message: what friction remembers goes on."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from par4_dynamics.effects.presliding import Presliding, built_up, levels_of, plateaus
from par4_dynamics.model import Model
from par4_dynamics.state import State
from par4_kinematics.geometry import LEGS
from par4_kinematics.limits import check_points, check_torque
from par4_kinematics.robot import Robot
from par4_kinematics.stamps import SECOND

KEPT = 5 * SECOND
"""ns before a message of which the points are kept: a way to rest begins before points that were
sent a second ahead, and several of them come in the order of the last one first."""


@dataclass(frozen=True)
class _Points:
    """Points of a message: stamps (n,) ns, q (n, 4), and the built-up share of each presliding."""

    stamp_ns: np.ndarray
    q: np.ndarray
    shares: tuple[np.ndarray, ...]

    def at(self, row: int) -> _Points:
        """Return one of them."""
        return _Points(self.stamp_ns[row, None], self.q[row, None],
                       tuple(share[row, None] for share in self.shares))


class Feedforward:
    """The torques of a model for a motion of which each message tells a part.

    Friction that builds up after a reversal (`presliding`) goes on from the point before a message,
    also where the message takes the place of the rest of the one before. Where no point is before
    it, friction is built up on joints that move, as (20) has it, and not on those that rest. Time
    counts from the first stamp, at which the machine is cold (`friction_drift`). A message without
    a stamp is a motion of its own.

    Args:
        robot: the machine.
        model: of it.
        torque_factor: by how much a torque may exceed the limit of the drives.
    """

    def __init__(self, robot: Robot, model: Model, torque_factor: float = 1.0) -> None:
        self._robot, self._model = robot, model
        self._limit = torque_factor * model.limit_of_drives(robot)
        self._building_up = tuple(active for active in model.effects
                                  if isinstance(active.effect, Presliding))
        self._first_ns: int | None = None
        self._past: deque[_Points] = deque()

    @property
    def around(self) -> tuple[str, ...]:
        """Names of the effects of the model that follow from the motion around a point."""
        return tuple(dict.fromkeys(active.effect.name for active in self._model.effects
                                   if active.effect.looks_around))

    def effort(self, stamp_ns: int, from_start_ns: np.ndarray, q: np.ndarray, qd: np.ndarray,
               qdd: np.ndarray) -> np.ndarray:
        """Return the torques (n, 4), N m, of the points of a message; single ones are quick.

        Args:
            stamp_ns: of the message; 0 for none.
            from_start_ns: time of each point from the stamp, increasing, (n,) int64.
            q, qd, qdd: (n, 4).

        Raises:
            InputError: points beyond the limits of the robot, or torques beyond that of its drives.
            UnreachableError: joint positions with which the mechanism does not close.
        """
        check_points(self._robot, q, qd, qdd)
        times = stamp_ns + from_start_ns
        first = self._first_of(stamp_ns, int(times[0]))
        rows = slice(None) if len(q) > 1 else 0
        t = (times - first) / SECOND
        torque = self._model.torque_of_joints(
            self._robot.geometry, q[rows], qd[rows], qdd[rows], t[rows]).reshape(-1, LEGS)
        before = self._before(stamp_ns, int(times[0]))
        level, asymmetry = levels_of(self._model.whole)
        told, shares = self._model.dry_share(t) * self._model.scale(State(t, q, qd, qdd)), []
        for index, active in enumerate(self._building_up):
            distance, acting = float(active.values['distance'][0]), list(active.joints)
            if before is None:
                share = built_up(q, distance, np.sign(qd[0]))
            else:
                share = built_up(np.concatenate((before.q, q)), distance,
                                 before.shares[index])[1:]
            torque[:, acting] += (told * (
                plateaus(level, asymmetry, share)
                - plateaus(level, asymmetry, built_up(q, distance))))[:, acting]
            shares.append(share)
        check_torque(self._robot, torque, self._limit)
        if stamp_ns:
            self._first_ns = first
        if stamp_ns and self._building_up:
            self._remember(_Points(times, q, tuple(shares)))
        return torque

    def _first_of(self, stamp_ns: int, start_ns: int) -> int:
        """Return the time from which that of a message counts, ns."""
        if not stamp_ns:
            return 0
        return start_ns if self._first_ns is None else min(self._first_ns, start_ns)

    def _before(self, stamp_ns: int, start_ns: int) -> _Points | None:
        """Return the last point before a message by those that were sent last; None if none is."""
        if not stamp_ns:
            return None
        return next((points.at(int(np.searchsorted(points.stamp_ns, start_ns)) - 1)
                     for points in reversed(self._past) if points.stamp_ns[0] < start_ns), None)

    def _remember(self, new: _Points) -> None:
        """Keep the points of a message in the place of messages that were to begin after it."""
        start_ns = int(new.stamp_ns[0])
        while self._past and self._past[-1].stamp_ns[0] >= start_ns:
            self._past.pop()
        while len(self._past) > 1 and self._past[1].stamp_ns[0] < start_ns - KEPT:
            self._past.popleft()
        self._past.append(new)
