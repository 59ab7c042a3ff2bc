"""Independent computations on all processors of this machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

MOST = 4
"""Threads: each holds the columns that it computes."""
Item = TypeVar('Item')
Result = TypeVar('Result')


def side_by_side(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return the function of each item, in their order.

    Compiled kernels and numpy let other threads run while they compute. What the function returns
    may be kept by it, but must not depend on which item comes first.
    """
    processors = len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else 1
    with ThreadPoolExecutor(min(MOST, processors)) as threads:
        return list(threads.map(function, items))
