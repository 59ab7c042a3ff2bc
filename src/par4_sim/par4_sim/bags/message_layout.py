"""Where the numbers stand in a serialised message (CDR), and messages written over in place.

The joint states of one publisher differ in stamp and numbers only. Their layout is found once; the
numbers of the next message are then written, or those of a whole bag read, without making a
message object.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from par4_kinematics.stamps import SECOND

ENCAPSULATION = 4
"""Bytes in front of a CDR message; a header's stamp follows."""


@dataclass(frozen=True)
class MessageLayout:
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


Points = tuple[list[list[range]], list[int]]
"""Where the numbers of the arrays of each point stand, and its time from start."""


def joint_state_layout(data: bytes) -> MessageLayout | None:
    """Return the layout of a serialised JointState, or None if it is none."""
    return _layout(data, lambda scan: ([[scan.numbers() for _ in range(3)]], []))


def trajectory_layout(data: bytes) -> MessageLayout | None:
    """Return the layout of a serialised JointTrajectory with points alike, or None."""
    def points(scan: _Scan) -> Points:
        arrays, after = [], []
        for _ in range(scan.count()):
            arrays.append([scan.numbers() for _ in range(4)])
            after.append(scan.time())
        return arrays, after

    return _layout(data, points)


def _layout(data: bytes, points: Callable[[_Scan], Points]) -> MessageLayout | None:
    if data[:2] != b'\x00\x01':  # little-endian, without parameters
        return None
    scan = _Scan(data)
    try:
        scan.time()
        scan.text()
        names = tuple(scan.text() for _ in range(scan.count()))
        arrays, after = points(scan)
        return MessageLayout(
            names, scan.alike,
            tuple(np.array(part, dtype=np.int64) for part in zip(*arrays, strict=True)),
            np.array(after, dtype=np.int64))
    except (struct.error, ValueError):  # cut off, or points that differ
        return None


class _Scan:
    """A walk through a little-endian message, from field to field, that notes what it reads."""

    def __init__(self, data: bytes) -> None:
        """Start behind the encapsulation, from where CDR aligns."""
        self._data = data
        self._at = ENCAPSULATION
        self.alike = np.zeros(len(data), dtype=bool)
        self.alike[:2] = True

    def _take(self, size: int, alignment: int) -> int:
        """Pass `size` bytes and return where they start."""
        first = (self._at - ENCAPSULATION + alignment - 1 & -alignment) + ENCAPSULATION
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
        return (self._take(8, 4) - ENCAPSULATION) // 4

    def numbers(self) -> range:
        """Return where the numbers of an array stand, in eights of bytes."""
        size = self.count()
        first = (self._take(8 * size, 8) - ENCAPSULATION) // 8 if size else 0
        return range(first, first + size)


class JointStateTemplate:
    """A serialised JointState whose stamp and numbers are written over, again and again."""

    def __init__(self, data: bytes | memoryview) -> None:
        """Take a little-endian message; its numbers do not matter.

        Raises:
            ValueError: another message, or one that is cut off.
        """
        layout = joint_state_layout(bytes(data))
        if layout is None:
            raise ValueError('expected a whole little-endian JointState')
        self._data = bytearray(data)
        numbers = np.frombuffer(self._data, '<f8', (len(data) - ENCAPSULATION) // 8,
                                ENCAPSULATION)
        self._arrays = [numbers[at[0]:at[-1] + 1] if len(at) else np.empty(0)
                        for at, in layout.arrays]

    def filled(self, stamp: int, parts: Sequence[ArrayLike]) -> bytes:
        """Return the message stamped `stamp`, ns, with its position, velocity and effort."""
        struct.pack_into('<iI', self._data, ENCAPSULATION, *divmod(stamp, SECOND))
        for array, part in zip(self._arrays, parts, strict=True):
            array[:] = part
        return bytes(self._data)
