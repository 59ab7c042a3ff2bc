"""Signals that wait while processes are started, so that none is interrupted as it begins.

A terminal sends Ctrl-C to a process and to all that it has started. A Python that has not come to
our lines yet answers with a traceback.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def held_back(*numbers: signal.Signals) -> Iterator[None]:
    """Hold signals back in this block, for this process and for good in those that it starts.

    This process gets them when the block ends. A process that was started in it gets none until
    it unblocks them, as executables of this project do (`par4_start`); others are started within
    `passed_on`. Where `multiprocessing` starts them, its resource tracker must run already, which
    lets signals through as it begins.

    The mask is that of this thread; the system may hand a signal to another one that libraries
    have started. Python then runs the handler here all the same, so that it is replaced by one
    that notes the signal. Outside of the main thread, where Python runs none, that is not needed.
    """
    noted: set[int] = set()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, numbers)
    handlers = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: handler for number in numbers
                    if callable(handler := signal.getsignal(number))}
        for number in handlers:
            signal.signal(number, lambda told, _: noted.add(told))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for told in noted:
            signal.raise_signal(told)


@contextmanager
def passed_on(*numbers: signal.Signals) -> Iterator[None]:
    """Start processes in this block, within `held_back`, that do not unblock these signals."""
    before = signal.pthread_sigmask(signal.SIG_UNBLOCK, numbers)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
