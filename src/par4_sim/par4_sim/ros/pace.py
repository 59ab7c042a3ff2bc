"""How fast a simulation runs against the wall clock, what takes the time, and what would do."""

from __future__ import annotations

import math
import time
from collections import deque

from par4_kinematics.stamps import SECOND

WINDOW = 5.0
"""Seconds of wall time over which the pace is measured."""
KEPT = 0.95
"""Share of the pace asked for that counts as keeping it."""
REGAINED = 0.98
"""Share of it that a simulation which was too slow must have had for a whole window to count so
again: on a busy machine it is too slow, and is not, every few seconds."""
STEPS = (0.5e-3, 1e-3)
"""Physics steps, s, that are proposed where the default is too much work."""
COST = {'exact': 0.0041, 'fast': 0.13, 'accurate': 0.13}
"""Error of the torque with a step of 1 ms, percent of its peak (docs/benchmarks.md)."""


class Pace:
    """The measured pace of a simulation.

    Attributes:
        physics: seconds of wall time spent in the physics so far; added to by the loop.
        factor: simulated seconds a second of the wall, over the last WINDOW; NaN while it stood.
    """

    def __init__(self, asked: float, fidelity: str, step: float) -> None:
        """Measure a simulation that is asked for `asked` x real time with physics steps of `step`.
        """
        self.physics = 0.0
        self.factor = math.nan
        self._asked, self._fidelity, self._step = asked, fidelity, step
        self._marks: deque[tuple[float, int, float]] = deque()
        self._share = 0.0
        self._slow = False
        self._regained: float | None = None

    def measure(self, now_ns: int, standing: bool) -> None:
        """Take the time of the newest sample; `standing` begins the window anew."""
        now = time.monotonic()
        if standing:
            self._marks.clear()
            self.factor, self._slow = math.nan, False
            return
        self._marks.append((now, now_ns, self.physics))
        while len(self._marks) > 2 and now - self._marks[1][0] >= WINDOW:
            self._marks.popleft()
        since, since_ns, physics = self._marks[0]
        if now > since:
            self.factor = (now_ns - since_ns) / SECOND / (now - since)
            self._share = (self.physics - physics) / (now - since)
        if now - since >= 0.9 * WINDOW:
            self._judge(now)

    def _judge(self, now: float) -> None:
        """Note whether the simulation is too slow, by its pace over a whole window until now."""
        if self.factor < REGAINED * self._asked:
            self._regained = None
            self._slow = self._slow or self.factor < KEPT * self._asked
        elif self._regained is None:
            self._regained = now
        if self._regained is not None and now - self._regained >= WINDOW:
            self._slow = False

    @property
    def complaint(self) -> str:
        """What to do about a pace that is not kept; empty where it is, or is not known yet."""
        return self._remedy() if self._slow else ''

    def _remedy(self) -> str:
        if self.factor <= 0.0:
            return 'the simulated clock stands still; run less beside it on this machine'
        # wall time a simulated second takes: in the physics, which steps divide, and elsewhere
        physics, elsewhere = self._share / self.factor, (1.0 - self._share) / self.factor
        for step in STEPS:
            if step > self._step and physics * self._step / step + elsewhere < KEPT / self._asked:
                return (f'physics_step:={step:g} would do (1 ms costs {COST[self._fidelity]:g} % '
                        f'of the torque), or real_time_factor:={0.9 * self.factor:.2g}')
        return (f'real_time_factor:={0.9 * self.factor:.2g} would do, a lower publish_rate_hz or '
                f'less beside it on this machine')
