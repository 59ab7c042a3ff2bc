"""The first lines of every executable: from here on Ctrl-C ends it without a traceback.

It stands outside of the packages and imports next to nothing, because importing a package already
takes time in which a signal may come. What comes before these lines is Python's own start.
"""

import os
import signal
import sys
from types import FrameType

STOPPED = 130
"""Exit code of an offline tool that was interrupted, as shells count it."""
MOMENT = 1e-3
"""Seconds."""
ENDED = 0
"""Exit code of a node that was ended by a signal, which is how nodes end."""


def end_quietly(code: int, *numbers: signal.Signals) -> None:
    """Let signals end this process at once and without a word.

    For times at which there is nothing to complete: before the work begins and after it is done.
    No exception is raised, because modules that are being loaded turn an interrupt into errors of
    their own or swallow it.
    """
    def end(_number: int, _frame: FrameType | None) -> None:
        os._exit(code)

    for number in numbers:
        signal.signal(number, end)


def tool_ends_quietly() -> None:
    """Let Ctrl-C end an offline tool at once, unless it runs where Ctrl-C is not for it."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # as of a shell's background jobs
        end_quietly(STOPPED, signal.SIGINT)


def tool_is_interrupted() -> None:
    """Let Ctrl-C raise KeyboardInterrupt, unless it is not for this tool."""
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def asked_for(option: str) -> bool:
    """Return whether the command line has an option, `--option` or `--option=value`."""
    return any(word.partition('=')[0] == option for word in sys.argv[1:])


def _interrupt_again(ignored: 'sys.UnraisableHookArgs') -> None:
    """Let an interrupt come again in a moment where Python has ignored the exception it raised.

    That is so while an object is released, or in a function that C calls.
    """
    if ignored.exc_type is KeyboardInterrupt:
        signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
        signal.setitimer(signal.ITIMER_REAL, MOMENT)
    else:
        sys.__unraisablehook__(ignored)


class Tool:
    """The life of an offline tool, from its first line to its last.

    What it does on an interrupt while it works is said in `par4_sim.commands.entry`.
    """

    def __enter__(self) -> None:
        tool_ends_quietly()
        sys.unraisablehook = _interrupt_again
        _take_signals()

    def __exit__(self, *_: object) -> None:
        tool_ends_quietly()  # a second Ctrl-C does not interrupt how Python ends


def node_starts() -> None:
    """Call this first in a node, which answers signals itself as soon as it is loaded."""
    end_quietly(ENDED, signal.SIGINT, signal.SIGTERM)
    _take_signals()


def _take_signals() -> None:
    """Take the signals that `par4_cell` held back while this process began."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, (signal.SIGINT, signal.SIGTERM))
