"""What commands say, and what becomes of it where it cannot be written."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, TextIO


class Output(io.FileIO):
    """A stream that takes everything: what cannot be written is dropped.

    So a command completes its results whether or not somebody reads what it says of them.

    Attributes:
        trouble: why something was dropped, None where it was not or where only the reader has
            gone, as `head` does when it has seen enough.
    """

    trouble: OSError | None = None

    def write(self, data: Any) -> int:
        """Write bytes and return how many were taken."""
        try:
            return super().write(data)
        except BrokenPipeError:
            pass
        except OSError as error:
            self.trouble = error
        return memoryview(data).nbytes


@contextmanager
def dropping() -> Iterator[Output | None]:
    """Let neither standard output nor standard error fail in this block; yield the former.

    None where it is no stream of the operating system. Characters that the encoding of the terminal
    or the file does not have become question marks.
    """
    out, err, output = sys.stdout, sys.stderr, None
    if err is sys.__stderr__ and err is not None:  # None where the caller has closed it
        sys.stderr = _text(Output(err.fileno(), 'w', closefd=False), err, True, err.errors)
    if out is sys.__stdout__ and out is not None:
        output = Output(out.fileno(), 'w', closefd=False)
        sys.stdout = _text(output, out, out.isatty(), 'replace')
    try:
        yield output
    finally:
        print(end='', flush=True)
        print(end='', flush=True, file=sys.stderr)
        sys.stdout, sys.stderr = out, err


def _text(output: Output, like: TextIO, by_line: bool, errors: str | None) -> TextIO:
    return io.TextIOWrapper(io.BufferedWriter(output), like.encoding, errors,
                            line_buffering=by_line)
