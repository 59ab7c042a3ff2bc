"""The tables that files hold: which files hold which columns, and their rows beside each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from par4_identification.logs.column_choice import Choice
from par4_identification.logs.dates import DAY, day_after_day
from par4_identification.logs.log_table import held_columns, read_columns
from par4_identification.logs.topic_signal import FEWEST_SAMPLES
from par4_kinematics.errors import InputError

OVERLAP = 0.5
"""Share of the shorter of two tables that the other one must go along with."""
LONGER = 0.02
"""The same of the longer of two: times in other units go along with a thousandth of it."""


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


@dataclass(frozen=True)
class Table:
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
           factors: dict[str, np.ndarray], part: Part, dates: dict[str, str]) -> Table:
        """Read files, each of which goes on where the last one ends.

        Raises:
            InputError: what `read_columns` refuses; files that overlap in time, or empty columns.
        """
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

    def nearest_to(self, other: Table) -> Table:
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
        refuse_few(self.files, self.time, len(self.kept(part)))


def read_tables(files: Sequence[str | Path], choices: dict[str, Choice],
                factors: dict[str, np.ndarray], part: Part, dates: dict[str, str]) -> list[Table]:
    """Return the tables that files hold, with times of day beside those of the first.

    Args:
        files: in order.
        choices: `chosen_columns`.
        factors: SI units in the unit of each quantity, of each of its columns.
        part: which samples are meant.
        dates: unit of each column that holds dates.

    Raises:
        InputError: what `read_columns` refuses; files that overlap in time; columns that are in two
            tables, or of which no file has all joints.
    """
    tables = [Table.of(own, {name: choices[name] for name in quantities}, factors, part, dates)
              for quantities, own in _files_of_tables(files, choices).items()]
    if 'clock' in dates.values():
        tables = [tables[0], *(table.nearest_to(tables[0]) for table in tables[1:])]
    return tables


def refuse_few(files: Sequence[str | Path], time: np.ndarray, left: int) -> None:
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


def _files_of_tables(files: Sequence[str | Path], choices: dict[str, Choice]
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


def beside(tables: Sequence[Table]) -> Table:
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
    return Table(tuple(file for table in tables for file in table.files), time, values)


def _repeats(time: np.ndarray) -> np.ndarray:
    """Return how many times each of ascending times (n,) came before, (n,)."""
    first = np.maximum.accumulate(np.where(np.diff(time, prepend=-np.inf) > 0.0,
                                           np.arange(len(time)), 0))
    return np.arange(len(time)) - first


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
