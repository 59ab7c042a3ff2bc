"""Serialised messages in bulk: taken from MCAP records, and read by their layout.

The joint states of one publisher differ in stamp and numbers only, and so do most of the chunks of
a reference. Where everything else is alike, byte for byte, the numbers of all these messages are
columns of one table, and no message object is made.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numba
import numpy as np

from par4_kinematics.stamps import SECOND
from par4_sim.bags.message_layout import ENCAPSULATION, MessageLayout

_MESSAGE = 0x05
_MESSAGE_HEAD = 22
"""Bytes of an MCAP message record in front of the data: channel, sequence, two times."""


@dataclass(frozen=True)
class SerialisedMessages:
    """The messages of one topic (CDR), in the order of the bag.

    Attributes:
        received: bag time, (n,) ns.
        start, size: where each stands in `content`, (n,).
        content: bytes, which nothing may write to; kernels are compiled for such.
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
        records.setflags(write=False)
        if len(table) < len(records) // (9 + _MESSAGE_HEAD):
            table = np.empty((len(records) // (9 + _MESSAGE_HEAD), 4), dtype=np.int64)
        count, filled = _take_messages(records, wanted, content, filled, table)
        if count < 0:
            raise ValueError('an MCAP record is cut off')
        tables.append(table[:count].copy())
    content = content[:filled]
    content.setflags(write=False)
    channel, received, start, size = np.concatenate(tables).T
    messages = {}
    for topic in dict.fromkeys(topics.values()):
        rows = np.flatnonzero(np.isin(channel, [key for key in topics if topics[key] == topic]))
        if (np.diff(received[rows]) < 0).any():
            rows = rows[np.argsort(received[rows], kind='stable')]
        messages[topic] = SerialisedMessages(received[rows], start[rows], size[rows], content)
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
    at, count = np.int64(0), 0
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


def laid_out_alike(messages: SerialisedMessages, like: int, layout: MessageLayout, rows: np.ndarray
                   ) -> np.ndarray:
    """Return which of `rows` (m,) are laid out as message `like`, (m,).

    Args:
        messages: of one topic.
        like: index of one of them.
        layout: of that one.
        rows: indices of those asked about, (m,).
    """
    alike = messages.size[rows] == len(layout.alike)
    alike[alike] = _same(messages.content, messages.start[rows[alike]], messages.start[like],
                         np.flatnonzero(layout.alike))
    return alike


def numbers_of(messages: SerialisedMessages, layout: MessageLayout, rows: np.ndarray
               ) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, ...]]:
    """Return stamps (m,) ns, times from start (m, P) ns and arrays (m, P, -) of messages."""
    start = messages.start[rows] + ENCAPSULATION

    def numbers(at: np.ndarray, kind: str) -> np.ndarray:
        width = np.dtype(kind).itemsize
        places = (width * at.reshape(-1, 1) + np.arange(width)).ravel()
        found = np.empty((len(rows), len(places)), dtype=np.uint8)
        _gather(messages.content, start, places, found)
        return found.view(kind).reshape(len(rows), *at.shape)

    def times(at: np.ndarray) -> np.ndarray:
        return numbers(at, '<i4') * np.int64(SECOND) + numbers(at + 1, '<u4')

    points = len(layout.arrays[0]) if layout.arrays else 0
    after = times(layout.after) if len(layout.after) else np.zeros((len(rows), points), np.int64)
    return times(np.array([0]))[:, 0], after, tuple(numbers(at, '<f8') for at in layout.arrays)
