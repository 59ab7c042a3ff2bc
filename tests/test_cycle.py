"""The length of the cycle of a motion that repeats itself, and of one that does not."""

from __future__ import annotations

import numpy as np
import pytest
from measured import excitation

from par4_identification.diagnosis.verdict.cycle import cycle_of


def there_and_back(count: int, length: float) -> np.ndarray:
    """Return samples of a move there, a dwell, a move back and a dwell, in cycles of any length."""
    phase = np.arange(count) / length % 1.0
    ramp = np.clip(phase / 0.3, 0.0, 1.0) - np.clip((phase - 0.5) / 0.3, 0.0, 1.0)
    return ramp ** 2 * (3.0 - 2.0 * ramp)


@pytest.mark.parametrize('length', [209.0, 249.6, 333.37])
@pytest.mark.parametrize('rest', [0, 400])
def test_the_cycle_of_a_production_machine_is_told_in_parts_of_a_sample(length, rest):
    q = np.concatenate((np.zeros(rest), there_and_back(6000, length)))
    q = np.concatenate((q, np.full(rest, q[-1])))
    assert cycle_of(q) == pytest.approx(length, abs=0.02)


def test_counts_and_a_first_cycle_of_its_own_change_nothing():
    q = np.round(there_and_back(6000, 249.6), 2)
    q[:250] *= 0.8
    assert cycle_of(q) == pytest.approx(249.6, abs=0.1)


def test_a_wave_has_its_period_and_its_sum_with_another_the_common_one():
    time = np.arange(5000)
    slow, fast = np.sin(2.0 * np.pi * time / 300.0), np.sin(2.0 * np.pi * time / 200.0)
    assert cycle_of(fast) == pytest.approx(200.0, abs=0.02)
    assert cycle_of(slow + fast) == pytest.approx(600.0, abs=0.02)


@pytest.mark.parametrize('q', [
    np.zeros(4000), np.linspace(0.0, 1.0, 4000), there_and_back(600, 209.0), np.zeros(1),
    np.random.default_rng(0).normal(size=4000).cumsum()])
def test_rest_one_way_too_few_cycles_and_chance_have_none(q):
    assert cycle_of(q) is None


@pytest.mark.parametrize('seed', range(5))
def test_an_excitation_drawn_at_random_has_none(seed):
    q = excitation('reference', 20.0, seed).q
    assert [cycle_of(q[::4, joint]) for joint in range(4)] == [None] * 4
