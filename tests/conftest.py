"""Fixtures that several test modules use; of the processes that run them each keeps to one core."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

for library in ('OPENBLAS', 'OMP', 'MKL'):
    os.environ.setdefault(f'{library}_NUM_THREADS', '1')

# as in the Makefile: every process that tests start would compile the modules anew
os.environ.pop('PYTHONDONTWRITEBYTECODE', None)

# arrays are not in cycles: at the usual thresholds the collector takes more than it gives back
gc.set_threshold(20_000, 20, 20)

# the same few examples in every run; `make fuzz` draws others, and many
CALM = {'deadline': None, 'database': None,
        'suppress_health_check': [HealthCheck.too_slow, HealthCheck.data_too_large,
                                  HealthCheck.function_scoped_fixture]}
settings.register_profile('few', max_examples=5, derandomize=True, **CALM)
settings.register_profile('fuzz', max_examples=2000, print_blob=True, **CALM)
settings.load_profile('few')


def pytest_configure() -> None:
    """Hear Ctrl-C, and let children hear it: a script that runs tests with `&` has it ignored."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN:  # under nohup; nodes would ignore it, too
        signal.signal(signal.SIGHUP, lambda *_: None)


@pytest.fixture(autouse=True)
def same_handler() -> Iterator[None]:
    """Take back how a command that a test runs in this process answers Ctrl-C: it may end it."""
    before = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, before)


def pytest_collection_finish() -> None:
    """Spare the garbage collector what stays till the end: modules, tests, compiled kernels.

    Else it goes through all of that again and again while tests run.
    """
    gc.collect()
    gc.freeze()


@pytest.fixture
def unrendered(monkeypatch) -> None:
    """Compose the pictures of reports, but put an empty SVG in the place of each.

    Laying out and writing a picture takes a second. This is for tests of words and numbers; those
    of reports, `check_in_browser`, do without it.
    """
    monkeypatch.setattr('par4_sim.report.drawing.svg_of',
                        lambda _figure: '<svg xmlns="http://www.w3.org/2000/svg"/>')


@pytest.fixture
def bench(tmp_path, monkeypatch) -> Iterator[Any]:
    """Yield a `node_bench.Bench`; ROS is loaded for the tests that ask for one only."""
    from node_bench import Bench

    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    bench = Bench(tmp_path)
    yield bench
    bench.close()
