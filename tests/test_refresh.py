"""Signals that are renewed less often than the log is written are told and used at their changes.
"""

from __future__ import annotations

import numpy as np
import pytest
from axes import axis
from foreign import COULOMB, INERTIA, VISCOUS, read, swings, torque_of

from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.verdict.answer import Unusable
from par4_identification.fitting.identification import identify
from par4_identification.logs.measured import Measured
from par4_identification.logs.refresh import refresh_of
from par4_identification.setup_check.check import check_setup
from par4_identification.signals.conditioning import Conditioning
from par4_identification.signals.scales import conditioning_for

T, Q, QD, QDD = swings()
TAU = torque_of(QD, QDD)


def held(values, every):
    return np.repeat(values[::every], every)[:len(values)]


def identified(log):
    check = check_setup([log], axis())
    assert not check.findings
    logs = list(check.logs)
    return identify(logs, axis(), conditioning=conditioning_for(logs, axis(), Conditioning()))


@pytest.mark.parametrize('signal', ['torque', 'position'])
def test_a_log_is_used_at_the_changes_of_its_slowest_signal(tmp_path, signal):
    """A held torque made viscous friction a half too large; a held position was a dead encoder."""
    q, tau = (Q, held(TAU, 10)) if signal == 'torque' else (held(Q, 10), TAU)
    log = read(tmp_path / 'bag', T, q, tau)
    assert log.period == pytest.approx(0.01)
    np.testing.assert_allclose(log.q[:, 0], Q[10::10], rtol=0, atol=1e-12)
    np.testing.assert_allclose(log.tau[:, 0], TAU[10::10], rtol=0, atol=1e-12)
    said, = log.bag_accounts.of_clocks()
    assert said == (f'the {signal} changes every 10 ms in a log of 1 ms, being held in between; '
                    f'only its changes are used, at 100 Hz; have the {signal} sent as often as the '
                    f'log is written')
    values = identified(log).estimate.values
    np.testing.assert_allclose(values, (INERTIA, COULOMB, VISCOUS), rtol=3e-3)


def test_refreshes_that_come_a_row_early_or_late_are_told_under_uneven_stamps(tmp_path):
    generator = np.random.default_rng(1)
    rows = 10 * np.arange(2000) + generator.integers(-1, 2, 2000)
    newest = rows[np.searchsorted(rows, np.arange(len(T)), 'right').clip(1) - 1].clip(0)
    stamps = T + 1e-4 * generator.standard_normal(len(T))
    log = read(tmp_path / 'bag', stamps, Q, TAU[newest])
    assert log.bag_accounts.held == {'torque': pytest.approx(0.01, rel=0.01)}
    values = identified(log).estimate.values
    np.testing.assert_allclose(values, (INERTIA, COULOMB, VISCOUS), rtol=0.02)


def test_readings_that_stay_in_a_rest_are_readings():
    values = np.concatenate((np.sin(T[:5000]), np.full(777, np.sin(T[4999])), np.sin(T[5000:])))
    refresh = refresh_of(held(values, 10)[:, None])
    assert refresh is not None
    np.testing.assert_array_equal(refresh.rows, 10 * np.arange(1, len(values) // 10 + 1))


def test_held_readings_that_come_out_as_the_last_ones_are_readings(tmp_path):
    """A drive that reads coarsely at 67 Hz held its torque for 15, 30, 45 rows: in no rhythm."""
    coarse = np.round(TAU / 0.8) * 0.8
    values = held(coarse, 15)
    changes = np.diff(np.flatnonzero(np.diff(values)))
    assert np.mean(changes > 15) > 0.25
    refresh = refresh_of(values[:, None])
    assert refresh.every == 15
    first = refresh.rows[0]
    np.testing.assert_array_equal(refresh.rows, np.arange(first, len(T) - 15, 15))
    log = read(tmp_path / 'bag', T, Q, values)
    assert log.period == pytest.approx(0.015)
    found = identified(log).estimate.values
    np.testing.assert_allclose(found, (INERTIA, COULOMB, VISCOUS), rtol=0.1)


def test_many_refreshes_that_fail_to_come_are_missing():
    fails = np.random.default_rng(2).random(len(T) // 10) < 0.2
    rows = 10 * np.flatnonzero(~fails)
    values = Q[rows[np.searchsorted(rows, np.arange(len(T)), 'right').clip(1) - 1]]
    refresh = refresh_of(values[:, None])
    assert refresh.every == 10
    assert np.isin(refresh.rows, rows).mean() > 0.99


def test_times_that_fit_no_rhythm_are_not_held():
    times = np.random.default_rng(3).choice((10, 10, 10, 10, 23, 37), 900)
    rows = np.cumsum(times)
    rows = rows[rows < len(T)]
    values = Q[rows[np.searchsorted(rows, np.arange(len(T)), 'right').clip(1) - 1]]
    assert refresh_of(values[:, None]) is None


def test_a_refresh_that_fails_to_come_is_missing():
    values = held(Q, 10)
    values[500:510] = values[499]
    assert 500 not in refresh_of(values[:, None]).rows


@pytest.mark.parametrize('values', [
    np.round(T / 0.005) * 0.005,  # one count every 5 ms
    np.round(1e3 * np.sin(0.1 * T)), np.round(20.0 * TAU) / 20.0, TAU,
    np.where(np.arange(len(T)) % 500 < 20, held(Q, 20), Q)])
def test_counts_coarse_torques_and_single_stops_are_not_held(values):
    assert refresh_of(values[:, None]) is None


def test_par4_bag_says_what_is_held():
    stamp = np.arange(len(T)) * 1_000_000
    values = {'position': Q[:, None], 'torque': held(TAU, 4)[:, None]}
    found, = Measured('revolute', stamp, values, len(T), 0).findings()
    assert found == ('torque: changes every 4 ms in a log of 1 ms, being held in between; the '
                     'tools use only its changes, at 250 Hz')
    values['torque'][::1000] = np.nan
    assert any('changes every 4 ms' in line
               for line in Measured('revolute', stamp, values, len(T), 0).findings())


def test_held_readings_are_not_said_to_repeat_behind_a_dead_band():
    """A reading in four came out as the last one did; 95 % of the rows repeat as they are held."""
    stamp, last = np.arange(len(T)) * 1_000_000, 0.0
    readings = np.round(TAU[::15] / 0.02) * 0.02
    for i, reading in enumerate(readings):
        last = readings[i] = reading if abs(reading - last) > 0.4 else last
    values = {'position': Q[:, None], 'torque': np.repeat(readings, 15)[:len(T), None]}
    found, = Measured('revolute', stamp, values, len(T), 0).findings()
    assert found == ('torque: changes every 15 ms in a log of 1 ms, being held in between; the '
                     'tools use only its changes, at 66.7 Hz')


def test_a_torque_that_switches_is_not_said_to_repeat_behind_a_dead_band():
    """A force that turns round as the speed does has two values and hardly another."""
    stamp = np.arange(len(T)) * 1_000_000
    torque = 4.0 * np.sign(np.sin(2.0 * np.pi * 2.2 * T + 0.1))
    torque[:20] = 0.0  # before it starts
    values = {'position': Q[:, None], 'torque': torque[:, None]}
    assert Measured('revolute', stamp, values, len(T), 0).findings() == ()


def test_too_few_rows_of_a_slow_log_are_said_to_be_near_reversals(tmp_path):
    t, q, qd, qdd = swings(fastest=4.0, duration=10.0)
    log = read(tmp_path / 'bag', t, held(q, 10), torque_of(qd, qdd))
    answer = diagnose([log], axis(), conditioning=conditioning_for([log], axis(), CONDITIONING))
    assert isinstance(answer, Unusable)
    assert 'or faster: in a log of 100 Hz rows within 0.09 s of a reversal' in answer.reasons[0]


@pytest.mark.parametrize('signal', ['torque', 'position'])
def test_a_signal_of_which_most_cells_are_empty_has_the_rate_of_the_others(tmp_path, signal):
    """As a logger writes it that merges signals of several rates; such logs were refused."""
    q, tau = Q.copy(), TAU.copy()
    (tau if signal == 'torque' else q)[np.arange(len(T)) % 10 != 3] = np.nan
    log = read(tmp_path / 'bag', T, q, tau)
    assert log.period == pytest.approx(0.01)
    np.testing.assert_allclose(log.q[:, 0], Q[3::10], rtol=0, atol=1e-12)
    np.testing.assert_allclose(log.tau[:, 0], TAU[3::10], rtol=0, atol=1e-12)
    assert any('18000 of 20000 samples not finite' in line
               for line in log.bag_accounts.findings())
    np.testing.assert_allclose(identified(log).estimate.values, (INERTIA, COULOMB, VISCOUS),
                               rtol=3e-3)
