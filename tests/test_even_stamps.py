"""Readings that were taken evenly are put back evenly, whatever their stamps, and losses are seen.
"""

from __future__ import annotations

import numpy as np
import pytest
from axes import axis
from foreign import COULOMB, INERTIA, VISCOUS, read, swings, torque_of

from par4_identification.fitting.identification import identify
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import conditioning_for


def values_of(log):
    check = check_setup([log], axis())
    assert not check.findings
    logs = list(check.logs)
    return identify(logs, axis(), conditioning=conditioning_for(
        logs, axis(), Conditioning())).estimate.values


def coarse(t, step=2.0 ** -10):
    """Return times as 32-bit numbers tell them some hours after they began."""
    return np.round(t / step) * step


def lost(count, samples, seed=0):
    """Return the rows that are left where some samples were lost, each by itself."""
    return np.setdiff1d(np.arange(count), np.random.default_rng(seed).choice(
        np.arange(500, count - 500), samples, replace=False))


@pytest.mark.parametrize('missing', [0, 12])
def test_times_in_steps_of_a_period_lose_no_sample(tmp_path, missing):
    """In steps of 0.98 ms, those of 1 kHz are a step or two apart; inertia was a third of its own.
    """
    t, q, qd, qdd = swings(30.0)
    rows = lost(len(t), missing)
    log = read(tmp_path / 'bag', coarse(t[rows]), q[rows], torque_of(qd, qdd)[rows])
    assert log.period == pytest.approx(1e-3, rel=1e-5)
    assert log.accounts.jitter == pytest.approx(2.0 ** -10 / np.sqrt(12.0), rel=0.1)
    assert log.accounts.position.lost == log.accounts.torque.lost == missing
    assert log.accounts.filled == missing
    np.testing.assert_allclose(values_of(log), (INERTIA, COULOMB, VISCOUS), rtol=0.01)


@pytest.mark.parametrize('missing', [0, 12])
def test_stamps_that_are_late_by_a_fifth_of_their_spacing_are_put_back(tmp_path, missing):
    """Of 9000 some are nearer to the time of the next one; for these none was put back."""
    t, q, qd, qdd = swings(90.0, rate=100.0)
    rows = lost(len(t), missing)
    late = 2e-3 * np.abs(np.random.default_rng(1).standard_normal(len(rows)))
    log = read(tmp_path / 'bag', t[rows] + late, q[rows], torque_of(qd, qdd)[rows])
    assert log.accounts.jitter == pytest.approx(2e-3 * np.sqrt(1.0 - 2.0 / np.pi), rel=0.1)
    assert log.period == pytest.approx(1e-2, rel=1e-4)
    assert log.accounts.position.lost == missing + log.accounts.position.crowded
    np.testing.assert_allclose(values_of(log), (INERTIA, COULOMB, VISCOUS), rtol=0.01)


@pytest.mark.parametrize('share', [0.001, 0.02, 0.2])
def test_losses_under_right_stamps_stay_losses(tmp_path, share):
    t, q, qd, qdd = swings(30.0)
    missing = round(share * len(t))
    rows = lost(len(t), missing, seed=2)
    log = read(tmp_path / 'bag', t[rows], q[rows], torque_of(qd, qdd)[rows])
    assert log.accounts.jitter == 0.0
    assert log.accounts.position.lost == missing
    assert log.period == pytest.approx(1e-3, rel=1e-9)
