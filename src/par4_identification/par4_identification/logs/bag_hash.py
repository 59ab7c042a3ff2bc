"""The hash of a bag, by which a result says what it was computed from."""

from __future__ import annotations

from hashlib import file_digest, sha256
from pathlib import Path


def bag_sha256(path: str | Path) -> str:
    """Return the hash of a bag: that of its file, or that of its files' hashes and names.

    A folder's hash is the one of the output of `sha256sum *` in it.

    Raises:
        OSError: the bag cannot be read.
    """
    path = Path(path)
    files = [path] if path.is_file() else sorted(item for item in path.rglob('*') if item.is_file())
    lines = []
    for file in files:
        with file.open('rb') as stream:
            digest = file_digest(stream, 'sha256').hexdigest()
        lines.append(f'{digest}  {file.relative_to(path)}\n')
    return digest if path.is_file() else sha256(''.join(lines).encode()).hexdigest()
