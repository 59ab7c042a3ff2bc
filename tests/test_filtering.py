"""Filters: what scipy makes of the same signal, and only the rows asked for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import binary_dilation
from scipy.signal import butter, sosfiltfilt

from par4_identification.logs.masks import near
from par4_identification.signals.filtering import AT_ONCE, low_pass

PERIOD = 1e-3


@pytest.mark.parametrize(('samples', 'cutoff', 'order'), [
    (5000, 40.0, 4), (5000, 160.0, 8), (60, 3.0, 4), (900, 499.0, 2)])
def test_low_pass_is_scipys(samples, cutoff, order):
    random = np.random.default_rng(samples)
    values = 100.0 + np.cumsum(random.normal(size=(samples, 2, 3)), axis=0)
    padding = int(min(3 * samples // 4, 3.0 / (cutoff * PERIOD)))
    wanted = sosfiltfilt(butter(order, cutoff, fs=1.0 / PERIOD, output='sos'), values, axis=0,
                         padlen=padding)
    np.testing.assert_allclose(low_pass(values, cutoff, PERIOD, order), wanted, rtol=1e-10)


@pytest.mark.parametrize('part', [slice(None), slice(7, -7, 10), slice(0, 1), slice(5, 5)])
def test_low_pass_returns_the_rows_asked_for(part):
    values = np.random.default_rng(1).normal(size=(300, 4))
    np.testing.assert_array_equal(low_pass(values, 40.0, PERIOD, rows=part),
                                  low_pass(values, 40.0, PERIOD)[part])


@pytest.mark.parametrize('shape', [(), (1,), (4,), (4, 3)])
def test_low_pass_filters_each_column_on_its_own(shape):
    """Whatever stands beside a column and however it lies in memory, to the last bit."""
    values = np.random.default_rng(len(shape)).normal(size=(200, *shape))
    filtered = low_pass(values, 40.0, PERIOD)
    for column in np.ndindex(shape):
        np.testing.assert_array_equal(low_pass(values[(slice(None), *column)], 40.0, PERIOD),
                                      filtered[(slice(None), *column)])
    np.testing.assert_array_equal(low_pass(np.asfortranarray(values), 40.0, PERIOD), filtered)


def test_low_pass_leaves_its_input_alone():
    values = np.random.default_rng(2).normal(size=(300, 4))
    before = values.copy()
    filtered = low_pass(values, 40.0, PERIOD)
    np.testing.assert_array_equal(values, before)
    assert filtered.flags.c_contiguous
    assert not np.shares_memory(filtered, values)


@pytest.mark.parametrize('reach', [0, 1, 23, 400])
def test_near_widens_a_mask_to_both_sides(reach):
    random = np.random.default_rng(reach)
    for share in (0.0, 0.001, 0.05, 1.0):
        mask = random.random((300, 2)) < share
        wanted = binary_dilation(mask, np.ones((2 * reach + 1, 1), dtype=bool))
        np.testing.assert_array_equal(near(mask, reach), wanted)


def test_many_columns_are_filtered_as_one_is():
    """They are filtered some at a time."""
    values = np.random.default_rng(9).normal(size=(150, 2 * AT_ONCE + 3))
    filtered = low_pass(values, 40.0, PERIOD, rows=slice(3, -3, 7))
    np.testing.assert_array_equal(filtered[:, -1],
                                  low_pass(values[:, -1], 40.0, PERIOD)[3:-3:7])


def test_a_filter_that_forgets_meets_no_denormal_numbers():
    """They take many times as long."""
    values = np.zeros((20000, 1))
    values[0] = 1.0
    left = np.abs(low_pass(values, 40.0, PERIOD)[10000:])
    assert np.all((left > np.finfo(float).tiny) & (left < 1e-150))
