"""A serialised JointTrajectory -> Trajectory without a message object.

Making an object of a message holds every thread of Python, for a second where it has 10^5 points;
the compiled walk through its bytes lets the physics go on.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import numba
import numpy as np

from par4_kinematics.errors import InputError
from par4_kinematics.ros.convert import (
    REFERENCE_FIELDS,
    SECOND,
    Trajectory,
    trajectory_of_rows,
)

_BEHIND = 4
"""Bytes in front of a CDR message, from behind which it is aligned."""
_ARRAYS = ('positions', 'velocities', 'accelerations', 'effort')
"""Of a point, in the order of the message type; its time from start follows."""
_CUT_OFF = 'a serialised JointTrajectory that is cut off or not little-endian CDR'


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _walk(words, first, places, sizes, from_start_ns):
    """Write where the arrays of each point stand, in eights of bytes, and its time from start.

    Args:
        words: the message behind its first four bytes, uint32.
        first: where the points begin, in fours of bytes.
        places, sizes: (n, 4), written.
        from_start_ns: (n,), written.

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
            places[point, part], sizes[point, part] = at // 2, size
            at += 2 * size
        if at + 2 > end:
            return False
        seconds = np.int64(np.int32(words[at]))
        from_start_ns[point] = seconds * 1_000_000_000 + np.int64(words[at + 1])
        at += 2
    return True


@numba.njit(cache=True, error_model='numpy', nogil=True)
def _take(numbers, places, rows):
    for point in range(rows.shape[0]):
        for joint in range(rows.shape[1]):
            rows[point, joint] = numbers[places[point] + joint]


def read_serialised_trajectory(data: bytes, fields: Sequence[str] = REFERENCE_FIELDS
                               ) -> Trajectory:
    """Return what `convert.read_trajectory` returns of the message, from its bytes.

    Raises:
        InputError: as there, or bytes that are no such message.
    """
    body = data[_BEHIND:]
    try:
        if data[:2] != b'\x00\x01':
            raise ValueError
        seconds, nanoseconds = struct.unpack_from('<iI', body, 0)
        _, at = _text(body, 8)
        names, at = _texts(body, at)
        count, at = _count(body, at)
    except (struct.error, ValueError):
        raise InputError(_CUT_OFF) from None
    if count > len(body) // 24:  # an empty point has four sizes and a time
        raise InputError(_CUT_OFF)
    padded = np.frombuffer(body + bytes(-len(body) % 8), dtype=np.uint8)
    places, sizes = np.empty((2, count, 4), dtype=np.int64)
    from_start_ns = np.empty(count, dtype=np.int64)
    if not _walk(padded.view('<u4'), at // 4, places, sizes, from_start_ns):
        raise InputError(_CUT_OFF)
    numbers, rows = padded.view('<f8'), {}
    for field in fields:
        part = _ARRAYS.index(field)
        short = np.flatnonzero(sizes[:, part] != len(names))
        if len(short):
            point = f' of point {short[0]}' if count > 1 else ''
            raise InputError(f'{field}{point}: {sizes[short[0], part]} values for {len(names)} '
                             f'joint names; send one for each')
        rows[field] = np.empty((count, len(names)))
        _take(numbers, np.ascontiguousarray(places[:, part]), rows[field])
    return trajectory_of_rows(seconds * SECOND + nanoseconds, from_start_ns, names, rows)


def _count(body: bytes, at: int) -> tuple[int, int]:
    at = at + 3 & -4
    return struct.unpack_from('<I', body, at)[0], at + 4


def _text(body: bytes, at: int) -> tuple[str, int]:
    size, at = _count(body, at)
    if at + size > len(body):
        raise ValueError
    return body[at:at + size - 1].decode(), at + size


def _texts(body: bytes, at: int) -> tuple[list[str], int]:
    count, at = _count(body, at)
    if count > len(body):
        raise ValueError
    texts = []
    for _ in range(count):
        text, at = _text(body, at)
        texts.append(text)
    return texts, at
