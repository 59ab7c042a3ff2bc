"""Rows of a sqlite3 table read from its pages, without the tree that leads to them.

The tree of a table grows upwards: pages near its root are written late, and a file that was cut
loses them although most leaves are there. A leaf tells all of its rows by itself
(https://www.sqlite.org/fileformat2.html, sections 1.6 and 2.1).
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Sequence
from pathlib import Path

Value = int | bytes | None
"""NULL, a whole number, or the bytes of a text or blob; of a floating-point number they, too."""
LEAF = 0x0D
INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
"""Serial type of a whole number -> its bytes."""
HEADER = 100
"""Bytes in front of the first page's content."""


def rows_of_leaves(database: Path) -> Iterator[tuple[int, tuple[Value, ...]]]:
    """Yield rowid and values of each row in a leaf of any table, in the order of the pages.

    What is damaged is passed over.
    """
    with database.open('rb') as stream, mmap.mmap(stream.fileno(), 0,
                                                  access=mmap.ACCESS_READ) as content:
        size = int.from_bytes(content[16:18], 'big')
        size = 65536 if size == 1 else size
        usable = size - content[20]
        if size < 512 or usable < 480:
            return
        for start in range(0, len(content) - size + 1, size):
            page = content[start:start + size]
            first = HEADER if start == 0 else 0
            if page[first] != LEAF:
                continue
            cells = int.from_bytes(page[first + 3:first + 5], 'big')
            for cell in range(cells):
                at = first + 8 + 2 * cell
                row = _row(content, page, int.from_bytes(page[at:at + 2], 'big'), usable)
                if row is not None:
                    yield row


def _row(content: mmap.mmap, page: bytes, at: int, usable: int
         ) -> tuple[int, tuple[Value, ...]] | None:
    """Return rowid and values of a cell; None where it does not hold together."""
    try:
        length, at = _varint(page, at)
        rowid, at = _varint(page, at)
        return rowid, _values(_payload(content, page, at, length, usable))
    except (IndexError, ValueError):
        return None


def _payload(content: mmap.mmap, page: bytes, at: int, length: int, usable: int) -> bytes:
    """Return what a cell holds, with what overflows its page.

    Raises:
        ValueError: a page that it goes on in is missing, or it is longer than the file.
    """
    if length > len(content):
        raise ValueError('a length is damaged')
    local = length
    if length > usable - 35:
        least = (usable - 12) * 32 // 255 - 23
        local = least + (length - least) % (usable - 4)
        local = local if local <= usable - 35 else least
    parts, missing = [page[at:at + local]], length - local
    follow = int.from_bytes(page[at + local:at + local + 4], 'big') if missing else 0
    while missing > 0:
        start = (follow - 1) * len(page)
        if not 0 < start <= len(content) - len(page):
            raise ValueError('a page is missing')
        part = content[start + 4:start + 4 + min(missing, usable - 4)]
        parts.append(part)
        missing -= len(part)
        follow = int.from_bytes(content[start:start + 4], 'big')
    return b''.join(parts)


def _values(record: bytes) -> tuple[Value, ...]:
    """Return the columns of a record.

    Raises:
        ValueError: it is shorter than it says.
    """
    end, at = _varint(record, 0)
    types: list[int] = []
    while at < end:
        kind, at = _varint(record, at)
        types.append(kind)
    values: list[Value] = []
    for kind in types:
        size = INTEGERS.get(kind, 8 if kind == 7 else max(kind - 12, 0) // 2)
        part = record[at:at + size]
        if len(part) < size:
            raise ValueError('a record is cut')
        at += size
        values.append(_whole(kind, part))
    return tuple(values)


def _whole(kind: int, part: bytes) -> Value:
    if kind in INTEGERS:
        return int.from_bytes(part, 'big', signed=True)
    return {0: None, 8: 0, 9: 1}.get(kind, part)


def _varint(data: Sequence[int], at: int) -> tuple[int, int]:
    """Return a whole number of one to nine bytes, and where the next byte is."""
    number = 0
    for place in range(8):
        byte = data[at + place]
        number = number << 7 | byte & 0x7F
        if byte < 0x80:
            return number, at + place + 1
    return number << 8 | data[at + 8], at + 9
