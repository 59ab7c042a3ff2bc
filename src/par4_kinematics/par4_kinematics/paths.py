"""Paths as users write them."""

from __future__ import annotations

import os


def at_home(path: str) -> str:
    """Return a path that begins with `~/` as a shell means it.

    Shells expand it at the beginning of a word only, not behind `:=` or `=`: a folder of the name
    `~` would be made.
    """
    return os.path.expanduser(path) if path.startswith('~/') else path


def instead_of_file(path: str | os.PathLike[str]) -> str:
    """Return what is found at a path that should be a file and is none."""
    return 'is a folder' if os.path.isdir(path) else 'no such file'
