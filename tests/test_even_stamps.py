"""Readings that were taken evenly are put back evenly, whatever their stamps, and losses are seen.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from foreign import COULOMB, INERTIA, VISCOUS, identified, read, swings, torque_of

from par4_identification.logs.column_choice import chosen_columns
from par4_identification.logs.measured_files import measured_of_files
from par4_kinematics.errors import InputError


def coarse(t, step=2.0 ** -10):
    """Return times as 32-bit numbers tell them some hours after they began."""
    return np.round(t / step) * step


def table(folder, time, q, tau):
    """Write a CSV with all digits of 64-bit numbers and return its path."""
    np.savetxt(folder / 'log.csv', np.stack((time.astype(float), q, tau), axis=1), delimiter=',',
               header='t,q,tau', comments='', fmt='%.17g')
    return folder / 'log.csv'


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
    np.testing.assert_allclose(identified(log), (INERTIA, COULOMB, VISCOUS), rtol=0.01)


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
    np.testing.assert_allclose(identified(log), (INERTIA, COULOMB, VISCOUS), rtol=0.01)


@pytest.mark.parametrize('wander', [0.012, 0.03])
def test_positions_that_are_held_are_put_back_without_the_torques_between_them(tmp_path, wander):
    """A drive sends positions every 20 ms, by a clock of its own, into a log of 5 ms.

    Torques at the stamps of positions were moved past those between them (a traceback), and
    positions by more than a period of theirs where one was counted that never came.
    """
    t, q, qd, qdd = swings(30.0, rate=200.0, fastest=0.5)
    sent = 0.02 * np.arange(1490)
    sent = sent + 0.03 + wander * np.sin(2.0 * np.pi * sent / 8.0)
    seen = np.searchsorted(np.ceil(sent / 0.005), np.arange(len(t)), 'right') - 1
    log = read(tmp_path / 'bag', t, np.interp(sent, t, q)[seen.clip(0)], torque_of(qd, qdd))
    assert log.accounts.held == {'position': pytest.approx(0.02)}
    assert log.accounts.jitter < 0.007
    np.testing.assert_allclose(identified(log), (INERTIA, COULOMB, VISCOUS), rtol=0.07)


@pytest.mark.parametrize('share', [0.001, 0.02, 0.2])
def test_losses_under_right_stamps_stay_losses(tmp_path, share):
    t, q, qd, qdd = swings(30.0)
    missing = round(share * len(t))
    rows = lost(len(t), missing, seed=2)
    log = read(tmp_path / 'bag', t[rows], q[rows], torque_of(qd, qdd)[rows])
    assert log.accounts.jitter == 0.0
    assert log.accounts.position.lost == missing
    assert log.period == pytest.approx(1e-3, rel=1e-9)


@pytest.mark.parametrize(('unit', 'start', 'rate', 'told'), [
    ('s', 9000.0, 1000.0, 'steps of 0.977 ms'), ('ms', 2e7, 250.0, 'steps of 2 ms'),
    ('s', 9000.0, 50.0, None), ('s', 1.0, 1000.0, None)])
def test_times_of_32_bits_are_told_where_their_steps_show(tmp_path, unit, start, rate, told):
    t, q, qd, qdd = swings(20.0, rate)
    numbers = (start + t / {'s': 1.0, 'ms': 1e-3}[unit]).astype(np.float32)
    path = table(tmp_path, numbers, q, torque_of(qd, qdd))
    found = [line for line in measured_of_files([path], chosen_columns(
        f'time=t:{unit} position=q:rad torque=tau:Nm')).findings() if '32-bit' in line]
    assert len(found) == (told is not None)
    assert all(told in line and f'give --rate {rate:g}' in line for line in found)


def test_times_that_are_rounded_alone_are_no_numbers_of_32_bits(tmp_path):
    t, q, qd, qdd = swings(20.0, 1000.0)
    path = table(tmp_path, 9000.0 + coarse(t, 1e-3), q, torque_of(qd, qdd))
    assert not any('32-bit' in line for line in measured_of_files([path], chosen_columns(
        'time=t:s position=q:rad torque=tau:Nm')).findings())


def test_times_of_32_bits_that_repeat_are_refused(tmp_path):
    """They were told as two machines on one topic when the bag was read."""
    t, q, qd, qdd = swings(20.0, 500.0)
    path = table(tmp_path, (41000.0 + t).astype(np.float32), q, torque_of(qd, qdd))
    with pytest.raises(InputError) as refused:
        measured_of_files([path], chosen_columns('time=t:s position=q:rad torque=tau:Nm'))
    assert re.fullmatch(
        r'.*log.csv: 48\d\d of 10000 rows have the time of another: the times are 32-bit numbers '
        r'with steps of 3.91 ms; if no row is missing, leave the column of the time out and give '
        r'--rate 500', str(refused.value))
