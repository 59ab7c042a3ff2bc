"""How a node begins: its modules take seconds to load, in which a signal must end it quietly."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from par4_kinematics.ros.parameters import NodeParameters, answered


def start_node(module: str, parameters: type[NodeParameters]) -> int:
    """Load the module of a node and run its `main`; return the exit code.

    SIGINT and SIGTERM end the process at once while it loads: there is nothing to complete yet.
    `--version`, `--help` and `--config` need no loading.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: os._exit(0))
    if '--version' in sys.argv[1:]:
        print(f'{Path(sys.argv[0]).name}, version {version(module.partition(".")[0])}')
        return 0
    mends = any(argument.split('=')[0] == '--repair' for argument in sys.argv[1:])
    if not mends and answered(parameters, sys.argv[1:]):
        return 0
    return import_module(module).main()
