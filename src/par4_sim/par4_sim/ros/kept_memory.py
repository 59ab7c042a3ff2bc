"""Memory that a process keeps, so that a large message is taken without asking the system for it.

glibc gives large blocks back to the system when they are freed, and the system fills each page of
a new one with zeros when it is touched. For 10^5 points, 13.6 MB, that is seven eighths of the time
in which rclpy copies the message, and rclpy holds every thread of Python meanwhile.
"""

from __future__ import annotations

import ctypes

LARGEST = 16 << 20
"""Bytes of a message for which memory is kept: a little more than those of 10^5 points."""
COPIES = 2
"""How many copies of a message rclpy has at a time: of the middleware, and for Python."""
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of mallopt(3)


def keep_memory() -> None:
    """Let the heap of this thread have, and keep, what the largest messages take.

    Only glibc offers that; elsewhere nothing is done.
    """
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)
    if mallopt is None:
        return
    mallopt(_MMAP_THRESHOLD, 2 * LARGEST)  # the most that it takes
    mallopt(_TRIM_THRESHOLD, 4 * COPIES * LARGEST)
    _ = [bytearray(LARGEST) for _ in range(COPIES)]  # touched, then free, but not given back
