"""Columns of numbers from the files that loggers write: CSV, numpy archives, MATLAB files."""

from __future__ import annotations

import codecs
import csv
import multiprocessing
import re
import signal
from collections import deque
from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import scipy

from par4_kinematics.errors import InputError
from par4_kinematics.held_signals import held_back

DELIMITERS = (';', '\t', ',')
"""Tried in this order: where one of the first two parts the fields, a comma is a decimal comma."""
COMMENTS = '#%'
MOST_NAMED = 12
"""Names that an error lists."""
MOST_ABOVE = 10_000
"""Lines above the data that may hold its header."""
CHUNK, LONGEST_SHOWN = 1 << 20, 40
"""Characters that are read at a time, and of a cell that an error shows."""
EMPTY = {'', 'nan', 'na', 'n/a', 'null', 'none'}
"""Cells that hold no number, in lower case."""


@dataclass(frozen=True)
class Layout:
    """How a CSV file is written.

    Attributes:
        headers: rows of names above the data: of the columns, of their units; none without header.
        columns: how many there are.
        first: lines before the data.
        delimiter: None for spaces.
        decimal_comma: whether `1,5` is a number.
        encoding: of its text.
    """

    headers: tuple[tuple[str, ...], ...]
    columns: int
    first: int
    delimiter: str | None
    decimal_comma: bool
    encoding: str

    def number(self, cell: str) -> float:
        """Return the number in a cell, NaN in an empty one.

        Raises:
            ValueError: it holds something else.
        """
        if _is_empty(cell):
            return np.nan
        return float(cell.replace(',', '.') if self.decimal_comma else cell)


def read_columns(path: str | Path, wanted: Sequence[str], array: str | None = None
                 ) -> dict[str, np.ndarray]:
    """Return columns of a file by their names, or by their numbers counted from 1.

    A CSV may be parted by commas, semicolons, tabs or spaces, begin with comments, a header and a
    row of units, and have decimal commas; empty cells are NaN. A column of a numpy archive (.npz)
    or a MATLAB file (.mat, up to version 7.2) is one of its arrays by name; of one with several
    numbers a sample `NAME[2]` is the second. Or it is a row or column of the array that `array`
    names. The longer side of an array is time.

    Args:
        path: of the file; what it is follows from the end of its name.
        wanted: names or numbers; a name goes first.
        array: of an archive that holds tables.

    Returns:
        Each wanted column, (n,); of one length.

    Raises:
        InputError: no such file, cannot be read, no such column, a cell that is no number, columns
            of different lengths.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f'{path}: no such file; give a CSV, .npz or .mat file')
    kind = path.suffix.lower()
    if kind in ('.npz', '.mat'):
        columns = _of_archive(path, _archive(path), wanted, array)
    elif array is not None:
        raise InputError(f'{path}: --array {array} is for .npz and .mat files; this one is read '
                         f'as a CSV')
    else:
        columns = _of_csv(path, wanted)
    lengths = {name: len(column) for name, column in columns.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f'{path}: the columns differ in length: ' + ', '.join(
            f'{name} {length}' for name, length in lengths.items()) + '; give columns of one table')
    return columns


def _place(path: Path, wanted: str, headers: Sequence[Sequence[str]], count: int) -> int:
    """Return the index of a column that is given by its name or number; upper rows go first."""
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
                     + (f': {_listed(most)}' if most else ' without names, counted from 1'))


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
    # Of damaged files both libraries raise whatever their parsers meet; scipy.io.loadmat raises
    # NotImplementedError for MATLAB 7.3 files, which are HDF5.
    except Exception as error:
        raise InputError(f'{path}: cannot be read ({" ".join(str(error).split())}); give an '
                         f'archive of plain numbers') from error


def _of_matlab(path: str) -> dict[str, np.ndarray]:
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
                                                 if tables else ''))
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


def _of_csv(path: Path, wanted: Sequence[str]) -> dict[str, np.ndarray]:
    layout = _layout(path)
    places = [_place(path, name, layout.headers, layout.columns) for name in wanted]

    try:
        values = np.loadtxt(path, delimiter=layout.delimiter, skiprows=layout.first, ndmin=2,
                            usecols=places, converters=layout.number, comments='#', quotechar='"',
                            encoding=layout.encoding)
    except (ValueError, UnicodeDecodeError, OSError) as error:
        said = _fault(path, layout, dict(zip(wanted, places))) or ' '.join(
            str(error).split()).rstrip('.')
        raise InputError(f'{path}: {said}; mend the file') from error
    return dict(zip(wanted, values.T, strict=True))


def _fault(path: Path, layout: Layout, places: Mapping[str, int]) -> str | None:
    """Return what is wrong with the first line that cannot be read, None if all can."""
    with path.open(encoding=layout.encoding, errors='replace', newline='') as stream:
        for index, line in enumerate(stream):
            text = line.split('#')[0].strip('\r\n')
            if index < layout.first or not text.strip():
                continue
            fields = _fields(text, layout.delimiter)
            if len(fields) <= max(places.values()):
                return f'line {index + 1} has {len(fields)} of {layout.columns} columns'
            for name, place in places.items():
                try:
                    layout.number(fields[place])
                except ValueError:
                    return f'line {index + 1}, column {name}: {_shown(fields[place])} is no number'
    return None


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= LONGEST_SHOWN else f'{cell[:LONGEST_SHOWN]}...')


def _encoding(path: Path) -> str:
    """Return the encoding of a text: UTF-16 by its mark, UTF-8 if it can be, or else Windows-1252.

    Raises:
        OSError: it cannot be read.
        UnicodeDecodeError: it is no text.
    """
    with path.open('rb') as stream:
        if stream.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            return 'utf-16'
    for encoding in ('utf-8-sig', 'cp1252'):
        try:
            with path.open(encoding=encoding, newline='') as stream:
                while text := stream.read(CHUNK):
                    if '\0' in text:
                        raise UnicodeDecodeError(encoding, b'\0', 0, 1, 'holds zero bytes')
            return encoding
        except UnicodeDecodeError as error:
            found = error
    raise found


def _layout(path: Path) -> Layout:
    """Return how a CSV is written, judged by the lines up to the first that holds numbers."""
    above: deque[tuple[int, str]] = deque(maxlen=MOST_ABOVE)
    try:
        encoding = _encoding(path)
        with path.open(encoding=encoding, newline='') as stream:
            for index, line in enumerate(stream):
                text = line.strip('\r\n')
                delimiter = next((mark for mark in DELIMITERS if mark in text), None)
                fields = _fields(text, delimiter)
                if text.strip() and text.lstrip()[0] not in COMMENTS and _is_data(
                        fields, delimiter):
                    headers, first = _headers(above, delimiter, fields, index)
                    return Layout(headers, len(fields), first, delimiter,
                                  _has_decimal_comma(chain([text], stream), delimiter),
                                  encoding)
                if text.strip():
                    above.append((index, text))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'{path}: cannot be read as text ({error}); give a CSV, .npz or .mat file'
                         ) from error
    raise InputError(f'{path}: no line of it holds numbers; give a CSV, .npz or .mat file')


def _is_data(fields: Sequence[str], delimiter: str | None) -> bool:
    """Return whether all cells of a line that are not empty are numbers, or half of all cells."""
    numbers = sum(_is_number(field, delimiter != ',') for field in fields)
    filled = sum(not _is_empty(field) for field in fields)
    return numbers > 0 and (numbers == filled or 2 * numbers >= len(fields))


def _headers(above: Collection[tuple[int, str]], delimiter: str | None, fields: Sequence[str],
             index: int) -> tuple[tuple[tuple[str, ...], ...], int]:
    """Return the rows of names above the data, and the line at which the data begins.

    Below the last row of words every row is data, however many of its cells are empty. Where a
    header has numbers too, it is the first row with words.

    Args:
        above: number and text of the lines above the first that is data for certain.
        delimiter: of the data.
        fields: of the first line that is data for certain.
        index: its number.
    """
    rows = {row: names for row, text in above if (names := _names(text, delimiter, fields))}
    numbers = {row: sum(_is_number(name, delimiter != ',') for name in names)
               for row, names in rows.items()}
    named = [row for row, names in rows.items()
             if sum(not _is_empty(name) for name in names) > numbers[row]]
    headers = [row for row in named if not numbers[row]] or named[:1]
    below = [row for row, text in above if row in rows and text.lstrip()[0] not in COMMENTS
             and (not headers or row > headers[-1])]
    return tuple(rows[row] for row in headers), min(below, default=index)


def _names(text: str, delimiter: str | None, fields: Sequence[str]) -> tuple[str, ...]:
    """Return the cells of a line above the data, none where it has another number of them.

    A delimiter behind the last cell of the line, or behind that of the data, does not count.
    """
    text = text.lstrip(COMMENTS + ' ')
    for mark in dict.fromkeys((delimiter, *DELIMITERS, None)):
        names = [name.strip() for name in _fields(text, mark)]
        if len(names) == len(fields) + 1 and not names[-1]:
            names.pop()
        if len(names) == len(fields) - 1 and names and not fields[-1].strip():
            names.append('')
        if len(names) == len(fields):
            return tuple(names)
    return ()


def _has_decimal_comma(lines: Iterable[str], delimiter: str | None) -> bool:
    """Return whether the first line with decimal marks has only commas for them."""
    if delimiter == ',':
        return False
    for line in lines:
        if ',' not in line and '.' not in line:
            continue
        numbers = [field for field in _fields(line, delimiter) if _is_number(field, True)]
        if any('.' in number for number in numbers):
            return False
        if any(',' in number for number in numbers):
            return True
    return False


def _fields(text: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return text.split()
    return next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))


def _is_empty(field: str) -> bool:
    return field.strip().lower() in EMPTY


def _is_number(field: str, decimal_comma: bool) -> bool:
    field = field.strip()
    if decimal_comma:
        field = field.replace(',', '.')
    return re.fullmatch(r'[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?', field) is not None
