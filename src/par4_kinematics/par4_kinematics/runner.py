"""How nodes learn that the process which runs them together has ended without ending them."""

from __future__ import annotations

import os
from collections.abc import Mapping

RUNNER = 'PAR4_RUNNER'
"""Environment variable with the process number of the runner."""


def run_by_this_process(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of nodes that this process runs."""
    return {**environment, RUNNER: str(os.getpid())}


def runner_has_ended() -> bool:
    """Return whether this process has a runner that is its parent no more."""
    return os.environ.get(RUNNER, str(os.getppid())) != str(os.getppid())
