"""Cogging that is too quick for the filter but where the joint goes slowly."""

from __future__ import annotations

import numpy as np
import pytest
from axes import axis
from planned import log_of

from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.signals.scales import Chosen, conditioning_for

T = np.arange(0.0, 40.0, 1e-3)
RATES = 2.0 * np.pi * np.array((0.05, 0.13, 0.21))
SIZES = np.array((20.0, 6.0, 3.0))
"""rad: up to some 12 rad/s."""


def wheel(seed, cogging):
    """Return the log of a wheel with an amplitude of cogging, N m, by its periods a turn."""
    waves = SIZES * np.exp(1j * (RATES * T[:, None] + np.random.default_rng(seed).uniform(
        0.0, 2.0 * np.pi, len(RATES))))
    q, qd, qdd = (np.sum(part * waves, axis=1).real for part in (1.0, 1j * RATES, -RATES ** 2))
    tau = 8e-4 * qdd + 0.015 * np.sign(qd) + 8e-4 * qd + sum(
        size * np.sin(order * q + 0.3) for order, size in cogging.items())
    return log_of(axis(), T, q[:, None], tau[:, None], seed, 0.001)


def diagnosed(seed, cogging):
    log = wheel(seed, cogging)
    conditioning = conditioning_for([log], axis(), CONDITIONING, Chosen(cutoff_hz=15.0))
    return diagnose([log], axis(), conditioning=conditioning)


@pytest.mark.parametrize('seed', [1, 2])
def test_an_order_that_passes_the_filter_in_slow_moments_alone_is_found(seed):
    """Errors that are larger for a while were told in its place, or orders that are none."""
    found = diagnosed(seed, {14: 0.012, 42: 0.020})
    assert [cause.effect.name for cause in found.causes] == ['cogging']
    parameters = found.causes[0].parameters
    assert parameters['periods'].value == (14.0, 42.0)
    np.testing.assert_allclose(parameters['amplitude'].value, (0.012, 0.020), rtol=0.05)
    assert found.verdict == 'explained'


def test_no_order_is_found_where_there_is_none():
    found = diagnosed(3, {})
    assert (found.verdict, found.causes) == ('clean', ())
