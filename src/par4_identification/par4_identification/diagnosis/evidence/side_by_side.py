"""Independent computations on all processors of this machine."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

MOST = 4
"""Threads: each holds the columns that it computes."""
Item = TypeVar('Item')
Result = TypeVar('Result')


def side_by_side(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return the function of each item, in their order.

    Compiled kernels and numpy let other threads run while they compute. What the function returns
    may be kept by it, but must not depend on which item comes first.
    """
    count = min(MOST, threads_of_process())
    if count == 1:
        return list(map(function, items))
    with ThreadPoolExecutor(count) as threads:
        return list(threads.map(function, items))


def plain_linear_algebra() -> AbstractContextManager[object]:
    """Return a context in which linear algebra has one thread, in this whole process.

    Its matrices are small here. Threads of its own beside those of `side_by_side` wait for each
    other: 60 s of log took 11.6 s instead of 9.9 s.
    """
    return _libraries().limit(limits=1)


@cache
def _libraries() -> ThreadpoolController:
    return ThreadpoolController()


def threads_of_process() -> int:
    """Return how many threads may compute: `OMP_NUM_THREADS`, or the processors of this process.

    Libraries of linear algebra follow the same variable, and dask sets it for its workers, of which
    each has one processor.
    """
    asked = os.environ.get('OMP_NUM_THREADS', '')
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    return processors()


def processors() -> int:
    """Return how many processors of this machine this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
