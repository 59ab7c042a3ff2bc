"""Signals that wait while processes are started, so that none is interrupted as it begins.

A terminal sends Ctrl-C to a process and to all that it has started. A Python that has not come to
our lines yet answers with a traceback.
"""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_back(*numbers: signal.Signals) -> Iterator[None]:
    """Hold signals back in this block, for this process and for good in those that it starts.

    This process gets them when the block ends. A process that was started in it gets none until
    it unblocks them, as executables of this project do (`par4_start`). Where `multiprocessing`
    starts them, its resource tracker must run already, which lets signals through as it begins.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
