"""How a node begins: what needs no loading is answered at once."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from par4_kinematics.errors import NO_CACHE, is_without_cache
from par4_kinematics.ros.parameters import NodeParameters, answered, tell


def start_node(module: str, parameters: type[NodeParameters]) -> int:
    """Load the module of a node and run its `main`; return the exit code.

    `--version`, `--help` and `--config` need no loading, which takes seconds. What signals do
    meanwhile is said in `par4_start`. A shell that asks for completion, as it may of the offline
    tools, waits for an end: it starts no node.
    """
    name = parameters.NAME
    if os.environ.get(f'_{name.upper()}_COMPLETE'):
        print(f'error: {name}: a node takes ROS parameters and has no completion; see {name} '
              f'--help', file=sys.stderr)
        return 2
    if '--version' in sys.argv[1:]:
        tell(f'{Path(sys.argv[0]).name}, version {version(module.partition(".")[0])}\n')
        return 0
    if answered(parameters, sys.argv[1:]):
        return 0
    try:
        node = import_module(module)
    except RuntimeError as error:
        if not is_without_cache(error):
            raise
        print(f'error: {NO_CACHE}', file=sys.stderr)
        return 2
    return node.main()
