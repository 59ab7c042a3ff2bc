"""Benches of any number of processes never share a ROS domain."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from node_bench import DOMAINS, Domain

FIRST = 17


def test_domains_that_are_held_at_once_differ_and_keep_their_ports_below_the_ephemeral():
    held = [Domain(FIRST) for _ in range(40)]
    try:
        numbers = [domain.number for domain in held]
        assert len(set(numbers)) == len(held)
        assert min(numbers) >= 1
        # the ports of a domain begin at 7400 + 250 n, the ephemeral ports of Linux at 32768
        assert max(numbers) <= DOMAINS
        assert 7400 + 250 * (DOMAINS + 1) <= 32768
    finally:
        for domain in held:
            domain.leave()


def test_another_process_gets_another_domain():
    code = f'from node_bench import Domain; print(Domain({FIRST}).number)'
    held = [Domain(FIRST) for _ in range(3)]
    try:
        told = subprocess.run([sys.executable, '-c', code], cwd=Path(__file__).parent,
                              capture_output=True, text=True, check=True)
        assert int(told.stdout) not in {domain.number for domain in held}
    finally:
        for domain in held:
            domain.leave()


def test_a_domain_that_was_left_is_taken_again():
    """Else the last of these would find none."""
    left = []
    for _ in range(DOMAINS + 1):
        left.append(Domain(FIRST))
        left[-1].leave()
    assert len({domain.number for domain in left}) < len(left)
