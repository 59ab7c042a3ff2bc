"""The files of a bag, and whether they are complete."""

from __future__ import annotations

from pathlib import Path

from par4_kinematics.errors import InputError
from par4_sim.choices import repair_command

STORAGE_SUFFIXES = {'.mcap': 'mcap', '.db3': 'sqlite3'}
ZSTD_SUFFIX = '.zstd'


def refuse_incomplete(path: Path) -> None:
    """Refuse a bag that is not there, or whose recorder did not complete it.

    Raises:
        InputError: says how to mend it.
    """
    if not path.exists():
        raise InputError(f'{path}: no such bag; give the folder of a rosbag2, or its .mcap or .db3 '
                         'file')
    files = storage_files(path)
    if path.is_dir() and not (path / 'metadata.yaml').exists():
        raise cut_off(path, 'no metadata.yaml')
    for file in files:
        for log in (Path(f'{file}-journal'), Path(f'{file}-wal')):
            if file.suffix == '.db3' and log.exists() and log.stat().st_size:
                raise cut_off(path, f'{log.name} is left over')


class CutOffError(InputError):
    """A bag that is cut off or damaged, of which `repair_bag` may recover something."""


def cut_off(path: Path, reason: str) -> CutOffError:
    """Return the error that says of a bag that it is cut off or damaged, and what to do."""
    return CutOffError(f'{path}: the bag is cut off or damaged ({reason}); run '
                       f'{repair_command(path)}, unless it is still being recorded')


def storage_files(path: Path) -> list[Path]:
    """Return the storage files of a bag; their order means nothing, messages are sorted by time."""
    candidates = sorted(path.iterdir()) if path.is_dir() else [path]
    files = [file for file in candidates
             if (file.with_suffix('') if file.suffix == ZSTD_SUFFIX else file).suffix
             in STORAGE_SUFFIXES]
    # A bag killed while its file was being compressed holds both; the plain one is complete.
    files = [file for file in files
             if file.suffix != ZSTD_SUFFIX or file.with_suffix('') not in files]
    if not files:
        raise InputError(f'{path}: not a rosbag2; expected a folder with .mcap or .db3 files, or '
                         'one such file; of a CSV, .npz or .mat log par4_bag makes one')
    return files
