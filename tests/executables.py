"""The executables that are installed, and where each begins."""

from __future__ import annotations

from importlib.metadata import entry_points
from importlib.util import find_spec

SCRIPTS = {script.name: script for script in entry_points(group='console_scripts')
           if script.name.startswith('par4_')}


def _command_module(name: str) -> str:
    script = SCRIPTS[name]
    return f'{script.module.removesuffix("_start")}.commands.{script.attr}'


TOOLS = {name: _command_module(name) for name in sorted(SCRIPTS)
         if find_spec(_command_module(name).rpartition('.')[0])
         and find_spec(_command_module(name))}
"""Offline tool -> module of its command line."""
NODES = tuple(sorted(SCRIPTS.keys() - TOOLS))
