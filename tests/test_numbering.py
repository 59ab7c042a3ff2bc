"""Lost messages are counted by their numbers, however many publishers share a topic."""

from __future__ import annotations

import numpy as np
import pytest

from par4_kinematics.ros.numbering import REMEMBERED, Numbering


def missing(numbers) -> int:
    numbering = Numbering()
    for number in numbers:
        numbering.take(int(number))
    return numbering.missing


@pytest.mark.parametrize('seed', range(5))
def test_one_publisher_misses_what_is_left_out(seed):
    random = np.random.default_rng(seed)
    kept = np.flatnonzero(random.random(3000) < 0.9) + 1
    assert missing(kept) == kept[-1] - kept[0] + 1 - len(kept)


@pytest.mark.parametrize('starts', [(1, 5_000_000), (5_000_000, 1), (1000, 1020), (1, 1),
                                    (7, 1000, 2_000_000)])
def test_publishers_that_lose_nothing_fake_no_loss(starts):
    """A gripper at 50 Hz beside joints at 1 kHz and others, whatever their numbers begin with."""
    periods = (1, 20, 7)[:len(starts)]
    numbers, ends = [], list(starts)
    for tick in range(4000):
        for publisher, period in enumerate(periods):
            if tick % period == publisher % period:
                numbers.append(ends[publisher])
                ends[publisher] += 1
    assert missing(numbers) == 0


def test_losses_of_one_publisher_are_counted_beside_another():
    numbers = []
    for tick in range(1000):
        if tick % 10:
            numbers.append(5_000_000 + tick)
        if tick % 20 == 0:
            numbers.append(100 + tick // 20)
    assert missing(numbers) == 99  # those before the first received are not known


def test_a_publisher_that_starts_again_is_a_new_one():
    assert missing([*range(1, 500), *range(1, 300)]) == 0
    assert missing([*range(1, 500), *range(1, 300), *range(310, 400)]) == 10


def test_of_many_losses_the_newest_are_remembered_and_all_are_counted():
    """Every second message is lost; in the midst of it another publisher begins."""
    numbering = Numbering()
    for index in range(3 * REMEMBERED):
        numbering.take(2 * index)
        if index == 2 * REMEMBERED:
            numbering.take(10 ** 9)
            numbering.take(2 * index + 1)
    assert len(numbering._holes) == REMEMBERED
    assert numbering.missing == 3 * REMEMBERED - 2
