"""Columns of numbers from the files that loggers write: CSV, numpy archives, MATLAB files."""

from __future__ import annotations

import multiprocessing
import re
import signal
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import scipy

from par4_identification.logs.csv_layout import (
    LONGEST_SHOWN,
    Layout,
    fields_of,
    is_comment,
    layout_of,
    row_of,
)
from par4_identification.logs.dates import DATES, EXAMPLES, unit_of_date
from par4_kinematics.errors import InputError
from par4_kinematics.held_signals import held_back
from par4_kinematics.paths import instead_of_file

MOST_NAMED = 12
"""Names that an error lists."""
WIDEST = 100
"""Columns that a table has at the most; where more stand in fewer rows, a row is a quantity."""


def read_columns(path: str | Path, wanted: Sequence[str], array: str | None = None,
                 dates: Mapping[str, str] | None = None) -> dict[str, np.ndarray]:
    """Return columns of a file by their names, or by their numbers counted from 1.

    A CSV may be parted by commas, semicolons, tabs or spaces, begin with comments, a header and a
    row of units, and have decimal commas; empty cells are NaN. What stands above the table, such as
    the settings of a logger, is passed over. Of a wide table without names, as arrays are saved
    that hold a quantity in a row, the rows are the columns.

    A column of a numpy archive (.npz) or a MATLAB file (.mat, up to version 7.2) is one of its
    arrays by name; of one with several numbers a sample `NAME[2]` is the second. Or it is a row or
    column of the array that `array` names. The longer side of an array is time.

    Args:
        path: of the file; what it is follows from the end of its name.
        wanted: names or numbers; a name goes first.
        array: of an archive that holds tables.
        dates: those of `wanted` that hold dates or times of day -> their unit in `DATES`.

    Returns:
        Each wanted column, (n,); of one length.

    Raises:
        InputError: no such file, cannot be read, no such column, a cell that is no number, columns
            of different lengths.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f'{path}: {instead_of_file(path)}; give a CSV, .npz or .mat file')
    kind = path.suffix.lower()
    if kind in ('.npz', '.mat'):
        if dates:
            raise InputError(f'{path}: {", ".join(DATES)} are for CSV files; give the time as '
                             f'numbers')
        columns = _of_archive(path, _archive(path), wanted, array)
    elif array is not None:
        raise InputError(f'{path}: --array {array} is for .npz and .mat files; this one is read '
                         f'as a CSV')
    else:
        columns = _of_csv(path, wanted, dates or {})
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f'{path}: the columns differ in length: ' + ', '.join(
            f'{name} {length}' for name, length in lengths.items()) + '; give columns of one table')
    return columns


def held_columns(path: str | Path, wanted: Sequence[str]) -> tuple[str, ...]:
    """Return which of some columns a file has; numbers stand for any column.

    Raises:
        InputError: no such file, or it cannot be read.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f'{path}: {instead_of_file(path)}; give a CSV, .npz or .mat file')
    if path.suffix.lower() in ('.npz', '.mat'):
        names = set(_archive(path))
        return tuple(name for name in wanted if of_table(name)[0] in names or name in names
                     or name.isdecimal())
    headers = [layout_of(path, (name,)).headers for name in wanted]
    return tuple(name for name, rows in zip(wanted, headers)
                 if name.isdecimal() or any(name in row for row in rows))


def _place(path: Path, wanted: str, headers: Sequence[Sequence[str]], count: int,
           where: str = '') -> int:
    """Return the index of a column that is given by its name or number; upper rows go first.

    `where` says in errors what `path` was read from.
    """
    names = next((names for names in headers if wanted in names), ())
    found = [index for index, name in enumerate(names) if name == wanted != '']
    if len(found) > 1:
        raise InputError(f'{path}: {len(found)} columns are named {wanted!r}; give the number of '
                         f'one, {" or ".join(str(index + 1) for index in found)}')
    if found:
        return found[0]
    if wanted.isdecimal() and 1 <= int(wanted) <= count:
        return int(wanted) - 1
    most = max(headers, key=lambda names: len(set(names)), default=())
    raise InputError(f'{path}: no column {wanted!r}; there are {count}'
                     + (f': {_listed(most)}' if most else f' without names, counted from 1{where}'))


# --------------------------------------------------------------------------------------- archives


def _archive(path: Path) -> Mapping[str, np.ndarray]:
    try:
        if path.suffix.lower() == '.npz':
            with np.load(path, allow_pickle=False) as archive:
                return {name: archive[name] for name in archive.files}
        with ProcessPoolExecutor(1, multiprocessing.get_context('spawn')) as reader:
            with held_back(signal.SIGINT):  # Ctrl-C is for this process, which ends the other
                reading = reader.submit(_of_matlab, str(path))
            return reading.result()
    # A damaged MATLAB file can make scipy's compiled reader crash: it has a process of its own.
    except BrokenProcessPool:
        raise InputError(f'{path}: damaged, so that it cannot be read; save it again') from None
    except NotImplementedError:  # scipy.io.loadmat reads no HDF5
        raise InputError(f"{path}: a MATLAB 7.3 file, which is not read; in MATLAB load it and "
                         f"save it with save('{path.name}', '-v7')") from None
    # Of damaged files both libraries raise whatever their parsers meet.
    except Exception as error:
        raise InputError(f'{path}: cannot be read ({" ".join(str(error).split())}); give an '
                         f'archive of plain numbers') from error


def _of_matlab(path: str) -> dict[str, np.ndarray]:
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')  # of objects of MATLAB, which have no name in the file
        return {name: np.asarray(values) for name, values in scipy.io.loadmat(path).items()
                if not name.startswith('__')}


def _of_archive(path: Path, archive: Mapping[str, np.ndarray], wanted: Sequence[str],
                array: str | None) -> dict[str, np.ndarray]:
    numeric = {name: np.squeeze(values) for name, values in archive.items()
               if values.dtype.kind in 'biuf'}
    tables = [name for name, values in numeric.items() if values.ndim == 2]
    if array is None and not any(name in numeric for name in wanted) and len(tables) == 1:
        array = tables[0]
    if array is not None:
        if array not in tables:
            raise InputError(f'{path}: no table {array!r}; there are '
                             f'{_listed(tables) or "none"}')
        return {name: _column(path, numeric[array], name) for name in wanted}
    plain = [name for name, values in numeric.items() if values.ndim == 1]
    unread = ('; structs, cells and objects of MATLAB, such as a timeseries, are not read: save '
              'their numbers as arrays of their own'
              if any(values.dtype.kind in 'OV' for values in archive.values()) else '')
    columns = {}
    for name in wanted:
        table, number = of_table(name)
        if name in plain:
            columns[name] = numeric[name].astype(float)
        elif table in tables:
            columns[name] = _column(path, numeric[table], number)
        else:
            raise InputError(
                f'{path}: no array {name!r} with one number a sample; there are '
                f'{_listed(plain) or "none"}' + (f'; of those with several ({_listed(tables)}) '
                                                 f'give one, such as {tables[0]}[1]'
                                                 if tables else '') + unread)
    return columns


def of_table(column: str) -> tuple[str, str]:
    """Return the name of an array and the number of its column in `NAME[NUMBER]`, '' if none."""
    found = re.fullmatch(r'(.+)\[(\d+(?:-\d+)?)\]', column)
    return (found[1], found[2]) if found else ('', '')


def _column(path: Path, table: np.ndarray, number: str) -> np.ndarray:
    """Return a column (n,) of a table, counted from 1; the longer side of it is time."""
    rows = table if table.shape[0] < table.shape[1] else table.T
    return np.asarray(rows[_place(path, number, (), len(rows))].astype(float))


def _listed(names: Sequence[str]) -> str:
    return ', '.join(names[:MOST_NAMED]) + (', ...' if len(names) > MOST_NAMED else '')


# -------------------------------------------------------------------------------------------- CSV


def _of_csv(path: Path, wanted: Sequence[str], dates: Mapping[str, str]
            ) -> dict[str, np.ndarray]:
    layout = layout_of(path, wanted, dates)
    if not layout.headers and layout.columns > WIDEST and not dates:
        lying = _lying(path, layout)
        if lying is not None:
            return {name: lying[_place(path, name, (), len(lying), ', as they stand in rows')]
                    for name in wanted}
    where = (f', in the table that begins at line {layout.first + 1}; if it begins elsewhere, cut '
             f'off what stands above its names; else give their numbers, such as time=1:s')
    places = [_place(path, name, layout.headers, layout.columns, where) for name in wanted]
    cells = {name: partial(layout.date, unit=dates[name]) if name in dates else layout.number
             for name in wanted}
    try:
        with path.open(encoding=layout.encoding, newline='') as stream:
            rows = (row_of(line, layout.delimiter) for line in islice(stream, layout.first, None)
                    if line.strip() and not is_comment(line))
            values = np.loadtxt(rows, delimiter=layout.delimiter, ndmin=2, usecols=places,
                                converters=dict(zip(places, cells.values())), comments=None,
                                quotechar='"')
    except (ValueError, UnicodeDecodeError, OSError) as error:
        said = _fault(path, layout, dict(zip(wanted, places)), cells, dates) or ' '.join(
            str(error).split()).rstrip('.')
        raise InputError(f'{path}: {said}; mend the file') from error
    return dict(zip(wanted, values.T, strict=True))


def _lying(path: Path, layout: Layout) -> np.ndarray | None:
    """Return the rows of a table that has some, and fewer than columns; None of any other."""
    with path.open(encoding=layout.encoding, newline='') as stream:
        lines = [row_of(line, layout.delimiter)
                 for line in islice(stream, layout.first, layout.first + layout.columns)
                 if line.strip() and not is_comment(line)]
    if not 1 < len(lines) < layout.columns:
        return None
    try:
        return np.array([[layout.number(cell) for cell in fields_of(line, layout.delimiter)]
                         for line in lines])
    except ValueError:  # a cell that is no number, or rows of several lengths: said elsewhere
        return None


def _fault(path: Path, layout: Layout, places: Mapping[str, int],
           cells: Mapping[str, Callable[[str], float]], dates: Mapping[str, str]) -> str | None:
    """Return what is wrong with the first line that cannot be read, None if all can.

    Args:
        path: of the file.
        layout: of it.
        places, cells: index of each wanted column, and what reads its cells.
        dates: unit of the columns that hold dates or times of day.
    """
    with path.open(encoding=layout.encoding, errors='replace', newline='') as stream:
        for index, line in enumerate(stream):
            text = line.strip('\r\n')
            if index < layout.first or not text.strip() or is_comment(text):
                continue
            fields = fields_of(text, layout.delimiter)
            if len(fields) <= max(places.values()):
                return f'line {index + 1} has {len(fields)} of {layout.columns} columns'
            for name, place in places.items():
                try:
                    cells[name](fields[place])
                except ValueError:
                    return (f'line {index + 1}, column {name}: {_shown(fields[place])} is no '
                            + _wanted(fields[place], dates.get(name), layout))
    return None


def _wanted(cell: str, unit: str | None, layout: Layout) -> str:
    """Return what a cell should have been, and what to do where it holds a date."""
    if unit is not None:
        return f'time as {unit} has it, such as {EXAMPLES[unit]}'
    units = unit_of_date(cell)
    if units:
        return (f'number but a date or a time of day: give the time in --columns the unit {units}, '
                f'as in time=1:{units.split()[0]}')
    if layout.decimal_comma and '.' in cell:
        return ('number with a decimal comma, as others of the file have; points between thousands '
                'are not read')
    return 'number'


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= LONGEST_SHOWN else f'{cell[:LONGEST_SHOWN]}...')
