"""Logs of an axis that hold its speed and no position: the noise of their positions adds up."""

from __future__ import annotations

import numpy as np
import pytest
from axes import axis
from foreign import identified, read, swings, torque_of

from par4_dynamics.model_from_file import build_model
from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.verdict.floor import noise_floor
from par4_identification.fitting.identification import identify
from par4_identification.logs.column_choice import chosen_columns
from par4_identification.logs.integrated import are_integrals
from par4_identification.logs.measured_bag import write_measured
from par4_identification.logs.measured_files import measured_of_files
from par4_identification.logs.read_log import read_log
from par4_identification.signals.position_noise import position_noise
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import conditioning_for

T, Q, QD, QDD = swings(40.0, rate=500.0, fastest=3.0)
NOISE = 0.01
"""rad/s, of the speeds that a drive tells."""


def logged(directory, seed, torque=0.0):
    """Return the log of a sound axis, or one with another `torque` (n,), by its speed alone."""
    random = np.random.default_rng(seed)
    path = directory / f'log{seed}.csv'
    np.savetxt(path, np.stack((
        T, QD + NOISE * random.standard_normal(len(T)),
        torque_of(QD, QDD) + torque + 0.02 * random.standard_normal(len(T))), axis=1),
        delimiter=',', header='t,w,tau', fmt='%.9g', comments='')
    write_measured(measured_of_files([path], chosen_columns(
        'time=t:s velocity=w:rad/s torque=tau:Nm')), ('motor',), directory / f'bag{seed}')
    return read_log(directory / f'bag{seed}', axis())


@pytest.mark.parametrize('period', [1e-3, 4e-3])
def test_the_noise_of_speeds_is_found_in_the_positions_that_are_made_of_them(period):
    t = np.arange(0.0, 40.0, period)
    speed = np.sin(3.0 * t) + np.random.default_rng(3).normal(0.0, NOISE, len(t))
    way = np.cumsum(np.append(0.0, 0.5 * period * (speed[1:] + speed[:-1])))[:, None]
    assert position_noise([way], period, integrated=True) == pytest.approx(NOISE, rel=0.05)


def test_positions_made_of_speeds_are_told_from_those_that_were_measured(tmp_path):
    stamp = np.rint(1e9 * T).astype(np.int64)
    way = np.cumsum(np.append(0.0, 0.5 * np.diff(T) * (QD[1:] + QD[:-1])))[:, None]
    assert are_integrals(stamp, way, QD[:, None])
    counted = 1e-4 * np.round(way / 1e-4)
    assert not are_integrals(stamp, counted, np.gradient(counted, T[1], axis=0))
    assert not are_integrals(stamp, Q[:, None], np.full((len(T), 1), np.nan))
    assert not are_integrals(stamp, np.zeros((len(T), 1)), np.zeros((len(T), 1)))
    assert logged(tmp_path, 5).integrated
    assert not read(tmp_path / 'measured', T, Q, torque_of(QD, QDD)).integrated


def test_the_floor_of_an_axis_is_that_of_its_speeds(tmp_path):
    """It is what a perfect model leaves; white noise of positions as loud above is far less."""
    log = logged(tmp_path, 6)
    conditioning = conditioning_for([log], axis(), CONDITIONING)
    runs = runs_of_log(log, axis(), conditioning)
    model = build_model(axis(), identify([log], axis(), conditioning=conditioning).model_file(
        {}, axis()))
    left = np.concatenate([(run.tau - run.rows(model.torque(run.state)))[run.valid]
                           for run in runs])
    assert noise_floor(runs, model)[0] == pytest.approx(np.sqrt(np.mean(left ** 2)), rel=0.05)


@pytest.mark.parametrize('seed', [11, 12])
def test_a_sound_axis_whose_speed_is_logged_is_clean(seed, tmp_path):
    """Its noise was taken for that of positions, and what it left was told as elasticity."""
    log = logged(tmp_path, seed)
    found = diagnose([log], axis(), conditioning=conditioning_for([log], axis(), CONDITIONING))
    assert (found.verdict, found.causes) == ('clean', ())
    np.testing.assert_allclose(identified(log), (1.0, 1.5, 2.0), rtol=0.03)


def test_cogging_is_named_where_only_the_speed_is_logged(tmp_path):
    log = logged(tmp_path, 13, 1.0 * np.sin(4.0 * Q + 0.3))
    found = diagnose([log], axis(), conditioning=conditioning_for([log], axis(), CONDITIONING))
    assert [cause.effect.name for cause in found.causes] == ['cogging']
