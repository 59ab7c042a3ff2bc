"""A bag in the contract's format from the columns of a logger's files.

What a column means is said by whoever has the file, as `QUANTITY=COLUMN:UNIT`; nothing is guessed.
What can be checked without knowing the machine is checked: stamps, gaps, jumps, ranges, and whether
the speed is the slope of the position, which tells a wrong unit of either.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import combinations
from pathlib import Path

import numpy as np

from par4_identification.logs.log_table import read_columns
from par4_identification.logs.series import FEWEST_SAMPLES
from par4_identification.logs.stamps import GAP
from par4_identification.logs.units import FASTEST, SLOWEST, UNITS, Kind, Unit, si_unit, unit_named
from par4_kinematics.errors import InputError
from par4_kinematics.files import written_atomically
from par4_kinematics.interface import AMPLIFIER_VOLTAGE, JOINT_STATES
from par4_sim.bag_writer import BagWriter

EXAMPLE = 'time=1:ms position=angle:deg torque=current:A'
SECOND = 1_000_000_000
LATEST = 2.0 ** 31
"""Seconds that a stamp of ROS holds."""
EPOCH = 1e8
"""s from which on a time counts from 1970 and is kept; others begin with the stamp of one second,
since a stamp of zero means that there is none."""
JUMP = 0.4
"""Turns between two samples above which a position has wrapped around or slipped."""
FACTOR = 2.0
"""By which a recorded speed may differ from the slope of the position: loggers filter and quantise
speeds, a wrong unit makes a factor of six at least."""
MOST_COLUMNS = 1000
"""In a span of columns."""
LONGEST_NUMBER = 9
"""Digits of the number of a column."""
LARGEST = 1e12
"""SI units; what is beyond is no reading of a machine, and its square may be infinite."""
PLAIN_TURNS = 1e3
"""Turns beyond which whole numbers are counts rather than angles."""


@dataclass(frozen=True)
class Choice:
    """Which columns are a quantity.

    Attributes:
        quantity: time, position, velocity, torque or voltage.
        columns: names or numbers, one a joint; one for time.
        unit: its name.
    """

    quantity: str
    columns: tuple[str, ...]
    unit: str

    @property
    def meaning(self) -> Unit:
        """What the unit is."""
        return unit_named(self.quantity, self.unit)


@dataclass(frozen=True)
class Scales:
    """Numbers of the machine that some units need, one for all joints or one a joint.

    Attributes:
        counts_per_turn: of the joint, behind its gear.
        motor_gain: torque at the joint per ampere, N m/A or N/A, (24) with a current for a voltage.
    """

    counts_per_turn: tuple[float, ...] = ()
    motor_gain: tuple[float, ...] = ()


@dataclass(frozen=True)
class Part:
    """Which samples of the files are meant.

    Attributes:
        array: table of an archive, or None.
        rate: of the samples, Hz, where no column is time; else None.
        start, end: s of the time that the files tell; samples outside are left out.
        unwrap: whether positions that jump by whole turns are to go on.
    """

    array: str | None = None
    rate: float | None = None
    start: float = -np.inf
    end: float = np.inf
    unwrap: bool = False


@dataclass(frozen=True)
class Measured:
    """What files measured, in SI units, ready to be written.

    Attributes:
        kind: of the joints.
        stamp: (n,) ns.
        values: quantity -> (n, J).
        rows: that the files have.
        untimed: of them without a time, left out.
    """

    kind: Kind
    stamp: np.ndarray
    values: dict[str, np.ndarray]
    rows: int
    untimed: int

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return self.values['position'].shape[1]

    @property
    def period(self) -> float:
        """Median spacing of the stamps, s."""
        return 1e-9 * float(np.median(np.diff(self.stamp)))

    def account(self) -> tuple[str, ...]:
        """Return what was read, a line each: rate, then range of every quantity."""
        spacing = 1e-9 * np.diff(self.stamp)
        missing = spacing > GAP * self.period
        jitter = np.sqrt(np.mean((spacing[(spacing > 0.0) & ~missing] - self.period) ** 2))
        lines = [f'{len(self.stamp)} of {self.rows} rows, '
                 f'{1e-9 * (self.stamp[-1] - self.stamp[0]):.6g} s at {1.0 / self.period:.5g} Hz '
                 f'(every {1e3 * self.period:.4g} ms +- {1e3 * jitter:.2g} ms rms), '
                 f'{np.count_nonzero(missing)} gaps'
                 + (f', the longest {spacing.max():.4g} s' if missing.any() else '')]
        for quantity, values in self.values.items():
            unit = si_unit(quantity, self.kind)
            ranges = ', '.join(
                f'{low:.4g} to {high:.4g}' if np.isfinite(low) else 'no numbers'
                for low, high in zip(*_ranges(values)))
            lines.append(f'{quantity}: {ranges} {unit}')
        return tuple(lines)

    def findings(self) -> tuple[str, ...]:
        """Return what looks wrong, in words; nothing for good files."""
        found = [f'{count} {words}' for count, words in (
            (self.untimed, 'rows without a time, left out'),
            (np.count_nonzero(np.diff(self.stamp) == 0), 'stamps repeated'),
            (np.count_nonzero(np.diff(self.stamp) < 0), 'times the clock goes back')) if count]
        for quantity, values in self.values.items():
            empty = np.count_nonzero(~np.isfinite(values))
            if empty:
                found.append(f'{quantity}: {empty} of {values.size} cells hold no number')
            absurd = np.count_nonzero(np.isfinite(values) & ~_are_readings(values))
            if absurd:
                found.append(f'{quantity}: {absurd} of {values.size} cells are beyond {LARGEST:g} '
                             f'{si_unit(quantity, self.kind)}; mend the file there')
            for joint, (low, high) in enumerate(zip(*_ranges(values))):
                if not low < high:
                    what = 'the same in all rows' if low == high else 'no numbers'
                    found.append(f'{quantity} of joint {joint}: {what}; is it the right column?')
        return (*found, *self._twins(), *self._odd_positions(), *self._odd_speeds())

    def _twins(self) -> list[str]:
        """Return which columns hold the numbers of another one that does not stand still."""
        found = []
        columns = [(f'{quantity} of joint {joint}', column)
                   for quantity, values in self.values.items()
                   for joint, column in enumerate(values.T)]
        for index, (name, column) in enumerate(columns):
            twin = next((other for other, earlier in columns[:index]
                         if np.array_equal(column, earlier, equal_nan=True)), None)
            if twin is not None and len(np.unique(column[np.isfinite(column)])) > 1:
                found.append(f'{name}: the same numbers as {twin}; is it the right column?')
        return found

    def _odd_positions(self) -> list[str]:
        if self.kind == 'linear':
            return []
        found = []
        for joint, column in enumerate(self.values['position'].T):
            rows = np.flatnonzero(_are_readings(column))
            if len(rows) < 2:
                continue  # said elsewhere
            q, apart = column[rows], np.diff(rows)
            jumps = np.abs(np.diff(q)) / (2.0 * np.pi)
            jumped = rows[1:][(jumps > max(JUMP, 20.0 * np.median(jumps)))
                              & (apart <= GAP * np.median(apart))]
            if len(jumped):
                turns = jumps[np.searchsorted(rows, jumped[0]) - 1]
                found.append(f'position of joint {joint}: jumps by {turns:.3g} turns at '
                             f'row {jumped[0] + 1} and {len(jumped) - 1} times more; where the '
                             f'encoder wraps around, give --unwrap')
            elif np.abs(q).max() > 2.0 * np.pi * PLAIN_TURNS and np.array_equal(q, np.rint(q)):
                found.append(f'position of joint {joint}: whole numbers up to '
                             f'{np.abs(q).max():.4g} rad; are they counts?')
        return found

    def _odd_speeds(self) -> list[str]:
        """Return where the integral of the speed is not the position but a multiple of it.

        What happens in gaps of the log belongs to neither.
        """
        if 'velocity' not in self.values:
            return []
        found = []
        for joint, columns in enumerate(zip(self.values['position'].T, self.values['velocity'].T)):
            known = np.logical_and(*map(_are_readings, columns))
            if np.count_nonzero(known) < 2:
                continue  # said elsewhere
            q, qd = (column[known] for column in columns)
            spacing = 1e-9 * np.diff(self.stamp[known])
            whole = (spacing > 0.0) & (spacing <= GAP * np.median(spacing))
            q, way = (np.cumsum(np.where(whole, steps, 0.0)) for steps in (
                np.diff(q), 0.5 * (qd[1:] + qd[:-1]) * spacing))
            if np.ptp(q) == 0.0 or np.ptp(way) == 0.0:
                continue  # said elsewhere
            q, way = q - q.mean(), way - way.mean()
            ratio = float(q @ way / (q @ q))
            alike = float(q @ way / np.sqrt((q @ q) * (way @ way)))
            if abs(alike) > 0.9 and not 1.0 / FACTOR < ratio < FACTOR:
                found.append(f'velocity of joint {joint}: {ratio:.4g} times the slope of the '
                             f'position; check the unit of either')
            elif abs(alike) <= 0.9:
                found.append(f'velocity of joint {joint}: not the slope of the position (their '
                             f'correlation is {alike:.2f}); check the columns')
        return found


def chosen_columns(text: str) -> dict[str, Choice]:
    """Return what `QUANTITY=COLUMN[,COLUMN...]:UNIT ...` says, by quantity.

    A column is a name or a number counted from 1, `2-5` the numbers 2 to 5; names with spaces are
    quoted.

    Raises:
        InputError: another form, an unknown quantity or unit, no position, neither torque nor
            voltage, numbers of columns that differ, or a column that is two quantities.
    """
    try:
        words = shlex.split(text)
    except ValueError as error:
        raise InputError(f'--columns {text!r}: {error}; close the quotes') from None
    choices: dict[str, Choice] = {}
    for word in words:
        quantity, equals, rest = word.partition('=')
        columns, colon, unit = rest.rpartition(':')
        if not equals or not colon or not columns or not unit:
            raise InputError(f'--columns: {word!r} is not QUANTITY=COLUMN:UNIT; write for example '
                             f"'{EXAMPLE}'")
        unit_named(quantity, unit)
        if quantity in choices:
            raise InputError(f'--columns: {quantity} is given twice; part the columns of several '
                             f'joints by commas')
        choices[quantity] = Choice(quantity, _expanded(columns), unit)
    if 'position' not in choices or not {'torque', 'voltage'} & set(choices):
        raise InputError(f"--columns: found {', '.join(choices) or 'nothing'}; needed are position "
                         f"and torque or voltage, for example '{EXAMPLE}'")
    joints = len(choices['position'].columns)
    for quantity, choice in choices.items():
        wanted = 1 if quantity == 'time' else joints
        if len(choice.columns) != wanted:
            raise InputError(f'--columns: {quantity} has {len(choice.columns)} columns, expected '
                             f'{wanted}' + ('' if quantity == 'time' else ', as position has'))
    for one, other in combinations(choices.values(), 2):
        common = [name for name in one.columns if name in other.columns]
        if common:
            raise InputError(f'--columns: {common[0]} is {one.quantity} and {other.quantity}; a '
                             f'column is one of them, give the other its own')
    kinds = {choice.meaning.kind for choice in choices.values()} - {None}
    if len(kinds) > 1:
        units = ', '.join(f'{choice.quantity} in {choice.unit}' for choice in choices.values()
                          if choice.meaning.kind)
        raise InputError(f'--columns: {units}; a joint turns or slides, not both')
    return choices


def _expanded(columns: str) -> tuple[str, ...]:
    names: list[str] = []
    for part in columns.split(','):
        span = re.fullmatch(r'(\d+)-(\d+)', part.strip())
        if span is None:
            names.append(part.strip())
            continue
        first, last = (int(number[-LONGEST_NUMBER:]) for number in span.groups())
        if not 0 <= last - first < MOST_COLUMNS or max(map(len, span.groups())) > LONGEST_NUMBER:
            raise InputError(f'--columns: {part.strip()!r} is no span of 1 to {MOST_COLUMNS} '
                             f'columns; write it as FIRST-LAST')
        names += [str(number) for number in range(first, last + 1)]
    return tuple(names)


def measured_of_files(files: Sequence[str | Path], choices: dict[str, Choice],
                      scales: Scales | None = None, part: Part | None = None) -> Measured:
    """Return what files measured: parts of one recording, each going on where the last one ends.

    Args:
        files: CSV, .npz or .mat, see `log_table`.
        choices: `chosen_columns`.
        scales: where units need them.
        part: which samples are meant.

    Raises:
        InputError: what `read_columns` refuses; a scale that is missing, or that no unit needs; no
            time or rate, or both; files that overlap in time; a sample rate that no unit of time
            can mean; too few rows.
    """
    scales, part = scales or Scales(), part or Part()
    if ('time' in choices) == (part.rate is not None):
        raise InputError('give the column of the time in --columns, or --rate in Hz where there '
                         'is none, not both' if part.rate else 'no time: give its column in '
                         '--columns, such as time=1:s, or --rate in Hz')
    _refuse_unused(scales, choices)
    factors = {quantity: _factors(choice, scales, len(choices['position'].columns))
               for quantity, choice in choices.items()}
    blocks: dict[str, list[np.ndarray]] = {quantity: [] for quantity in choices}
    lengths = []
    for file in files:
        columns = read_columns(file, tuple(dict.fromkeys(
            name for choice in choices.values() for name in choice.columns)), part.array)
        for quantity, choice in choices.items():
            with np.errstate(over='ignore'):  # what becomes infinite holds no number
                blocks[quantity].append(
                    np.stack([columns[name] for name in choice.columns], axis=1)
                    * factors[quantity])
        lengths.append(len(blocks['position'][-1]))
    values = {quantity: np.concatenate(parts) for quantity, parts in blocks.items()}
    rows = sum(lengths)
    time = (values.pop('time')[:, 0] if part.rate is None
            else np.arange(rows) / part.rate)
    _refuse_overlap(files, time, lengths)
    kept = np.isfinite(time) & (time >= part.start) & (time <= part.end)
    untimed = int(np.count_nonzero(~np.isfinite(time)))
    if np.count_nonzero(kept) < FEWEST_SAMPLES:
        spans = f', the time goes from {np.nanmin(time):.6g} to {np.nanmax(time):.6g} s' if (
            untimed < rows) else ''
        raise InputError(f'{", ".join(map(str, files))}: {np.count_nonzero(kept)} of {rows} rows '
                         f'are left, at least {FEWEST_SAMPLES} are needed{spans}')
    time = time[kept]
    _refuse_rate(files, time)
    kind = choices['position'].meaning.kind
    if part.unwrap:
        if kind == 'linear':
            raise InputError('--unwrap is for joints that turn; these positions are lengths')
        for q in values['position'].T:
            known = _are_readings(q)
            q[known] = np.unwrap(q[known])
    start = time[0] if time[0] > EPOCH else 1.0
    stamp = round(start * SECOND) + np.rint((time - time[0]) * SECOND).astype(np.int64)
    if kind is None:
        raise InputError('--columns: the unit of position tells neither an angle nor a length')
    return Measured(kind, stamp, {name: column[kept] for name, column in values.items()}, rows,
                    untimed)


def _refuse_unused(scales: Scales, choices: dict[str, Choice]) -> None:
    needed = {choice.meaning.scale for choice in choices.values()}
    for field in fields(scales):
        if getattr(scales, field.name) and field.name not in needed:
            units = ' or '.join(name for known in UNITS.values() for name, unit in known.items()
                                if unit.scale == field.name)
            found = ', '.join(f'{choice.quantity} in {choice.unit}' for choice in choices.values())
            raise InputError(f'--{field.name.replace("_", "-")} is for {units}, found {found}; '
                             f'mend --columns or leave it out')


def _factors(choice: Choice, scales: Scales, joints: int) -> np.ndarray:
    """Return SI units per unit of each joint, (J,)."""
    unit = choice.meaning
    if unit.scale is None:
        return np.full(1 if choice.quantity == 'time' else joints, unit.factor)
    given = getattr(scales, unit.scale)
    option = '--' + unit.scale.replace('_', '-')
    if len(given) not in (1, joints):
        raise InputError(f'{choice.quantity} in {choice.unit}: {option} has {len(given)} numbers, '
                         f'give one' + (f' or {joints}' if joints > 1 else ''))
    scale = np.broadcast_to(np.array(given), (joints,))
    return unit.factor * scale if unit.scale == 'motor_gain' else unit.factor / scale


def _refuse_overlap(files: Sequence[str | Path], time: np.ndarray, lengths: Sequence[int]) -> None:
    ends = np.cumsum(lengths)
    for index, row in enumerate(ends[:-1]):
        if not time[row] > time[row - 1]:
            raise InputError(f'{files[index + 1]}: begins at {time[row]:.6g} s, before '
                             f'{files[index]} ends at {time[row - 1]:.6g} s; several files are '
                             f'parts of one recording in order, make a bag of each other one')


def _refuse_rate(files: Sequence[str | Path], time: np.ndarray) -> None:
    if np.abs(time).max() > LATEST:
        raise InputError(f'{files[0]}: the time goes from {time.min():.6g} to {time.max():.6g} s, '
                         f'beyond what a stamp holds; check column and unit of the time')
    period = float(np.median(np.diff(time)))
    if not 1.0 / FASTEST <= period <= 1.0 / SLOWEST:
        raise InputError(f'{files[0]}: the median spacing of the samples is {period:.4g} s; check '
                         f'column and unit of the time')


def write_measured(measured: Measured, joints: Sequence[str], path: str | Path,
                   storage: str = 'mcap', progress: Callable[[float], None] | None = None
                   ) -> dict[str, int]:
    """Write the bag and return the number of messages on each topic.

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
    with written_atomically(path) as scratch, BagWriter(scratch, storage, path) as bag:
        for row, (stamp, when) in enumerate(zip(measured.stamp.tolist(), received.tolist())):
            bag.write_joint_state(f'/{JOINT_STATES.name}', stamp, joints,
                                  position[row], velocity[row], torque[row], received=when)
            if 'voltage' in values:
                bag.write_joint_state(f'/{AMPLIFIER_VOLTAGE.name}', stamp, joints,
                                      effort=values['voltage'][row], received=when)
            if progress and row % 1000 == 0:
                progress(row / count)
    return {JOINT_STATES.name: count,
            **({AMPLIFIER_VOLTAGE.name: count} if 'voltage' in values else {})}


def _are_readings(values: np.ndarray) -> np.ndarray:
    """Return which values a machine can have."""
    return np.abs(values) <= LARGEST


def _ranges(values: np.ndarray) -> tuple[list[float], list[float]]:
    """Return least and largest finite value of each column, NaN without one."""
    finite = np.where(np.isfinite(values), values, np.nan)
    low, high = [], []
    for column in finite.T:
        known = column[~np.isnan(column)]
        low.append(float(known.min()) if len(known) else np.nan)
        high.append(float(known.max()) if len(known) else np.nan)
    return low, high
