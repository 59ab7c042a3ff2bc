"""A serialised JointTrajectory read, and given its effort, without a message object.

Making an object of a message holds every thread of Python, for a second where it has 10^5 points,
and costs more than all else that is done with one of a single point. A compiled walk through the
bytes does neither.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from functools import lru_cache

import numba
import numpy as np
from rclpy.serialization import serialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from par4_kinematics.errors import InputError
from par4_kinematics.geometry import LEGS
from par4_kinematics.ros.convert import (
    ATTRIBUTE,
    REFERENCE_FIELDS,
    Trajectory,
    joint_columns,
    trajectory_of_rows,
    write_trajectory,
)
from par4_kinematics.stamps import SECOND

_BEHIND = 4
"""Bytes of the encapsulation header in front of a CDR message; alignment counts from its end."""
_ARRAYS = ('positions', 'velocities', 'accelerations', 'effort')
"""Of a point, in the order of the message type; its time from start follows."""
_CUT_OFF = 'a serialised JointTrajectory that is cut off or not little-endian CDR'


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _walk(words, first, places, sizes):
    """Write where the arrays of each point and its time stand, as indices of 32-bit words.

    Args:
        words: the message behind its first four bytes, uint32.
        first: where the points begin, as such an index.
        places: (n, 5), written; the last is that of the time from start.
        sizes: numbers in the arrays, (n, 4), written.

    Returns:
        Whether the message is long enough.
    """
    at, end = first, words.shape[0]
    for point in range(places.shape[0]):
        for part in range(4):
            if at >= end:
                return False
            size = np.int64(words[at])
            at += 1
            if size > 0:
                at += at % 2
            places[point, part], sizes[point, part] = at, size
            at += 2 * size
        if at + 2 > end:
            return False
        places[point, 4] = at
        at += 2
    return True


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _take(words, numbers, places, sizes, parts, width, columns, rows, from_start_ns):
    """Write the joints of each point and its time from start; return whether all is well.

    Args:
        words, numbers: the message, uint32 and float64.
        places, sizes: of `_walk`.
        parts: which arrays of a point are taken, (k,).
        width: numbers that each must have.
        columns: where the joints stand in them, (4,).
        rows: (k, n, 4), written.
        from_start_ns: (n,), written.
    """
    for point in range(places.shape[0]):
        for field in range(parts.shape[0]):
            if sizes[point, parts[field]] != width:
                return False
            place = places[point, parts[field]] // 2
            for joint in range(columns.shape[0]):
                number = numbers[place + columns[joint]]
                if not math.isfinite(number):
                    return False
                rows[field, point, joint] = number
        time = places[point, 4]
        seconds = np.int64(np.int32(words[time]))
        from_start_ns[point] = seconds * SECOND + np.int64(words[time + 1])
        if point > 0 and from_start_ns[point] <= from_start_ns[point - 1]:
            return False
    return places.shape[0] > 0


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _give(words, first, places, sizes, effort, written):
    """Write the message with `effort`, (n, 2 * joints) uint32, and return its length in words."""
    written[:first] = words[:first]
    at = first
    for point in range(places.shape[0]):
        for part in range(3):
            place, size = places[point, part], sizes[point, part]
            written[at] = size
            at += 1
            if size > 0:
                at += at % 2
            for word in range(2 * size):
                written[at + word] = words[place + word]
            at += 2 * size
        written[at] = effort.shape[1] // 2
        at += 1 + (at + 1) % 2
        for word in range(effort.shape[1]):
            written[at + word] = effort[point, word]
        at += effort.shape[1]
        written[at] = words[places[point, 4]]
        written[at + 1] = words[places[point, 4] + 1]
        at += 2
    return at


class SerialisedTrajectory:
    """The bytes of a JointTrajectory, and where in them its parts stand.

    Args:
        data: little-endian CDR, as a raw subscription receives it.

    Attributes:
        stamp_ns: of the header.

    Raises:
        InputError: bytes that are no such message.
    """

    def __init__(self, data: bytes) -> None:
        body = memoryview(data)[_BEHIND:]
        try:
            if data[:2] != b'\x00\x01':
                raise ValueError
            seconds, nanoseconds = struct.unpack_from('<iI', body, 0)
            _, at = _text(body, 8)
            self._names, at = _texts(body, at)
            count, at = _count(body, at)
        except (struct.error, ValueError):
            raise InputError(_CUT_OFF) from None
        if count > len(body) // 24:  # an empty point has four sizes and a time
            raise InputError(_CUT_OFF)
        self.stamp_ns = seconds * SECOND + nanoseconds
        self._head, self._first = data[:_BEHIND], at // 4
        padded = _aligned(body)
        self._words, self._numbers = padded.view('<u4'), padded.view('<f8')
        self._places = np.empty((count, 5), dtype=np.int64)
        self._sizes = np.empty((count, 4), dtype=np.int64)
        if not _walk(self._words, self._first, self._places, self._sizes):
            raise InputError(_CUT_OFF)

    def tells(self, field: str) -> bool:
        """Return whether any point has numbers in a field of `ATTRIBUTE`."""
        return bool(self._sizes[:, _ARRAYS.index(field)].any())

    def read(self, fields: Sequence[str] = REFERENCE_FIELDS) -> Trajectory:
        """Return what `convert.read_trajectory` returns of the message.

        Raises:
            InputError: as there.
        """
        count = len(self._places)
        if count == 0:
            raise self._refusal(fields)
        rows, from_start_ns = np.empty((len(fields), count, LEGS)), np.empty(count, dtype=np.int64)
        if not _take(self._words, self._numbers, self._places, self._sizes, _parts(tuple(fields)),
                     len(self._names), _columns(tuple(self._names)), rows, from_start_ns):
            raise self._refusal(fields)
        return Trajectory(self.stamp_ns, from_start_ns, **{
            ATTRIBUTE[field]: part for field, part in zip(fields, rows, strict=True)})

    def _refusal(self, fields: Sequence[str]) -> InputError:
        """Return what is wrong with the message, in the words of `convert`."""
        width, count = len(self._names), len(self._places)
        rows = {}
        for field in fields:
            part = _ARRAYS.index(field)
            wrong = np.flatnonzero(self._sizes[:, part] != width)
            if len(wrong):
                point = f' of point {wrong[0]}' if count > 1 else ''
                return InputError(f'{field}{point}: {self._sizes[wrong[0], part]} values for '
                                  f'{width} joint names; send one for each')
            rows[field] = self._numbers[self._places[:, part, None] // 2 + np.arange(width)]
        time = self._places[:, 4]
        from_start_ns = self._words.view('<i4')[time] * np.int64(SECOND) + self._words[time + 1]
        try:
            trajectory_of_rows(self.stamp_ns, from_start_ns, self._names, rows)
        except InputError as error:
            return error
        raise AssertionError('refused, but nothing is wrong with it')

    def with_effort(self, effort: np.ndarray) -> bytes:
        """Return the bytes of the same message with the effort (n, 4) of its points, N m.

        Other joints get 0.

        Raises:
            InputError: a joint that is missing or named twice.
        """
        rows = np.zeros((len(self._places), len(self._names)))
        rows[:, _columns(tuple(self._names))] = effort
        # each array may begin four bytes later than it did
        written = np.zeros(len(self._words) + rows.size * 2 + 5 * len(rows), dtype=np.uint32)
        end = _give(self._words, self._first, self._places, self._sizes, rows.view('<u4'), written)
        return self._head + written[:end].tobytes()


def read_serialised_trajectory(data: bytes, fields: Sequence[str] = REFERENCE_FIELDS
                               ) -> Trajectory:
    """Return what `convert.read_trajectory` returns of the message, from its bytes.

    Raises:
        InputError: as there, or bytes that are no such message.
    """
    return SerialisedTrajectory(data).read(fields)


def serialised_rest(q: np.ndarray, count: int) -> bytes:
    """Return a reference of `count` points that rests at q (4,), rad: what nodes compile with."""
    message, still = JointTrajectory(), np.zeros((count, len(q)))
    write_trajectory(message, JointTrajectoryPoint, Trajectory(
        0, np.arange(count), np.tile(q, (count, 1)), still, still, still))
    return serialize_message(message)


@lru_cache(maxsize=16)
def _columns(names: tuple[str, ...]) -> np.ndarray:
    return np.array(joint_columns(names))


@lru_cache(maxsize=16)
def _parts(fields: tuple[str, ...]) -> np.ndarray:
    return np.array([_ARRAYS.index(field) for field in fields])


def _aligned(body: memoryview) -> np.ndarray:
    """Return the bytes as whole numbers of eight, with zeros behind them.

    numpy copies many without holding other threads of Python, as joining bytes does.
    """
    padded = np.empty(len(body) + -len(body) % 8, dtype=np.uint8)
    padded[:len(body)] = np.frombuffer(body, dtype=np.uint8)
    padded[len(body):] = 0
    return padded


def _count(body: memoryview, at: int) -> tuple[int, int]:
    at = at + 3 & -4
    return struct.unpack_from('<I', body, at)[0], at + 4


def _text(body: memoryview, at: int) -> tuple[str, int]:
    size, at = _count(body, at)
    if at + size > len(body):
        raise ValueError
    return str(body[at:at + size - 1], 'utf-8'), at + size


def _texts(body: memoryview, at: int) -> tuple[list[str], int]:
    count, at = _count(body, at)
    if count > len(body):
        raise ValueError
    texts = []
    for _ in range(count):
        text, at = _text(body, at)
        texts.append(text)
    return texts, at
