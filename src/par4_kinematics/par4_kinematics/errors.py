"""The errors a user can cause; each is one line that says what was asked, found, exists, to do."""

import reprlib

LONGEST_LINE = 1000
"""Characters of an error; what it quotes from outside may be of any length."""
_QUOTE = reprlib.Repr()
_QUOTE.maxlevel, _QUOTE.maxstring, _QUOTE.maxother = 3, 120, 120


def quoted(value: object) -> str:
    """Return a value from outside as an error quotes it, short whatever its size."""
    return 'nothing' if value is None else _QUOTE.repr(value)


def one_line(text: str) -> str:
    """Return a text as one line of printable characters, cut in its middle where it is too long."""
    half = (LONGEST_LINE - 5) // 2
    if len(text) > 4 * LONGEST_LINE:  # most of it is never looked at
        text = f'{text[:2 * LONGEST_LINE]} ... {text[-2 * LONGEST_LINE:]}'
    line = ''.join(mark if mark.isprintable() else ascii(mark)[1:-1]
                   for mark in ' '.join(text.split()))
    return line if len(line) <= LONGEST_LINE else f'{line[:half]} ... {line[-half:]}'


NO_CACHE = ('compiled kernels can be kept neither beside the packages nor in the cache of the home '
            'folder; set NUMBA_CACHE_DIR to a folder that can be written')


def is_without_cache(error: RuntimeError) -> bool:
    """Return whether an error is that of numba which `NO_CACHE` says."""
    return 'no locator available' in str(error)


class Par4Error(Exception):
    """Bad input, described in one line fit for a user; base of every error this project raises."""

    def __str__(self) -> str:
        return one_line(super().__str__())


class UnreachableError(Par4Error):
    """Raised for a pose out of reach of a leg, or joint angles that do not close the mechanism."""


class InputError(Par4Error):
    """Raised for a file, parameter or message that breaks the contract."""
