"""The end of a node's process, whatever fails on the way."""

from __future__ import annotations

import signal
from collections import Counter
from functools import partial
from threading import Lock
from unittest import mock

import pytest

from par4_kinematics.errors import InputError, UnreachableError
from par4_kinematics.interface import REFERENCE
from par4_kinematics.ros import process
from par4_kinematics.ros.arrivals import Inputs
from par4_kinematics.ros.node import Par4Node


@pytest.fixture(autouse=True)
def without_ros(monkeypatch):
    """Take the middleware away, and give the handlers of signals back."""
    for name in ('_initialise', 'tell_unknown_overrides', 'tell_files_of_others'):
        monkeypatch.setattr(process, name, mock.Mock())
    monkeypatch.setattr(process.gc, 'freeze', mock.Mock())
    before = {number: signal.getsignal(number) for number in process.SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def test_two_threads_count_one_behind_the_other():
    """The thread of the physics rejects references while that of the callbacks rejects messages."""
    lock = Lock()

    class Watched(Counter):
        def __setitem__(self, name, count):
            assert lock.locked()  # from the reading of the count to its writing
            super().__setitem__(name, count)

        def __getitem__(self, name):
            assert lock.locked()
            return super().__getitem__(name)

        def keys(self):  # of whoever copies them
            assert lock.locked()
            return super().keys()

    node = mock.Mock(counts=Watched(), _counting=lock, _arrivals=Inputs())
    node.count = partial(Par4Node.count, node)
    for error in (InputError('one'), InputError('two'), UnreachableError('three')):
        Par4Node.reject(node, REFERENCE, error)
    assert Par4Node.faults(node) == {'rejected_messages': 2, 'unreachable_poses': 1}
    assert not lock.locked()


def test_what_a_node_began_is_ended_even_if_its_last_work_fails(monkeypatch):
    """As that of a recorder does whose disk is full."""
    shutdown, node = mock.Mock(), mock.Mock()
    monkeypatch.setattr(process, 'try_shutdown', shutdown)
    node.close.side_effect = OSError('no space left')
    with pytest.raises(OSError, match='no space'), process._running(lambda: node):
        pass
    assert node.finished
    node.destroy_node.assert_called_once()
    shutdown.assert_called_once()
    assert {signal.getsignal(number) for number in process.SIGNALS} == {signal.SIG_IGN}
