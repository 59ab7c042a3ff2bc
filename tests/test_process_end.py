"""The end of a node's process, whatever fails on the way."""

from __future__ import annotations

import signal
from unittest import mock

import pytest

from par4_kinematics.ros import process


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
