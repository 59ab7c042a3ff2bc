"""The rigid-body engine pybullet, imported without its announcement; the only file that does."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def _silent_stderr() -> Iterator[None]:
    kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


with _silent_stderr():  # its import announces from C when it was built
    import pybullet as pybullet  # for those who use it from here


def load_body(urdf: str, client: int, fixed: bool) -> int:
    """Return the body of a URDF text; the engine reads files only."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'body.urdf'
        path.write_text(urdf, encoding='utf-8')
        return pybullet.loadURDF(str(path), useFixedBase=fixed,
                                 flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
                                 physicsClientId=client)
