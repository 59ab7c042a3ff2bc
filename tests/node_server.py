"""Nodes as processes that are forked from a server which has loaded what they load.

A node takes a second of processor time to import its libraries and to load its kernels. That is
the same each time; so one server does it once (`node_modules`), and every node begins as a copy of
the server.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from importlib import import_module
from multiprocessing.forkserver import ensure_running
from pathlib import Path

MODULES = {
    'par4_kinematics': 'par4_kinematics.ros.kinematics_node',
    'par4_motion': 'par4_kinematics.ros.motion_node',
    'par4_feedforward': 'par4_dynamics.ros.feedforward_node',
    'par4_simulation': 'par4_sim.ros.simulation_node',
    'par4_record': 'par4_identification.ros.record_node',
    'par4_monitor': 'par4_identification.ros.monitor_node',
}
"""Node -> module."""
SERVER = multiprocessing.get_context('forkserver')


class ForkedNode:
    """A node in a process of its own, with what tests use of `subprocess.Popen`.

    Args:
        module: of the node.
        arguments: of its command line.
        environment: the whole of it.
        folder: where it works.
        output: file for what it prints.
    """

    def __init__(self, module: str, arguments: Sequence[str], environment: dict[str, str],
                 folder: Path, output: Path) -> None:
        _start_server()
        self._process = SERVER.Process(
            target=_run, args=(module, list(arguments), environment, folder, output), daemon=True)
        self._process.start()

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Its exit code, less than zero after a signal that ended it; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """Return `returncode`."""
        return self.returncode

    def wait(self, timeout: float | None = None) -> int | None:
        """Wait for its end and return the exit code.

        Raises:
            subprocess.TimeoutExpired: it has not ended in `timeout`, s.
        """
        self._process.join(timeout)
        if self.returncode is None:
            raise subprocess.TimeoutExpired('node', timeout or 0.0)
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send it a signal if it runs."""
        if self.returncode is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        """Ask it to end."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def _start_server() -> None:
    """Start the server unless it runs; it finds `node_modules` by PYTHONPATH alone."""
    SERVER.set_forkserver_preload(['node_modules'])
    before = os.environ.get('PYTHONPATH')
    os.environ['PYTHONPATH'] = os.pathsep.join(
        [str(Path(__file__).parent), *([before] if before else [])])
    try:
        ensure_running()
    finally:
        if before is None:
            del os.environ['PYTHONPATH']
        else:
            os.environ['PYTHONPATH'] = before


def _run(module: str, arguments: list[str], environment: dict[str, str], folder: Path,
         output: Path) -> None:
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    told = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    for stream in (1, 2):
        os.dup2(told, stream)
    sys.argv = [module, *arguments]
    sys.exit(import_module(module).main())
