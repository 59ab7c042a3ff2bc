"""Serialised messages in bulk: taken from MCAP records, and read by their layout.

The joint states of one publisher differ in stamp and numbers only, and so do most of the chunks of
a reference. Where everything else is alike, byte for byte, the numbers of all these messages are
columns of one table, and no message object is made.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike

_ENCAPSULATION = 4
"""Bytes in front of a CDR message; a header's stamp follows."""
_MESSAGE = 0x05
_MESSAGE_HEAD = 22
"""Bytes of an MCAP message record in front of the data: channel, sequence, two times."""


@dataclass(frozen=True)
class SerialisedMessages:
    """The messages of one topic (CDR), in the order of the bag.

    Attributes:
        received: bag time, (n,) ns.
        start, size: where each stands in `content`, (n,).
        content: bytes.
    """

    received: np.ndarray
    start: np.ndarray
    size: np.ndarray
    content: np.ndarray

    def __len__(self) -> int:
        return len(self.start)

    def __getitem__(self, index: int) -> bytes:
        """Return one message."""
        start = self.start[index]
        return self.content[start:start + self.size[index]].tobytes()


def serialised_messages(received: Sequence[int], data: Sequence[bytes]) -> SerialisedMessages:
    """Return messages (n,) with their bag times (n,), ns."""
    size = np.array([len(part) for part in data], dtype=np.int64)
    return SerialisedMessages(np.array(received, dtype=np.int64), np.cumsum(size) - size, size,
                              np.frombuffer(b''.join(data), dtype=np.uint8))


def messages_of_chunks(chunks: Iterable[bytes | memoryview], most: int, topics: Mapping[int, str]
                       ) -> dict[str, SerialisedMessages]:
    """Return the messages of topics among MCAP records, by bag time.

    Args:
        chunks: records, in the order of the file; each is done with when the next is asked for.
        most: bytes of all chunks together, or more.
        topics: by channel.

    Raises:
        ValueError: a record is longer than the rest of its chunk.
    """
    wanted = np.zeros(1 << 16, dtype=bool)
    wanted[list(topics)] = True
    content, filled = np.empty(most, dtype=np.uint8), 0
    tables = [np.empty((0, 4), dtype=np.int64)]
    table = tables[0]
    for chunk in chunks:
        records = np.frombuffer(chunk, dtype=np.uint8)
        if len(table) < len(records) // (9 + _MESSAGE_HEAD):
            table = np.empty((len(records) // (9 + _MESSAGE_HEAD), 4), dtype=np.int64)
        count, filled = _take_messages(records, wanted, content, filled, table)
        if count < 0:
            raise ValueError('an MCAP record is cut off')
        tables.append(table[:count].copy())
    channel, received, start, size = np.concatenate(tables).T
    messages = {}
    for topic in dict.fromkeys(topics.values()):
        rows = np.flatnonzero(np.isin(channel, [key for key in topics if topics[key] == topic]))
        if (np.diff(received[rows]) < 0).any():
            rows = rows[np.argsort(received[rows], kind='stable')]
        messages[topic] = SerialisedMessages(received[rows], start[rows], size[rows],
                                             content[:filled])
    return messages


@numba.njit(cache=True, error_model='numpy')
def _number(records, at, size):
    number = np.int64(0)
    for byte in range(size):
        number |= np.int64(records[at + byte]) << (8 * byte)
    return number


@numba.njit(cache=True, error_model='numpy')
def _take_messages(records, wanted, content, filled, table):
    """Append the data of messages to `content`; channel, bag time, start, size to `table`.

    Return the number of messages, -1 if a record is cut off, and where `content` now ends.
    """
    at, count = 0, 0
    while at < len(records):
        size = _number(records, at + 1, 8) if at + 9 <= len(records) else np.int64(-1)
        kind = records[at]
        at += 9
        if not 0 <= size <= len(records) - at or (kind == _MESSAGE and size < _MESSAGE_HEAD):
            return -1, filled
        if kind == _MESSAGE and wanted[_number(records, at, 2)]:
            table[count, 0] = _number(records, at, 2)
            table[count, 1] = _number(records, at + 6, 8)
            table[count, 2] = filled
            table[count, 3] = size - _MESSAGE_HEAD
            for byte in range(at + _MESSAGE_HEAD, at + size):
                content[filled] = records[byte]
                filled += 1
            count += 1
        at += size
    return count, filled


@numba.njit(cache=True, error_model='numpy')
def _same(content, start, like, places):
    same = np.empty(len(start), dtype=np.bool_)
    for row in range(len(start)):
        place = 0
        while place < len(places) and (content[start[row] + places[place]]
                                       == content[like + places[place]]):
            place += 1
        same[row] = place == len(places)
    return same


@numba.njit(cache=True, error_model='numpy')
def _gather(content, start, places, found):
    for row in range(len(start)):
        for byte in range(len(places)):
            found[row, byte] = content[start[row] + places[byte]]


@dataclass(frozen=True)
class Layout:
    """Where the numbers stand in little-endian messages that are alike in everything else.

    A JointState is laid out as a JointTrajectory of one point without a time of its own.

    Attributes:
        names: of the joints.
        alike: bytes that these messages share, (size,); all others belong to the stamp, to
            numbers, are padding, or stray behind the message.
        arrays: of each array of a point, in the order of the message type, where its numbers
            stand: (P, -), in eights of bytes behind the encapsulation.
        after: where the time from start of each point stands, in fours of bytes, (P,) or empty.
    """

    names: tuple[str, ...]
    alike: np.ndarray
    arrays: tuple[np.ndarray, ...]
    after: np.ndarray

    def followed_by(self, messages: SerialisedMessages, like: int, rows: np.ndarray) -> np.ndarray:
        """Return which of `rows` (m,) are laid out as message `like` is, (m,)."""
        alike = messages.size[rows] == len(self.alike)
        alike[alike] = _same(messages.content, messages.start[rows[alike]], messages.start[like],
                             np.flatnonzero(self.alike))
        return alike

    def read(self, messages: SerialisedMessages, rows: np.ndarray
             ) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
        """Return stamps (m,) ns, times from start (m, P) ns and arrays (m, P, -) of messages."""
        start = messages.start[rows] + _ENCAPSULATION

        def numbers(at: np.ndarray, kind: str) -> np.ndarray:
            width = np.dtype(kind).itemsize
            places = (width * at.reshape(-1, 1) + np.arange(width)).ravel()
            found = np.empty((len(rows), len(places)), dtype=np.uint8)
            _gather(messages.content, start, places, found)
            return found.view(kind).reshape(len(rows), *at.shape)

        def times(at: np.ndarray) -> np.ndarray:
            return numbers(at, '<i4') * np.int64(1_000_000_000) + numbers(at + 1, '<u4')

        points = len(self.arrays[0]) if self.arrays else 0
        after = times(self.after) if len(self.after) else np.zeros((len(rows), points), np.int64)
        return times(np.array([0]))[:, 0], after, tuple(numbers(at, '<f8') for at in self.arrays)


def joint_state_layout(data: bytes) -> Layout | None:
    """Return the layout of a serialised JointState, or None if it is none."""
    return _layout(data, lambda scan: ([[scan.numbers() for _ in range(3)]], []))


def trajectory_layout(data: bytes) -> Layout | None:
    """Return the layout of a serialised JointTrajectory with points alike, or None."""
    def points(scan: _Scan) -> tuple[list, list]:
        arrays, after = [], []
        for _ in range(scan.count()):
            arrays.append([scan.numbers() for _ in range(4)])
            after.append(scan.time())
        return arrays, after

    return _layout(data, points)


def _layout(data: bytes, points: Callable[[_Scan], tuple[list, list]]) -> Layout | None:
    if data[:2] != b'\x00\x01':  # little-endian, without parameters
        return None
    scan = _Scan(data)
    try:
        scan.time()
        scan.text()
        names = tuple(scan.text() for _ in range(scan.count()))
        arrays, after = points(scan)
        return Layout(names, scan.alike,
                      tuple(np.array(part, dtype=np.int64) for part in zip(*arrays, strict=True)),
                      np.array(after, dtype=np.int64))
    except (struct.error, ValueError):  # cut off, or points that differ
        return None


class _Scan:
    """A walk through a little-endian message, from field to field, that notes what it reads."""

    def __init__(self, data: bytes) -> None:
        """Start behind the encapsulation, from where CDR aligns."""
        self._data = data
        self._at = _ENCAPSULATION
        self.alike = np.zeros(len(data), dtype=bool)
        self.alike[:2] = True

    def _take(self, size: int, alignment: int) -> int:
        """Pass `size` bytes and return where they start."""
        first = (self._at - _ENCAPSULATION + alignment - 1 & -alignment) + _ENCAPSULATION
        if first + size > len(self._data):
            raise ValueError
        self._at = first + size
        return first

    def count(self) -> int:
        """Return an unsigned number that is part of the layout."""
        at = self._take(4, 4)
        self.alike[at:at + 4] = True
        return struct.unpack_from('<I', self._data, at)[0]

    def text(self) -> str:
        """Return a string."""
        size = self.count()
        at = self._take(size, 1)
        self.alike[at:at + size] = True
        return self._data[at:at + size - 1].decode()

    def time(self) -> int:
        """Return where a time or duration stands, in fours of bytes."""
        return (self._take(8, 4) - _ENCAPSULATION) // 4

    def numbers(self) -> range:
        """Return where the numbers of an array stand, in eights of bytes."""
        size = self.count()
        first = (self._take(8 * size, 8) - _ENCAPSULATION) // 8 if size else 0
        return range(first, first + size)


class JointStateTemplate:
    """A serialised JointState whose stamp and numbers are written over, again and again."""

    def __init__(self, data: bytes | memoryview) -> None:
        """Take a little-endian message; its numbers do not matter."""
        self._data = bytearray(data)
        numbers = np.frombuffer(self._data, '<f8', (len(data) - _ENCAPSULATION) // 8,
                                _ENCAPSULATION)
        self._arrays = [numbers[at[0]:at[-1] + 1] if len(at) else np.empty(0)
                        for at, in joint_state_layout(bytes(data)).arrays]

    def filled(self, stamp: int, parts: Sequence[ArrayLike]) -> bytes:
        """Return the message stamped `stamp`, ns, with its position, velocity and effort."""
        struct.pack_into('<iI', self._data, _ENCAPSULATION, *divmod(stamp, 1_000_000_000))
        for array, part in zip(self._arrays, parts, strict=True):
            array[:] = part
        return bytes(self._data)
