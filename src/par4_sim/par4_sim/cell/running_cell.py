"""Runs a session of `cell.py` without `ros2 launch`: all parts start, and all parts end.

Where this process is killed, the nodes notice (`par4_kinematics/runner.py`) and end by themselves;
the kernel ends those of ROS.
"""

from __future__ import annotations

import os
import select
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, nullcontext
from pathlib import Path

from par4_kinematics.errors import InputError
from par4_kinematics.held_signals import held_back, passed_on
from par4_kinematics.runner import run_by_this_process
from par4_sim.cell.cell import NodePart, Session, ToolPart, Value

PATIENCE = 20.0
"""Seconds within which a part must end before it is killed."""
END_WITH_US = ('setpriv', '--pdeathsig', 'INT', '--')
"""Before a command line: a program of util-linux by which the kernel ends what follows once the
thread that started it has ended."""
ENDING = (signal.SIGINT, signal.SIGTERM)
"""Signals that are held back while parts start, so that no part is left running unnoticed."""


def executable_path(part: NodePart | ToolPart) -> str:
    """Return the path of an executable: beside this Python, in a colcon workspace, or on PATH.

    Raises:
        InputError: it is in none of them.
    """
    places = [Path(sys.executable).parent,
              *(Path(prefix) / 'lib' / part.package
                for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep) if prefix)]
    found = shutil.which(part.executable, path=os.pathsep.join(map(str, places))) or shutil.which(
        part.executable)
    if found is None:
        raise InputError(f'{part.executable}: not found beside {sys.executable}, in '
                         f'AMENT_PREFIX_PATH or on PATH; install package {part.package}')
    return found


def command_line_of(part: NodePart, session: Session) -> list[str]:
    """Return the command line of a node of a session."""
    bound = END_WITH_US if part.of_ros and shutil.which(END_WITH_US[0]) else ()
    line = [*bound, executable_path(part), '--ros-args']
    for name, value in part.parameters.items():
        if value != '':  # the node has a default
            line += ['-p', f'{name}:={_written(value)}']
    if session.namespace:
        line += ['-r', f'__ns:=/{session.namespace}']
    for topic, other in (*session.remappings, *part.remappings):
        line += ['-r', f'{topic}:={other}']
    return line


def _written(value: Value) -> str:
    """Return a value in YAML, as which ROS reads it: without quotes the bag `2026` is a number."""
    if isinstance(value, str):
        return "'" + value.replace("'", "''") + "'"
    return str(value).lower() if isinstance(value, bool) else str(value)


class RunningCell:
    """The nodes of a session that runs.

    Attributes:
        processes: each node with its process.
    """

    def __init__(self, session: Session, log: Path | None) -> None:
        self._session = session
        self._log = log
        self.processes: list[tuple[NodePart, subprocess.Popen[bytes]]] = []

    def start(self, environment: Mapping[str, str], group: int | None = None) -> None:
        """Start all nodes; `group` 0 gives each a process group of its own, None that of this one.

        Raises:
            InputError: an executable is missing; then none has been started.
        """
        lines = [command_line_of(part, self._session) for part in self._session.nodes]
        with (nullcontext() if self._log is None else self._log.open('ab') as output,
              held_back(*ENDING)):
            for part, line in zip(self._session.nodes, lines, strict=True):
                with passed_on(*ENDING) if part.of_ros else nullcontext():
                    self.processes.append((part, subprocess.Popen(
                        line, stdout=output, stderr=output, env=run_by_this_process(environment),
                        process_group=group)))

    def played(self) -> bool:
        """Return whether the motion has been played to its end.

        Raises:
            InputError: a node has ended that should not, or has failed.
        """
        ended = [(part, process.returncode) for part, process in self.processes
                 if process.poll() is not None]
        for part, code in ended:
            if code != 0 or part is not self._session.player:
                told = '' if self._log is None else f'; {self._log} has what it said'
                raise InputError(f'{part.executable} has ended with exit code {code}, so all have '
                                 f'been ended{told}')
        return bool(ended)

    def wait(self) -> None:
        """Wait until one of the nodes ends; all run, as `played` has found."""
        with ExitStack() as held:
            ends = [os.pidfd_open(process.pid) for _, process in self.processes]
            for end in ends:
                held.callback(os.close, end)
            select.select(ends, (), ())

    def end(self) -> None:
        """End the motion, which brakes while the robot still runs, then all others at a time.

        What does not end is killed. Another Ctrl-C waits until then: none may be left behind.
        """
        with held_back(*ENDING, signal.SIGHUP):
            self._end()

    def _end(self) -> None:
        player = [process for part, process in self.processes if part is self._session.player]
        others = [process for _, process in self.processes if process not in player]
        for group in (player, others):
            for process in group:
                if process.poll() is None:
                    process.send_signal(signal.SIGINT)
            for process in group:
                try:
                    process.wait(timeout=PATIENCE)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


@contextmanager
def running_cell(session: Session, log: Path | None = None,
                 environment: Mapping[str, str] | None = None, group: int | None = None
                 ) -> Iterator[RunningCell]:
    """Run the nodes of a session for as long as the block lasts; then end them all.

    Args:
        session: what runs.
        log: file to which the output of the nodes is added; without one they write to this
            terminal.
        environment: of the nodes; without one that of this process.
        group: see `RunningCell.start`.

    Raises:
        InputError: an executable is missing.
    """
    cell = RunningCell(session, log)
    try:
        cell.start(os.environ if environment is None else environment, group)
        yield cell
    finally:
        cell.end()


def run_session(session: Session, log: Path | None = None) -> int:
    """Run a session to its end; return the exit code of what runs after it, else 0.

    Without a motion it ends by an interrupt only. A terminal's Ctrl-C reaches this process alone,
    so that the motion brakes before the robot ends.

    Raises:
        InputError: a node is missing, has failed, or has ended too early.
        KeyboardInterrupt: it was interrupted; all nodes have ended.
    """
    with running_cell(session, log, group=0) as cell:
        while not cell.played():
            cell.wait()
    if session.then is None:
        return 0
    with held_back(*ENDING):
        process = subprocess.Popen([executable_path(session.then), *session.then.arguments])
    with process:
        try:
            return process.wait()
        except KeyboardInterrupt:
            process.terminate()
            raise
