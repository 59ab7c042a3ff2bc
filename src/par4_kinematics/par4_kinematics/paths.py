"""Paths as users write them, and whether results can be written there."""

from __future__ import annotations

import os
from errno import ELOOP
from pathlib import Path
from tempfile import TemporaryFile

from par4_kinematics.errors import InputError


def at_home(path: str) -> str:
    """Return a path that begins with `~/` as a shell means it.

    Shells expand it at the beginning of a word only, not behind `:=` or `=`: a folder of the name
    `~` would be made.
    """
    return os.path.expanduser(path) if path.startswith('~/') else path


def instead_of_file(path: str | os.PathLike[str]) -> str:
    """Return what is found at a path that should be a file and is none."""
    return 'is a folder' if os.path.isdir(path) else 'no such file'


def refuse_loop(place: Path) -> None:
    """See that a path of `os.path.realpath` leads somewhere: only of a loop a link is left in it.

    Raises:
        OSError: it does not.
    """
    if any(path.is_symlink() for path in (place, *place.parents)):
        raise OSError(ELOOP, os.strerror(ELOOP))


def refuse_unwritable(folder: Path, asked: str = '--output') -> None:
    """See that results can be written to a folder, which need not exist, before any long work.

    Args:
        folder: to write to.
        asked: the option or argument that names it.

    Raises:
        InputError: they cannot, or the folder is a bag.
    """
    try:
        is_bag = (folder / 'metadata.yaml').exists()
        place = Path(os.path.realpath(folder))
        refuse_loop(place)
        there = next(path for path in (place, *place.parents) if path.exists())
        with TemporaryFile(dir=there):
            pass
    except (OSError, ValueError) as error:  # ValueError: not even a name
        reason = getattr(error, 'strerror', None) or str(error)
        raise InputError(f'{folder}: results cannot be written there ({reason.lower()}); give '
                         f'another folder as {asked}') from error
    if is_bag:
        raise InputError(f'{folder}: is a bag, whose folder is for its messages alone; give '
                         f'another folder as {asked}')
