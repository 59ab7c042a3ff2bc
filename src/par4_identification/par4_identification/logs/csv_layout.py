"""How a CSV file of a logger is written: where its table begins, its names and its marks."""

from __future__ import annotations

import codecs
import csv
import re
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from par4_identification.logs.dates import DATES
from par4_kinematics.errors import InputError
from par4_kinematics.files import why_no_text

ROW_END = ';'
DELIMITERS = (ROW_END, '\t', ',')
"""Tried in this order: where one of the first two parts the fields, a comma is a decimal comma."""
COMMENTS = '#%'
MOST_ABOVE = 10_000
"""Lines above the data that may hold its header."""
UNIFORM = 20
"""Lines below the first of a table that have as many cells, or all to the end of the file."""
LONGEST_SHOWN = 40
"""Characters of a line or cell that an error shows."""
CHUNK = 1 << 20
"""Characters that are read at a time."""
EMPTY = {'', 'nan', 'na', 'n/a', '#n/a', '#na', 'null', 'none'}
"""Cells that hold no number, in lower case."""


@dataclass(frozen=True)
class Top:
    """The first line of a table that is data for certain.

    Attributes:
        index: lines before it.
        delimiter: None for spaces.
        fields: its cells.
        above: number and text of the lines above it that are not empty.
    """

    index: int
    delimiter: str | None
    fields: Sequence[str]
    above: Collection[tuple[int, str]]


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
        """Return the number in a cell, NaN in an empty one; a comment may stand behind it.

        Raises:
            ValueError: it holds something else.
        """
        if _is_empty(cell):
            return np.nan
        cell = cell.partition(' #')[0]
        if self.decimal_comma and '.' in cell:
            raise ValueError('points part thousands')
        return float(cell.replace(',', '.') if self.decimal_comma else cell)

    def date(self, cell: str, unit: str) -> float:
        """Return the time of one of the units `DATES` in a cell, s, NaN in an empty one.

        Raises:
            ValueError: it holds something else.
        """
        return np.nan if _is_empty(cell) else DATES[unit](cell.strip())


def layout_of(path: Path, wanted: Collection[str] = (), dates: Collection[str] = ()) -> Layout:
    """Return how a CSV is written.

    Args:
        path: of the file.
        wanted: names or numbers, counted from 1, of columns. A line that holds all of several names
            is the header, whatever stands above it. If 1 is wanted, lines that begin with a word,
            as settings do, are not the table yet.
        dates: those of `wanted` that hold dates.

    Raises:
        InputError: the file cannot be read as text, or holds no numbers.
    """
    names = {name for name in wanted if not name.isdecimal()}
    try:
        encoding = _encoding(path)
        with path.open(encoding=encoding, newline='') as stream:
            header = _header_line(stream, names) if len(names) > 1 else 0
        with path.open(encoding=encoding, newline='') as stream:
            top = _top(((index, text) for index, line in enumerate(stream)
                        if index >= header and (text := line.strip('\r\n')).strip()),
                       '1' in wanted and '1' not in dates)
        if top is not None:
            headers, first = _headers(top)
            with path.open(encoding=encoding, newline='') as stream:
                decimal_comma = _has_decimal_comma(
                    (line.strip('\r\n') for line in islice(stream, top.index, None)),
                    top.delimiter)
            return Layout(headers, len(top.fields), first, top.delimiter, decimal_comma, encoding)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f'{path}: cannot be read as text ({why_no_text(error)}); give a CSV, .npz '
                         f'or .mat file') from error
    raise InputError(f'{path}: no line of it holds numbers{_shown(path, encoding)}; give a CSV '
                     f'whose cells are numbers without units, or an .npz or .mat file')


def _shown(path: Path, encoding: str) -> str:
    """Return what the last of the first lines of a text says, in words; nothing of an empty one."""
    with path.open(encoding=encoding, newline='') as stream:
        lines = [text for line in islice(stream, UNIFORM) if (text := line.strip())]
    return f', such as {lines[-1][:LONGEST_SHOWN]!r}' if lines else ''


def _header_line(lines: Iterable[str], names: set[str]) -> int:
    """Return the index of the first line that has a cell for each name, 0 if none has."""
    for index, text in enumerate(islice(lines, MOST_ABOVE)):
        text = text.strip('\r\n').lstrip(COMMENTS + ' ')
        if any(names <= {cell.strip() for cell in fields_of(text, mark)}
               for mark in (*DELIMITERS, None) if text):
            return index
    return 0


def _top(numbered: Iterator[tuple[int, str]], number_first: bool) -> Top | None:
    """Return the first line with numbers below which the lines have as many cells.

    What a logger writes above its table has numbers, too, such as its rate, but no such lines below
    it, or a single cell. If no line is like that, as in a damaged file, it is the first one with
    numbers; None without any.

    Args:
        numbered: index and text of the lines that are not empty.
        number_first: whether lines of the table begin with a number.
    """
    above: deque[tuple[int, str]] = deque(maxlen=MOST_ABOVE)
    ahead = deque(islice(numbered, UNIFORM))
    first = None
    while ahead:
        index, text = ahead.popleft()
        if first is not None and index > first.index + MOST_ABOVE:
            break
        ahead.extend(islice(numbered, 1))
        delimiter = _delimiter(text)
        fields = fields_of(text, delimiter)
        if not is_comment(text) and _is_data(fields):
            first = first or Top(index, delimiter, fields, tuple(above))
            if number_first and not (_is_empty(fields[0])
                                     or _is_number(fields[0])):
                continue
            if len(fields) > 1 and all(len(fields_of(below, delimiter)) == len(fields)
                                       for _, below in ahead if not is_comment(below)):
                return Top(index, delimiter, fields, above)
        above.append((index, text))
    return first


def _delimiter(text: str) -> str | None:
    """Return what parts the cells of a line; None for spaces.

    Where spaces part more numbers than commas do, the commas are decimal ones.
    """
    text = row_of(text, None)
    mark = next((mark for mark in DELIMITERS if mark in text), None)
    if mark == ',' and len(text.split()) > 1:
        spaced = sum(_is_number(field) and not field.endswith(',') for field in text.split())
        if spaced > sum(_is_number(field, False) for field in text.split(',')):
            return None
    return mark


def row_of(line: str, delimiter: str | None) -> str:
    """Return a line without the semicolon that ends a row of a matrix, and parts no cells."""
    text = line.rstrip()
    ends = delimiter != ROW_END and text.endswith(ROW_END) and text.count(ROW_END) == 1
    return text[:-1] if ends else line


def is_comment(text: str) -> bool:
    """Return whether a line that is not empty is a comment; `#N/A` is an empty cell."""
    text = text.lstrip()
    return text[0] in COMMENTS and not _is_empty(re.split(r'[;,\s]', text, maxsplit=1)[0])


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


def _is_data(fields: Sequence[str]) -> bool:
    """Return whether all cells of a line that are not empty are numbers, or half of all cells."""
    numbers = sum(_is_number(field) for field in fields)
    filled = sum(not _is_empty(field) for field in fields)
    return numbers > 0 and (numbers == filled or 2 * numbers >= len(fields))


def _headers(top: Top) -> tuple[tuple[tuple[str, ...], ...], int]:
    """Return the rows of names above the data, and the line at which the data begins.

    Below the last row of words every row is data, however many of its cells are empty. Where a
    header has numbers too, it is the first row with words.
    """
    rows = {row: names for row, text in top.above
            if (names := _names(text, top.delimiter, top.fields))}
    numbers = {row: sum(_is_number(name) for name in names)
               for row, names in rows.items()}
    named = [row for row, names in rows.items()
             if sum(not _is_empty(name) for name in names) > numbers[row]]
    headers = [row for row in named if not numbers[row]] or named[:1]
    below = [row for row, text in top.above if row in rows and not is_comment(text)
             and (not headers or row > headers[-1])]
    return tuple(rows[row] for row in headers), min(below, default=top.index)


def _names(text: str, delimiter: str | None, fields: Sequence[str]) -> tuple[str, ...]:
    """Return the cells of a line above the data, none where it has another number of them.

    A delimiter behind the last cell of the line, or behind that of the data, does not count.
    """
    text = text.lstrip(COMMENTS + ' ')
    for mark in dict.fromkeys((delimiter, *DELIMITERS, None)):
        names = [name.strip() for name in fields_of(text, mark)]
        if len(names) == len(fields) + 1 and not names[-1]:
            names.pop()
        if len(names) == len(fields) - 1 and names and not fields[-1].strip():
            names.append('')
        if len(names) == len(fields):
            return tuple(names)
    return ()


def _has_decimal_comma(lines: Iterable[str], delimiter: str | None) -> bool:
    """Return whether the first line with decimal marks has only commas for them."""
    mark = '"' if delimiter == ',' else ','  # a cell with the delimiter in it is quoted
    for line in lines:
        if mark not in line and '.' not in line:
            continue
        numbers = [field for field in fields_of(line, delimiter) if _is_number(field)]
        if any('.' in number for number in numbers):
            return False
        if any(',' in number for number in numbers):
            return True
    return False


def fields_of(text: str, delimiter: str | None) -> list[str]:
    text = row_of(text, delimiter)
    if delimiter is None:
        return text.split()
    return next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))


def _is_empty(field: str) -> bool:
    return field.strip().lower() in EMPTY


def _is_number(field: str, decimal_comma: bool = True) -> bool:
    field = field.strip()
    if decimal_comma:
        field = field.replace(',', '.')
    return re.fullmatch(r'[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?', field) is not None
