"""Rows of one uninterrupted stretch of a log, with the filter that makes rows of its columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from par4_dynamics.state import State
from par4_identification.logs.masks import near
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.filtering import low_pass
from par4_identification.signals.smoothing import UNCHANGED, Smoother
from par4_identification.signals.timing import ROUNDED


@dataclass(frozen=True)
class Run:
    """Rows of one uninterrupted stretch of a log.

    Attributes:
        name: of the log.
        state: filtered motion at the rate of the log, (n, J); of plateaus a sample each.
        t: of the rows, s since the start of the log, (m,); of plateaus their numbers.
        speed: joint speed at the rows, (m, J).
        tau: filtered torque, (m, J), N m.
        valid: rows that say something, (m, J).
        standstill: rows at which the joint rests well within a dwell, (m, J).
        noise_floor: standard deviation of the rows that white torque noise of the level measured
            above the torque's pass band would cause, (J,), N m; of plateaus that of their means.
        period: of the samples of the log, s; zero of plateaus.
        smoother: filter of the positions before the low-pass.
        likely: positions of a motion as lively as the true one, (n, J), rad; empty of plateaus.
        coarse: whether speeds, too, are those of the filtered positions.
        counts: of the encoders a turn, 0 where they are not known.
        position_noise: standard deviation of the white noise of the positions where counts are not
            known, (J,), rad, or of the speeds that they are the integral of, rad/s; zero of
            plateaus.
        integrated: whether it is that of speeds.
        timing_error: standard deviation of the rows that instants of reading up to `READ_WITHIN`
            beside their stamps would cause, and of a Par4 ticks between samples, (m, J), N m; zero
            of plateaus.
        turning_error: the same of times of turning that are wrong by `TURNED_WITHIN`, over the
            Coulomb friction of the joint, (m, J).
        torque_step: of which all torque readings are multiples, (J,) N m; zero where there is none.
        apart: what base parameters (J,) this log has beyond others, by name. Its torque is taken
            out of `tau`; joints carry its bodies all the same.
    """

    name: str
    state: State
    t: np.ndarray
    speed: np.ndarray
    tau: np.ndarray
    valid: np.ndarray
    standstill: np.ndarray
    noise_floor: np.ndarray
    conditioning: Conditioning
    _first: int
    _every: int
    period: float = 0.0
    smoother: Smoother = UNCHANGED
    likely: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))
    coarse: bool = False
    counts: int = 0
    position_noise: np.ndarray = field(default_factory=lambda: np.zeros(1))
    integrated: bool = False
    timing_error: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))
    turning_error: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)))
    torque_step: np.ndarray = field(default_factory=lambda: np.zeros(1))
    apart: Mapping[str, np.ndarray] = field(default_factory=dict)

    def rows(self, columns: np.ndarray) -> np.ndarray:
        """Return columns (n, J, ...) of `state` filtered like the torque, at the rows (m, ...)."""
        if self.conditioning.steady:
            return columns
        period = float(self.state.t[1] - self.state.t[0])
        return low_pass(columns, self.conditioning.torque_cutoff_hz, period,
                        rows=slice(self._first, len(columns) - self._first, self._every))

    def adjoint(self, rows: np.ndarray) -> np.ndarray:
        """Return values z (n, J) at the samples of rows r (m, J).

        The sum of z c is that of r `rows(c)` for any columns c (n, J), as the filter has no phase,
        but for what it reflects through the ends: some thousandths where a run takes 12 s.
        """
        if self.conditioning.steady:
            return rows
        placed = np.zeros_like(self.state.q)
        placed[self._first:len(placed) - self._first:self._every] = rows
        return low_pass(placed, self.conditioning.torque_cutoff_hz,
                        float(self.state.t[1] - self.state.t[0]))

    @property
    def row_time(self) -> float:
        """Time that a row stands for, s; zero of plateaus, which have times of their own."""
        return 0.0 if self.conditioning.steady else float(
            self._every * (self.state.t[1] - self.state.t[0]))

    def at_rows(self, values: np.ndarray) -> np.ndarray:
        """Return values (n, ...) at the samples as they are at the rows, (m, ...), unfiltered."""
        return values[self._first:len(self.state.t) - self._first:self._every]

    @property
    def q(self) -> np.ndarray:
        """Joint positions at the rows, (m, J)."""
        return self.at_rows(self.state.q)

    def with_friction(self, coulomb: np.ndarray, inertia: np.ndarray) -> Run:
        """Return the same run with joints that turn back when such friction lets them.

        What is left of the error of these times counts as the times of readings do.

        Args:
            coulomb: friction of each joint, (J,) N m.
            inertia: that each joint moves, (J,) kg m2.
        """
        bend = ROUNDED / self.conditioning.position_cutoff_hz * 2.0 * coulomb / inertia
        return replace(self, state=replace(self.state, bend=bend), timing_error=np.hypot(
            self.timing_error, coulomb * self.turning_error))

    def remembered(self, memory: float) -> Run:
        """Return the same run without rows that follow from what was before it, s before them.

        Before one that begins at rest nothing was. Of a short one at least half stays.
        """
        state = self.state
        if state.measured is None:
            return self
        memory = min(memory, 0.5 * float(state.t[-1] - state.t[0]))
        return self.part(self.t >= state.t[0] + memory)

    def without(self, samples: np.ndarray) -> Run:
        """Return the same run without the rows that filters let some samples (n,) into."""
        if not samples.any():
            return self
        reach = int(np.ceil(self.conditioning.reach / self.row_time * self._every))
        taken = ~near(samples[:, None], reach)[:, 0]
        kept = taken[self._first:len(taken) - self._first:self._every]
        return self if kept[self.valid.any(axis=1)].all() else self.part(kept)

    def part(self, rows: slice | np.ndarray) -> Run:
        """Return the same run with only `rows` of it, or those where they are true, valid."""
        inside = np.zeros(len(self.t), dtype=bool)
        inside[rows] = True
        return replace(self, valid=self.valid & inside[:, None],
                       standstill=self.standstill & inside[:, None])


def longest_motion(runs: Sequence[Run]) -> Run:
    """Return the run with the most rows at which a joint says something; of equals the first.

    The run that lasts longest may be one in which the machine rests.
    """
    return max(runs, key=lambda run: int(run.valid.any(axis=1).sum()))
