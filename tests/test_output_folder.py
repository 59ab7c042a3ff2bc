"""Commands that write into one folder at a time: the files of two runs are never mixed."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
from threading import Event, Thread

import pytest

from par4_kinematics.files import alone_in
from par4_sim.report.results import results_into, write_results

NAMES = ('a.json', 'b.yaml', 'c.html')


def written_by(run):
    """Return the results of a run, each of which holds its name."""
    return dict.fromkeys(NAMES, run)


def found_in(folder):
    """Return the content of every file of a folder, hidden ones too."""
    return {file.name: file.read_text() for file in folder.iterdir()}


def test_two_runs_that_write_at_once_leave_the_results_of_one(tmp_path, monkeypatch):
    """The second begins as the first has put one of its files in place, and goes as far as it can:
    to its end, or to where it waits for the first.
    """
    here, far_enough, lock, put = Event(), Event(), fcntl.flock, os.replace

    def second():
        write_results(tmp_path, written_by('second'))
        far_enough.set()

    other = Thread(target=second)

    def locking(*arguments):
        if here.is_set():
            far_enough.set()
        lock(*arguments)

    def putting(*arguments):
        put(*arguments)
        if not here.is_set():
            here.set()
            other.start()
            assert far_enough.wait(60.0)

    monkeypatch.setattr('fcntl.flock', locking)
    monkeypatch.setattr('os.replace', putting)
    write_results(tmp_path, written_by('first'))
    other.join(60.0)
    assert found_in(tmp_path) == written_by('second')


def test_a_run_that_was_killed_as_it_wrote_blocks_no_later_one(tmp_path):
    killed = subprocess.run([sys.executable, '-c', f"""
import os, signal
from par4_kinematics.files import alone_in
with alone_in({str(tmp_path)!r}):
    os.kill(os.getpid(), signal.SIGKILL)
"""], check=False, timeout=100)
    assert killed.returncode == -signal.SIGKILL
    assert os.listdir(tmp_path) == []
    write_results(tmp_path, written_by('next'))
    assert found_in(tmp_path) == written_by('next')


def test_ctrl_c_waits_until_all_results_are_in_place(tmp_path, monkeypatch):
    write_results(tmp_path, written_by('before'))
    put = os.replace

    def interrupted(*arguments):
        put(*arguments)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr('os.replace', interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_results(tmp_path, written_by('now'))
    assert found_in(tmp_path) == written_by('now')


@pytest.mark.parametrize('lock', ['flock', 'open'])
def test_results_are_written_where_a_folder_cannot_be_locked(lock, tmp_path, monkeypatch):
    """As on network drives, and in folders that may be written and not be read."""
    def refuse(*_):
        raise OSError(9, 'Bad file descriptor')

    monkeypatch.setattr({'flock': 'fcntl.flock', 'open': 'os.open'}[lock], refuse)
    with alone_in(tmp_path / 'new'):
        monkeypatch.undo()
        (tmp_path / 'new' / 'file').write_text('new')
    assert found_in(tmp_path / 'new') == {'file': 'new'}


def test_a_folder_in_which_nothing_was_written_is_not_left(tmp_path):
    with pytest.raises(ValueError, match='midway'), results_into(tmp_path / 'new' / 'folder'):
        raise ValueError('midway')
    assert os.listdir(tmp_path) == []
