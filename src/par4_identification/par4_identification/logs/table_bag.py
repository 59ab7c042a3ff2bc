"""A bag in the contract's format from the columns of a logger's files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from par4_identification.logs.clips import clips_of
from par4_identification.logs.column_choice import (
    Choice,
    Scales,
    motion_of,
    refuse_unused,
    si_factors,
)
from par4_identification.logs.dates import DATES, DAY, day_after_day
from par4_identification.logs.integrated import ways_of
from par4_identification.logs.log_table import held_columns, read_columns
from par4_identification.logs.measured import Measured, are_readings
from par4_identification.logs.series import FEWEST_SAMPLES, MOST_CONFLICTS
from par4_identification.logs.units import HIGHEST_RATE_HZ, LOWEST_RATE_HZ, TURN
from par4_kinematics.errors import InputError
from par4_kinematics.files import written_atomically
from par4_kinematics.interface import AMPLIFIER_VOLTAGE, JOINT_STATES
from par4_kinematics.stamps import SECOND
from par4_sim.bags.bag_writer import BagWriter

OVERLAP = 0.5
"""Share of the shorter of two tables that the other one must go along with."""
LONGER = 0.02
"""The same of the longer of two: times in other units go along with a thousandth of it."""
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


@dataclass(frozen=True)
class Part:
    """Which samples of the files are meant.

    Attributes:
        array: table of an archive, or None.
        rate: of the samples, Hz, where no column is time; else None.
        start, end: s of the time that the files tell; samples outside are left out.
        unwrap: whether positions that jump by whole turns are to go on.
        wraps_after: what positions jump by that are to go on, in their unit.
    """

    array: str | None = None
    rate: float | None = None
    start: float = -np.inf
    end: float = np.inf
    unwrap: bool = False
    wraps_after: float | None = None


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
    motion = motion_of(choices)
    factors = {quantity: si_factors(choice, scales, len(motion.columns))
               for quantity, choice in choices.items()}
    dates = {name: choice.unit for choice in choices.values() if choice.unit in DATES
             for name in choice.columns}
    tables = [_Table.of(own, {name: choices[name] for name in quantities}, factors, part, dates)
              for quantities, own in _tables(files, choices).items()]
    if 'clock' in dates.values():
        tables = [tables[0], *(table.nearest_to(tables[0]) for table in tables[1:])]
    table = tables[0] if len(tables) == 1 else _beside(tables)
    time, values, rows = table.time, table.values, sum(len(one.time) for one in tables)
    kept = np.isfinite(time) & (time >= part.start) & (time <= part.end)
    untimed = sum(int(np.count_nonzero(~np.isfinite(one.time))) for one in tables)
    for one in tables:
        one.refuse_few(part)
    _refuse_few(files, time, int(np.count_nonzero(kept)))
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


@dataclass(frozen=True)
class _Table:
    """Rows of files with the same columns.

    Attributes:
        files: in order.
        time: (n,), s.
        values: quantity -> (n, J), SI units.
    """

    files: tuple[str | Path, ...]
    time: np.ndarray
    values: dict[str, np.ndarray]

    @classmethod
    def of(cls, files: Sequence[str | Path], choices: dict[str, Choice],
           factors: dict[str, np.ndarray], part: Part, dates: dict[str, str]) -> _Table:
        """Read files, each of which goes on where the last one ends."""
        blocks: dict[str, list[np.ndarray]] = {quantity: [] for quantity in choices}
        lengths = []
        names = tuple(dict.fromkeys(name for choice in choices.values() for name in choice.columns))
        own = {name: unit for name, unit in dates.items() if name in names}
        for file in files:
            columns = read_columns(file, names, part.array, own)
            for quantity, choice in choices.items():
                with np.errstate(over='ignore'):  # what becomes infinite holds no number
                    blocks[quantity].append(
                        np.stack([columns[name] for name in choice.columns], axis=1)
                        * factors[quantity])
            lengths.append(len(columns[names[0]]))
            if not lengths[-1]:
                raise InputError(f'{file}: its columns are empty; leave it out')
        values = {quantity: np.concatenate(parts) for quantity, parts in blocks.items()}
        time = (values.pop('time')[:, 0] if part.rate is None
                else np.arange(sum(lengths)) / part.rate)
        if 'clock' in dates.values():
            time = day_after_day(time)
        _refuse_overlap(files, time, lengths)
        return cls(tuple(files), time, values)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s; a table without a time has none."""
        known = self.time[np.isfinite(self.time)]
        return (float(known.min()), float(known.max())) if len(known) else (np.nan, np.nan)

    def nearest_to(self, other: _Table) -> _Table:
        """Return the table with whole days added, so that its times of day are beside others'."""
        return replace(self, time=self.time + DAY * np.round(
            (np.mean(other.span) - np.mean(self.span)) / DAY))

    def kept(self, part: Part) -> np.ndarray:
        """Return the times (n,), s, of the rows of a part."""
        known = self.time[np.isfinite(self.time)]
        return known[(known >= part.start) & (known <= part.end)]

    def refuse_few(self, part: Part) -> None:
        """Refuse a table that has hardly a row in a part.

        Raises:
            InputError: says how many there are, and when.
        """
        _refuse_few(self.files, self.time, len(self.kept(part)))


def _refuse_few(files: Sequence[str | Path], time: np.ndarray, left: int) -> None:
    """Refuse files of which fewer rows are left than any tool can use, of all their times (n,), s.

    Raises:
        InputError: says how many there are, and when.
    """
    if left >= FEWEST_SAMPLES:
        return
    spans = f', the time goes from {np.nanmin(time):.6g} to {np.nanmax(time):.6g} s' if (
        np.isfinite(time).any()) else ''
    raise InputError(f'{", ".join(map(str, files))}: {left} of {len(time)} rows are left, at least '
                     f'{FEWEST_SAMPLES} are needed{spans}; give a longer log, or more of it by '
                     f'--between')


def _tables(files: Sequence[str | Path], choices: dict[str, Choice]
            ) -> dict[tuple[str, ...], list[str | Path]]:
    """Return which files hold which quantities: all of them, or each table its own and the time.

    Raises:
        InputError: a quantity is in files of two tables.
    """
    names = tuple(name for choice in choices.values() for name in choice.columns)
    everything = tuple(choices)
    found: dict[tuple[str, ...], list[str | Path]] = {}
    parted, anywhere = None, set()
    for file in files:
        held = set(held_columns(file, names)) if len(files) > 1 else set(names)
        asked = [name for name in names if 'time' not in choices
                 or name not in choices['time'].columns]
        if len(files) > 1 and held.isdisjoint(asked):
            raise InputError(f'{file}: has none of the columns {", ".join(asked)}; leave it out, '
                             f'or mend --columns')
        anywhere |= held
        parted = parted or next((
            (file, name) for name, choice in choices.items()
            if held & set(choice.columns) and not held.issuperset(choice.columns)), None)
        own = tuple(name for name, choice in choices.items() if held.issuperset(choice.columns))
        found.setdefault(own, []).append(file)
    of_tables = [name for own in found for name in own if name != 'time']
    if len(found) == 1 or not all('time' in own and len(own) > 1 for own in found) or (
            set(of_tables) != set(choices) - {'time'}):
        if parted is not None and anywhere.issuperset(choices[parted[1]].columns):
            file, name = parted
            columns = ', '.join(choices[name].columns)
            raise InputError(f'{file}: has some columns of {name} ({columns}) only; put those of '
                             f'all joints into one file')
        return {everything: list(files)}  # of which reading says what is missing
    for name in of_tables:
        if of_tables.count(name) > 1:
            first, other = (own[0] for quantities, own in found.items() if name in quantities)
            raise InputError(f'{first} and {other} both have {name} ({choices[name].columns[0]}), '
                             f'but not the same columns; give the file whose {name} is meant, and '
                             f'files with the other columns')
    return found


def _beside(tables: Sequence[_Table]) -> _Table:
    """Return the rows of all tables in the order of their times; rows of one time are one.

    Raises:
        InputError: a time that goes back.
    """
    for table in tables:
        known = table.time[np.isfinite(table.time)]
        if len(known) < FEWEST_SAMPLES:
            raise InputError(f'{table.files[0]}: {len(known)} rows with a time, at least '
                             f'{FEWEST_SAMPLES} are needed')
        if np.any(np.diff(known) < 0.0):
            raise InputError(f'{table.files[0]}: its time goes back, so that the rows of other '
                             f'files cannot be put between its own; mend the time')
    for table in tables[1:]:
        (first, last), (start, end) = tables[0].span, table.span
        both = min(last, end) - max(first, start)
        if both < max(OVERLAP * min(last - first, end - start),
                      LONGER * max(last - first, end - start)):
            raise InputError(f'{table.files[0]}: goes from {start:.6g} to {end:.6g} s, '
                             f'{tables[0].files[0]} from {first:.6g} to {last:.6g} s; files beside '
                             f'each other tell times of one clock in one unit')
    known = [np.isfinite(table.time) for table in tables]
    # of rows of one time in a table the first goes beside the first of another, and so on
    every = np.concatenate([np.stack((time, _repeats(time)), axis=1) for time in (
        table.time[own] for table, own in zip(tables, known))])
    keys, places = np.unique(every, axis=0, return_inverse=True)
    time, places = keys[:, 0], np.ravel(places)
    values: dict[str, np.ndarray] = {}
    ends = np.cumsum([own.sum() for own in known])
    for table, own, place in zip(tables, known, np.split(places, ends[:-1])):
        for name, column in table.values.items():
            values[name] = np.full((len(time), column.shape[1]), np.nan)
            values[name][place] = column[own]
    return _Table(tuple(file for table in tables for file in table.files), time, values)


def _repeats(time: np.ndarray) -> np.ndarray:
    """Return how many times each of ascending times (n,) came before, (n,)."""
    first = np.maximum.accumulate(np.where(np.diff(time, prepend=-np.inf) > 0.0,
                                           np.arange(len(time)), 0))
    return np.arange(len(time)) - first


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


def _refuse_overlap(files: Sequence[str | Path], time: np.ndarray, lengths: Sequence[int]) -> None:
    previous, end = files[0], -np.inf
    for file, rows in zip(files, np.split(time, np.cumsum(lengths)[:-1])):
        known = rows[np.isfinite(rows)]
        if not len(known):
            continue
        if not known[0] > end:
            raise InputError(f'{file}: begins at {known[0]:.6g} s, before {previous} ends at '
                             f'{end:.6g} s; several files are parts of one recording in order; '
                             f'make a bag of each recording')
        previous, end = file, known[-1]


def _refuse_rate(files: Sequence[str | Path], time: np.ndarray) -> None:
    if max(np.abs(time).max(), 1.0 + np.ptp(time)) > LATEST:
        raise InputError(f'{files[0]}: the time goes from {time.min():.6g} to {time.max():.6g} s, '
                         f'beyond what a stamp holds; check column and unit of the time')
    period = float(np.median(np.diff(time)))
    if not 1.0 / HIGHEST_RATE_HZ <= period <= 1.0 / LOWEST_RATE_HZ:
        raise InputError(f'{files[0]}: the median spacing of the samples is {period:.4g} s; check '
                         f'column and unit of the time')


def write_measured(measured: Measured, joints: Sequence[str], path: str | Path,
                   storage: str = 'mcap', progress: Callable[[float], None] | None = None) -> None:
    """Write the bag.

    Position, speed and torque go to `joint_states`, voltage to `amplifier_voltage`.

    Args:
        measured: what is written.
        joints: names of its joints.
        path: of the bag, which must not exist; it appears only when complete.
        storage: 'mcap' or 'sqlite3'.
        progress: called with the share done, 0 to 1.

    Raises:
        InputError: the path exists or cannot be written.
    """
    if Path(path).exists():
        raise InputError(f'{path}: exists already; give another path or remove it')
    count, values = len(measured.stamp), measured.values
    nothing = np.empty((count, 0))
    position, velocity, torque = (
        values.get(name, nothing) for name in ('position', 'velocity', 'torque'))
    received = np.maximum.accumulate(measured.stamp)  # a clock that goes back was still running
    with (written_atomically(path, new=True) as scratch,
          BagWriter(scratch, storage, path) as bag):
        for row, (stamp, when) in enumerate(zip(measured.stamp.tolist(), received.tolist())):
            bag.write_joint_state(f'/{JOINT_STATES.name}', stamp, joints,
                                  position[row], velocity[row], torque[row], received=when)
            if 'voltage' in values:
                bag.write_joint_state(f'/{AMPLIFIER_VOLTAGE.name}', stamp, joints,
                                      effort=values['voltage'][row], received=when)
            if progress and row % 1000 == 0:
                progress(row / count)
