"""Mistakes made on purpose: a recorded log as a careless setup or a bad logger would have told it.

Nothing here comes from `par4_identification.setup_check`; each mistake is done to the samples as
its cause does it: a plug in the wrong socket exchanges columns, a slow clock stretches time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from par4_identification.logs.log import Log
from par4_kinematics.robot import Robot


def exchanged(log: Log, one: int, other: int, *columns: str) -> Log:
    """Return the log with two joints exchanged in 'q', 'tau' or both."""
    order = np.arange(log.q.shape[1])
    order[[one, other]] = other, one
    return replace(log, **{name: getattr(log, name)[:, order] for name in columns})


def reversed_sign(log: Log, joints: Sequence[int], *columns: str) -> Log:
    """Return the log with the sign of some joints turned over in 'q', 'tau' or both."""
    sign = np.ones(log.q.shape[1])
    sign[list(joints)] = -1.0
    return replace(log, **{name: sign * getattr(log, name) for name in columns})


def in_degrees(log: Log) -> Log:
    """Return the log with positions in degrees."""
    return replace(log, q=np.degrees(log.q))


def in_milliseconds(log: Log) -> Log:
    """Return the log whose stamps count milliseconds where seconds belong."""
    return replace(log, t=1e3 * log.t, period=1e3 * log.period)


def at_another_rate(log: Log, factor: float) -> Log:
    """Return the log whose stamps are farther apart by a factor than its samples came."""
    return replace(log, t=factor * log.t, period=factor * log.period, reference=None)


def torque_as_voltage(log: Log, robot: Robot) -> Log:
    """Return the log of a recorder that wrote N m where volts belong: the gain counts twice."""
    return replace(log, tau=log.tau * np.asarray(robot.drives.gain))


def voltage_as_torque(log: Log, robot: Robot) -> Log:
    """Return the log of a recorder that wrote volts into the effort, N m."""
    return replace(log, tau=log.tau / np.asarray(robot.drives.gain))


def scaled(log: Log, factor: float) -> Log:
    """Return the log with all torques too large by a factor."""
    return replace(log, tau=factor * log.tau)


def zero_off(log: Log, offsets: np.ndarray) -> Log:
    """Return the log of encoders whose zeros are off by `offsets` (J,), rad."""
    return replace(log, q=log.q + offsets)


def recorded_late(log: Log, delay: float) -> Log:
    """Return the log whose torque is recorded `delay` s late, early where that is negative."""
    return _torque_at(log, log.t - delay)


def fast_clock(log: Log, rate: float) -> Log:
    """Return the log whose torque was stamped by a clock that runs fast by a fraction."""
    return _torque_at(log, log.t[0] + (log.t - log.t[0]) / (1.0 + rate))


def late_from(log: Log, start: float, delay: float) -> Log:
    """Return the log whose torque is late from `start` on, s after the first row."""
    times = np.where(log.t < log.t[0] + start, log.t, log.t - delay)
    return replace(log, tau=CubicSpline(log.t, log.tau)(times))


def _torque_at(log: Log, times: np.ndarray) -> Log:
    """Return the log with the torque of other times; what was never recorded is cut off."""
    kept = np.flatnonzero((times >= log.t[0]) & (times <= log.t[-1]))
    rows = slice(int(kept[0]), int(kept[-1]) + 1)
    tau = CubicSpline(log.t, log.tau)(times[rows])
    return replace(log, t=log.t[rows], q=log.q[rows], tau=tau, segments=(slice(0, len(tau)),))


def other_dimensions(robot: Robot, **errors: ArrayLike) -> Robot:
    """Return the robot file in which dimensions are wrong by these, m."""
    return robot.model_copy(update={'geometry': robot.geometry.with_errors(**errors)})


def frozen(log: Log, joint: int, start: float, end: float) -> Log:
    """Return the log whose encoder repeats its reading from `start` to `end`, s after the first."""
    rows, q = _rows(log, start, end), log.q.copy()
    q[rows, joint] = q[rows.start, joint]
    return replace(log, q=q)


def slipped(log: Log, joint: int, at: float, step: float) -> Log:
    """Return the log whose encoder slipped by `step` rad at a time, s after the first sample."""
    q = log.q.copy()
    q[_rows(log, at, np.inf), joint] += step
    return replace(log, q=q)


def held(log: Log, starts: np.ndarray, length: float) -> Log:
    """Return the log of a logger that repeats what it has, positions and torques, for a while."""
    q, tau = log.q.copy(), log.tau.copy()
    for start in starts:
        rows = _rows(log, float(start), float(start) + length)
        q[rows], tau[rows] = q[rows.start], tau[rows.start]
    return replace(log, q=q, tau=tau)


def spiked(log: Log, column: str, joint: int, times: np.ndarray, sizes: np.ndarray) -> Log:
    """Return the log with single wrong samples of 'q' or 'tau'."""
    values = getattr(log, column).copy()
    for time, size in zip(times, sizes, strict=True):
        values[_rows(log, float(time), np.inf).start, joint] += size
    return replace(log, **{column: values})


def clipped(log: Log, largest: float) -> Log:
    """Return the log of a recorder whose converter ends at +- `largest`, N m."""
    return replace(log, tau=np.clip(log.tau, -largest, largest))


def standing(log: Log, joints: Sequence[int] | None = None) -> Log:
    """Return the log of a machine that was never told to move: readings flicker by a count."""
    random = np.random.default_rng(len(log.t))
    q, tau = log.q.copy(), log.tau.copy()
    for joint in range(q.shape[1]) if joints is None else joints:
        count = np.min(np.abs(np.diff(q[:, joint]))[np.diff(q[:, joint]) != 0.0])
        q[:, joint] = q[0, joint] + count * random.integers(-1, 2, len(q))
        tau[:, joint] = tau[0, joint] + 0.05 * random.standard_normal(len(q))
    return replace(log, q=q, tau=tau)


def _rows(log: Log, start: float, end: float) -> slice:
    """Return the rows from one time to another, s after the first sample."""
    first, last = np.searchsorted(log.t - log.t[0], (start, end))
    return slice(int(first), int(last))
