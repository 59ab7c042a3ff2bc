"""Fixtures that several test modules use; two processes run the tests, each keeps to one core."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ.setdefault(f'{library}_NUM_THREADS', '1')


@pytest.fixture
def bench(tmp_path, monkeypatch) -> Iterator[Any]:
    """Yield a `node_bench.Bench`; ROS is loaded for the tests that ask for one only."""
    from node_bench import Bench

    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    bench = Bench(tmp_path)
    yield bench
    bench.close()
