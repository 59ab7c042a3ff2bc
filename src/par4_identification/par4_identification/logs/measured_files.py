"""From the columns of a logger's files to what they measured: units, stamps, turns that go on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from par4_identification.logs.clips import clips_of
from par4_identification.logs.column_choice import (
    Choice,
    Scales,
    motion_choice,
    refuse_unused,
    si_factors,
)
from par4_identification.logs.dates import DATES
from par4_identification.logs.integrated import ways_of
from par4_identification.logs.measured import Measured, are_readings
from par4_identification.logs.tables import Part, beside, read_tables, refuse_few
from par4_identification.logs.topic_signal import MOST_CONFLICTS
from par4_identification.logs.units import HIGHEST_RATE_HZ, LOWEST_RATE_HZ, TURN
from par4_kinematics.errors import InputError
from par4_kinematics.stamps import SECOND

LATEST = 2.0 ** 31
"""Seconds that a stamp of ROS holds."""
EPOCH = 1e8
"""s from which on a time counts from 1970 and is kept; others begin with the stamp of one second,
since a stamp of zero means that there is none. Of a clock that goes back the earliest time does."""
STEPS = 0.1
"""Step of times that are 32-bit numbers, over their spacing, from which it is told."""
NO_STEP = 0.01
"""Most by which they miss such numbers, of that step: a file has six digits behind the point. Other
times miss them by up to half a step."""


def measured_of_files(files: Sequence[str | Path], choices: dict[str, Choice],
                      scales: Scales | None = None, part: Part | None = None) -> Measured:
    """Return what files measured: parts of one recording, each going on where the last one ends.

    Files that hold different columns are tables beside each other, with the time of each in the
    column of that name: a logger may write a file for each of its signals.

    Args:
        files: CSV, .npz or .mat, see `log_table`.
        choices: `chosen_columns`.
        scales: where units need them.
        part: which samples are meant.

    Raises:
        InputError: what `read_columns` refuses; a scale that is missing, or that no unit needs; no
            time or rate, or both; files that overlap in time; columns that are in two tables; a
            sample rate that no unit of time can mean; too few rows.
    """
    scales, part = scales or Scales(), part or Part()
    if ('time' in choices) == (part.rate is not None):
        raise InputError('give the column of the time in --columns, or --rate in Hz where there '
                         'is none, not both' if part.rate else 'no time: give its column in '
                         '--columns, such as time=1:s, or --rate in Hz')
    refuse_unused(scales, choices)
    motion = motion_choice(choices)
    factors = {quantity: si_factors(choice, scales, len(motion.columns))
               for quantity, choice in choices.items()}
    dates = {name: choice.unit for choice in choices.values() if choice.unit in DATES
             for name in choice.columns}
    tables = read_tables(files, choices, factors, part, dates)
    table = tables[0] if len(tables) == 1 else beside(tables)
    time, values, rows = table.time, table.values, sum(len(one.time) for one in tables)
    kept = np.isfinite(time) & (time >= part.start) & (time <= part.end)
    untimed = sum(int(np.count_nonzero(~np.isfinite(one.time))) for one in tables)
    for one in tables:
        one.refuse_few(part)
    refuse_few(files, time, int(np.count_nonzero(kept)))
    time = time[kept]
    _refuse_rate(files, time)
    kind = motion.meaning.kind
    if part.unwrap or part.wraps_after is not None:
        periods = _wrapping(part, motion, factors[motion.quantity])
        for q, period in zip(values['position'].T, periods):
            known = are_readings(q)
            q[known] = np.unwrap(q[known], period=period)
    start = max(time[0] if time[0] > EPOCH else 1.0, 1.0 + time[0] - time.min())
    stamp = round(start * SECOND) + np.rint((time - time[0]) * SECOND).astype(np.int64)
    if kind is None:
        raise InputError(f'--columns: the unit of {motion.quantity} tells neither an angle nor a '
                         f'length')
    values = {name: column[kept] for name, column in values.items()}
    integrated = motion.quantity != 'position'
    if integrated:
        q = _integral(values['velocity'], time)
        for mask in clips_of(values).values():
            q[mask] = np.nan
        values = {'position': q, **values}
    measured = Measured(
        kind, stamp, values, rows, untimed, integrated, () if len(tables) == 1 else
        tuple((', '.join(one.values), one.kept(part)) for one in tables),
        _step_of(time, float(factors['time'][0])) if 'time' in choices and not dates else 0.0)
    repeated = int(np.count_nonzero(np.diff(stamp) == 0))
    if measured.time_step and repeated > MOST_CONFLICTS * len(stamp):
        raise InputError(f'{files[0]}: {repeated} of {len(stamp)} rows have the time of another: '
                         f'{measured.coarse_times}')
    return measured


def _wrapping(part: Part, motion: Choice, factors: np.ndarray) -> np.ndarray:
    """Return what the position of each joint jumps by where it starts again, (J,), rad or m.

    Args:
        part: which asks for it.
        motion: what tells the motion.
        factors: SI units in its unit, of each joint.

    Raises:
        InputError: no such position, or both ways of asking.
    """
    if part.wraps_after is None:
        option, fitting = '--unwrap', motion.meaning.kind != 'linear'
    elif part.unwrap:
        raise InputError('--unwrap and --wraps-after are given; --unwrap is for jumps by a turn of '
                         'the joint, --wraps-after for others: give one of them')
    else:
        option, fitting = '--wraps-after', True
    if motion.quantity == 'velocity':
        raise InputError(f'{option} is for positions; these are the integral of the velocity')
    if not fitting:
        raise InputError(f'{option} is for joints that turn; these positions are lengths, for '
                         f'which --wraps-after says what they jump by')
    return (np.full(len(factors), TURN) if part.wraps_after is None
            else part.wraps_after * np.abs(factors))


def _integral(velocity: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Return the way (n, 1) that velocities (n, 1) make in times (n,), NaN where there is none."""
    way, known = np.full_like(velocity, np.nan), are_readings(velocity[:, 0])
    v, t = velocity[known, 0], time[known]
    steps = ways_of(v, np.maximum(np.diff(t), 0.0))
    way[known, 0] = np.cumsum(np.concatenate((np.zeros(min(len(v), 1)), steps)))
    return way


def _step_of(time: np.ndarray, unit: float) -> float:
    """Return the step of times (n,), s, that are 32-bit numbers of a unit, s; 0 if it is none.

    It is none beside spacings of ten steps and more either.
    """
    numbers = time / unit
    step = float(np.spacing(np.float32(np.abs(numbers).max())))
    off = np.abs(numbers - numbers.astype(np.float32)).max()
    apart = float(np.ptp(time)) / (len(time) - 1)
    return unit * step if off < NO_STEP * step and unit * step > STEPS * apart else 0.0


def _refuse_rate(files: Sequence[str | Path], time: np.ndarray) -> None:
    if max(np.abs(time).max(), 1.0 + np.ptp(time)) > LATEST:
        raise InputError(f'{files[0]}: the time goes from {time.min():.6g} to {time.max():.6g} s, '
                         f'beyond what a stamp holds; check column and unit of the time')
    period = float(np.median(np.diff(time)))
    if not 1.0 / HIGHEST_RATE_HZ <= period <= 1.0 / LOWEST_RATE_HZ:
        raise InputError(f'{files[0]}: the median spacing of the samples is {period:.4g} s; check '
                         f'column and unit of the time')
