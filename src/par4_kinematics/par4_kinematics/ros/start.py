"""How a node begins: its modules take seconds to load, in which a signal must end it quietly."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path


def start_node(module: str) -> int:
    """Load the module of a node and run its `main`; return the exit code.

    SIGINT and SIGTERM end the process at once while it loads: there is nothing to complete yet.
    `--version` needs no loading.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    if '--version' in sys.argv[1:]:
        print(f'{Path(sys.argv[0]).name}, version {version(module.partition(".")[0])}')
        return 0
    return import_module(module).main()
