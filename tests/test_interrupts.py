"""Ctrl-C at any place of the loading of an executable: an exit code and no traceback."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from executables import SCRIPTS, TOOLS

ARGUMENTS = {
    'par4_bag': 'nope.csv --columns time=t:s --robot reference --output out',
    'par4_cell': 'cell motion:=adept',
    'par4_diagnose': 'nope --robot reference --output out',
    'par4_drive_gain': 'push=push.csv --robot reference --output out',
    'par4_excite': '--robot reference --output out.yaml',
    'par4_fastest': 'adept --feedforward table1 --output out',
    'par4_identify': 'nope --robot reference --output out',
    'par4_push': '--output out',
    'par4_simplification': '--robot reference --model table1 --output out',
    'par4_simulate': 'adept --output out',
    'par4_track': 'adept --output out',
    'par4_trend': 'nope --robot reference --output out',
    'par4_validate': 'nope --robot reference --model table1 --output out',
}
"""What each tool is asked for, so that it loads what it works with."""


def interrupted(name: str, imports: int, folder: Path, arguments: str | None = None
                ) -> subprocess.CompletedProcess[str]:
    """Run an executable that SIGINT reaches as it imports for the n-th time.

    So the place does not depend on how fast the machine is.
    """
    script = SCRIPTS[name]
    words = (ARGUMENTS.get(name, '') if arguments is None else arguments).split()
    code = f"""
import os, signal, sys
from {script.module} import {script.attr} as start
count = 0
def strike(event, _):
    global count
    if event == 'import':
        count += 1
        if count == {imports}:
            os.kill(os.getpid(), signal.SIGINT)
sys.addaudithook(strike)
sys.argv = {[name, *words]!r}
sys.exit(start())
"""
    return subprocess.run([sys.executable, '-c', code], cwd=folder, capture_output=True, text=True,
                          check=False, timeout=200)


def test_every_tool_is_interrupted():
    assert ARGUMENTS.keys() == TOOLS.keys()


@pytest.mark.parametrize(('name', 'imports'), [
    *((name, 1) for name in SCRIPTS), ('par4_record', 40),
    *((name, 150) for name in ('par4_bag', 'par4_simulation')),
    *(('par4_track', number) for number in (20, 400)), ('par4_cell', 30)])
def test_an_interrupt_while_modules_load_ends_an_executable_quietly(name, imports, tmp_path):
    done = interrupted(name, imports, tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (130 if name in TOOLS else 0, '', '')
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('imports', [1, 40, 150])
@pytest.mark.parametrize('asked', ['--repair nope', '--repair=nope'])
def test_an_interrupted_repair_has_not_been_done(asked, imports, tmp_path):
    """The same executable is a node, which ends well when it is interrupted."""
    done = interrupted('par4_record', imports, tmp_path, asked)
    assert (done.returncode, done.stdout, done.stderr) == (130, '', '')


@pytest.mark.parametrize('where', ['told = weakref.ref(Thing(), strike)',
                                   'ctypes.CFUNCTYPE(None)(strike)()'])
def test_an_interrupt_that_python_ignores_comes_again(where, tmp_path):
    """It went on and told of an ignored exception with a traceback."""
    code = f"""
import ctypes, os, signal, sys, weakref
import click
from par4_sim.commands.entry import loading, run
from par4_start import Tool
class Thing:
    pass
@click.command('par4_x')
def command():
    with loading():
        pass
    def strike(*_):
        os.kill(os.getpid(), signal.SIGINT)
    {where}
    while True:  # until the interrupt comes
        pass
sys.argv = ['par4_x']
with Tool():
    run(command)
"""
    done = subprocess.run([sys.executable, '-c', code], cwd=tmp_path, capture_output=True,
                          text=True, check=False, timeout=200)
    assert (done.returncode, done.stdout) == (130, '')
    assert done.stderr.strip() == 'stopped; nothing is half written'


def test_a_node_that_another_signal_must_interrupt_says_so_by_its_exit_code(bench):
    """What it was writing may be incomplete, so that this is no proper end."""
    code = """
import os, signal, sys
from par4_kinematics.ros import process
from par4_kinematics.ros.kinematics_node import KinematicsNode
process.PATIENCE = -1.0
class Stuck(KinematicsNode):
    def end(self):
        pass
    def work(self):
        os.kill(os.getpid(), signal.SIGINT)
        print('asked to end', flush=True)
        os.kill(os.getpid(), signal.SIGINT)
        print('went on', flush=True)
sys.argv = ['par4_kinematics']
sys.exit(process.run(Stuck))
"""
    done = subprocess.run([sys.executable, '-c', code], cwd=bench.folder, env=bench.environment,
                          capture_output=True, text=True, check=False, timeout=200)
    assert (done.returncode, done.stdout) == (130, 'asked to end\n')
    assert 'Traceback' not in done.stderr


def test_signals_while_python_ends_kill_no_node_that_has_ended_well(bench):
    """`ros2 launch` sends several; then it would tell that the process has died."""
    code = """
import os, signal, sys
from par4_kinematics.ros import process
from par4_kinematics.ros.kinematics_node import KinematicsNode
class Brief(KinematicsNode):
    def work(self):
        pass
class Last:  # which is forgotten when Python has no handlers any more
    def __init__(self):
        self.kill, self.number, self.me = os.kill, signal.SIGINT, os.getpid()
    def __del__(self):
        self.kill(self.me, self.number)
sys.argv = ['par4_kinematics']
code = process.run(Brief)
sys.last = Last()
sys.exit(code)
"""
    done = subprocess.run([sys.executable, '-c', code], cwd=bench.folder, env=bench.environment,
                          capture_output=True, text=True, check=False, timeout=200)
    assert (done.returncode, done.stderr) == (0, '')


def test_an_interrupt_while_a_cell_starts_its_nodes_ends_them_all(bench):
    """A terminal sends it to all at once, before the nodes have reached their first lines."""
    code = """
import os, signal, sys
from par4_sim_start import cell
from par4_sim.cell import running_cell
spawn = running_cell.subprocess.Popen
def spawned(*arguments, **options):
    process = spawn(*arguments, **options)
    print(process.pid, flush=True)
    os.killpg(os.getpid(), signal.SIGINT)
    return process
running_cell.subprocess.Popen = spawned
sys.argv = ['par4_cell', 'cell', 'motion:=adept']
cell()
"""
    done = subprocess.run([sys.executable, '-c', code], cwd=bench.folder, env=bench.environment,
                          capture_output=True, text=True, check=False, timeout=200,
                          start_new_session=True)
    assert (done.returncode, done.stderr) == (130, '')
    nodes = [int(line) for line in done.stdout.splitlines()]
    assert len(nodes) == 4
    assert not [number for number in nodes if Path(f'/proc/{number}').exists()]
