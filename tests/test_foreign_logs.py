"""Logs as machines of others give them: what is wrong with them is said as what it is."""

from __future__ import annotations

import numpy as np
import pytest
from foreign import axis, log_of, swings, torque_of

from par4_identification.fitting.identification import identify
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.rows import Conditioning
from par4_identification.signals.scales import conditioning_for
from par4_sim.report.words import number

T, Q, QD, QDD = swings()


@pytest.mark.parametrize('lower', [-1.0, -0.85])
def test_a_force_at_its_limit_is_clipped_and_not_held(lower):
    """Friction that turns over ends each stand by a jump, as a held reading does."""
    tau = 95.0 * QDD + 40.0 * QD + 200.0 * np.sign(QD) + 3.0 * np.random.default_rng(
        0).standard_normal(len(T))
    limit = 0.5 * np.abs(tau).max()
    log = log_of(T, Q, np.clip(tau, lower * limit, limit))
    check = check_setup([log], axis(kind='linear'))
    said, = check.findings
    assert said.finding == 'clipped'
    levels = {-1.0: number(limit, 3), -0.85: f'{number(0.85 * limit, 3)} and {number(limit, 3)}'}
    assert f'stands at exactly {levels[lower]} N for' in said.evidence
    at_end = (log.tau == log.tau.min()) | (log.tau == log.tau.max())
    np.testing.assert_array_equal(check.logs[0].doubtful, at_end)
    logs = list(check.logs)
    found = identify(logs, axis(kind='linear'), conditioning=conditioning_for(
        logs, axis(kind='linear'), Conditioning()))
    np.testing.assert_allclose(found.estimate.values, (95.0, 200.0, 40.0), rtol=0.01)


def test_a_torque_in_coarse_steps_is_not_clipped():
    _, q, qd, qdd = swings(seed=3)
    tau = np.round(torque_of(qd, qdd, 0.1) / 2.0) * 2.0
    assert check_setup([log_of(T, q, tau)], axis()).findings == ()
