"""Identification: filters, noise, least squares, and parameters that come back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from measured import log_of_model
from scipy.signal import lfilter

from par4_dynamics.model_from_file import build_model, read_model
from par4_identification.fitting.identification import identify
from par4_identification.fitting.validation import validate
from par4_identification.reports.outcome.identification import table_of_parameters
from par4_identification.signals.filtering import central_difference, low_pass, second_difference
from par4_identification.signals.noise import ArNoise, _gains, fit_noise
from par4_identification.signals.rows import runs_of_log
from par4_kinematics.errors import InputError
from robots import OTHER, REFERENCE, other_model

TABLE_1 = read_model('table1', REFERENCE)


def true_values(identification, model):
    return np.array([model.values[term.name][0] for term in identification.terms])


def test_low_pass_has_no_phase_and_half_magnitude_at_the_cut_off():
    t = np.arange(0.0, 4.0, 1e-3)
    middle = slice(1000, 3000)
    for frequency, gain in ((2.0, 1.0), (40.0, 0.5), (160.0, 0.0)):
        wave = np.sin(2 * np.pi * frequency * t)[:, None]
        np.testing.assert_allclose(low_pass(wave, 40.0, 1e-3)[middle], gain * wave[middle],
                                   atol=2e-3)


def test_low_pass_refuses_what_it_cannot_filter():
    with pytest.raises(InputError, match='Nyquist frequency of 50 Hz'):
        low_pass(np.zeros((1000, 1)), 60.0, 0.01)
    with pytest.raises(InputError, match='too few'):
        low_pass(np.zeros((5, 1)), 10.0, 0.01)


def test_differences_are_derivatives():
    t = np.arange(0.0, 1.0, 1e-3)
    values = np.stack((np.sin(30.0 * t), np.cos(7.0 * t)), axis=1)
    first = np.stack((30.0 * np.cos(30.0 * t), -7.0 * np.sin(7.0 * t)), axis=1)
    second = np.stack((-900.0 * np.sin(30.0 * t), -49.0 * np.cos(7.0 * t)), axis=1)
    inside = slice(2, -2)
    np.testing.assert_allclose(central_difference(values, 1e-3)[inside], first[inside], atol=1e-5)
    np.testing.assert_allclose(second_difference(values, 1e-3)[inside], second[inside], atol=1e-3)
    np.testing.assert_allclose(central_difference(values, 1e-3), first, atol=0.5)


def test_autoregression_comes_back_and_whitens_with_rows_missing():
    coefficients = np.array((1.2, -0.5, 0.1))
    random = np.random.default_rng(4)
    series = lfilter([1.0], np.concatenate(([1.0], -coefficients)),
                     0.3 * random.standard_normal(40000))
    valid = random.uniform(size=len(series)) > 0.2
    valid[5000:7000] = False
    noise = fit_noise([series[:20000], series[20000:]], [valid[:20000], valid[20000:]], order=3)
    np.testing.assert_allclose(noise.coefficients, coefficients, atol=0.08)
    assert noise.variance == pytest.approx(0.09, rel=0.1)
    white = noise.whiten(series[:, None], valid)[:, 0]
    np.testing.assert_array_equal(white[~valid], 0.0)
    kept = white[valid]
    assert np.var(kept) == pytest.approx(1.0, abs=0.05)
    for lag in range(1, 6):
        assert abs(np.mean(kept[lag:] * kept[:-lag])) < 0.04


def smooth_wandering(random):
    """Return noise that remembers 20 rows, smooth like rows of a low-pass, and which are valid."""
    share = np.exp(-1.0 / 20.0)
    path = lfilter([np.sqrt(1.0 - share ** 2)], [1.0, -share], random.normal(size=15_000))
    return (lfilter([0.3], [1.0, -0.7], path)[-1500:],
            np.repeat(random.uniform(size=150) < 0.7, 10))


def test_noise_that_wanders_is_as_large_elsewhere_as_it_is_told():
    """With rows missing, as near reversals, a variance from autocovariances is off tenfold."""
    for seed in range(12):
        random = np.random.default_rng(seed)
        (fitted, rows), (other, others) = smooth_wandering(random), smooth_wandering(random)
        white = fit_noise([fitted], [rows]).whiten(other[:, None], others)[others]
        assert 0.6 < np.mean(white ** 2) < 1.6


def test_noise_that_wanders_is_white_after_its_filter_with_many_rows_missing():
    """Stretches of 1 to 9 rows: what is read of the autocovariance is often that of no noise."""
    left = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        path = lfilter([0.2], [1.0, -0.98], random.normal(size=1000))
        series = path + 0.02 * random.normal(size=1000)
        valid = np.repeat(np.arange(400) % 2 == 0, random.integers(1, 10, 400))[:1000]
        white = fit_noise([series], [valid]).whiten(series[:, None], valid)[:, 0]
        left.append(abs(np.mean((white[1:] * white[:-1])[valid[1:] & valid[:-1]])))
    assert np.median(left) < 0.1
    assert max(left) < 0.6  # of noise that is taken for white 1


def test_whitening_is_the_gaussian_likelihood():
    """Sum of squares of whitened rows = r^T Omega^-1 r with Omega from the autocovariance."""
    noise = ArNoise(np.array((0.6, -0.2)), 0.5)
    random = np.random.default_rng(1)
    residual, valid = random.standard_normal(60), random.uniform(size=60) > 0.3
    lags = np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    omega = noise.autocovariance(60)[lags][np.ix_(valid, valid)]
    expected = residual[valid] @ np.linalg.solve(omega, residual[valid])
    white = noise.whiten(residual[:, None], valid)
    assert float(np.sum(white ** 2)) == pytest.approx(expected, rel=1e-9)


def test_rows_of_one_joint_of_several_are_whitened_by_the_kernel_of_a_single_axis():
    """To compile another one takes seconds."""
    noise, valid = ArNoise(np.array((0.6, -0.2)), 0.5), np.ones((60, 2), dtype=bool)
    alone = noise.whitening(valid[:, 0].copy())
    compiled = len(_gains.signatures)
    assert np.array_equal(noise.whitening(valid[:, 0]).gain, alone.gain)
    assert len(_gains.signatures) == compiled


def test_parameters_come_back_within_their_intervals():
    """60 seeded logs of two robots: within 1 %, within three standard deviations in 57 of them."""
    inside, scores = 0, []
    for robot, model in ((REFERENCE, TABLE_1), (OTHER, other_model())):
        for seed in range(30):
            log = log_of_model(robot, model, duration=5.0, seed=seed, feedforward=seed % 2 == 1)
            identification = identify([log], robot)
            true = true_values(identification, model)
            np.testing.assert_allclose(identification.estimate.values, true, rtol=0.01)
            score = (identification.estimate.values - true) / identification.estimate.std
            inside += bool(np.all(np.abs(score) < 3.0))
            scores.append(score)
    assert inside >= 57
    assert 0.8 < np.sqrt(np.mean(np.square(scores))) < 1.3


@pytest.mark.parametrize(('robot', 'shown'), [(REFERENCE, True), (OTHER, False)])
def test_the_papers_values_are_shown_of_a_robot_of_its_dimensions(robot, shown):
    model = TABLE_1 if shown else other_model()
    identification = identify([log_of_model(robot, model, duration=5.0, seed=0)], robot)
    rows = table_of_parameters(identification, robot)
    assert {row.paper is not None for row in rows} == {shown}
    assert {row.name for row in rows if row.printed is not None} == (
        {'viscous_friction'} if shown else set())


def test_full_rigid_body_removes_the_bias_of_the_paper():
    model = read_model('table1_full', REFERENCE)
    log = log_of_model(REFERENCE, model, duration=12.0, seed=3)
    paper, full = (identify([log], REFERENCE, rigid_body) for rigid_body in ('paper', 'full'))
    true = true_values(paper, model)
    bias = paper.estimate.values / true - 1.0
    assert bias[1] < -0.01  # (20) carries with the platform what swings along in the rods
    assert bias[2] < -0.01
    assert bias[3] > 0.01
    assert np.abs(full.estimate.values / true - 1.0).max() < 0.005
    assert full.estimate.relative_error < paper.estimate.relative_error


def test_a_known_payload_is_taken_off():
    heavy = replace(TABLE_1, values={**TABLE_1.values, 'platform_mass_1': np.full(4, 1.3043)})
    plain = log_of_model(REFERENCE, TABLE_1, seed=1, name='plain')
    loaded = log_of_model(REFERENCE, heavy, seed=2, name='loaded')
    together = identify([plain, loaded], REFERENCE, payloads={'loaded': 0.5})
    np.testing.assert_allclose(together.estimate.values, true_values(together, TABLE_1), rtol=0.01)
    ignored = identify([plain, loaded], REFERENCE)
    assert ignored.estimate.values[1] > 0.9


def test_relabelled_time_changes_nothing():
    log = log_of_model(REFERENCE, TABLE_1, seed=5)
    later = replace(log, t=log.t + 100.0, start_stamp=log.start_stamp + 10**11)
    np.testing.assert_allclose(identify([log], REFERENCE).estimate.values,
                               identify([later], REFERENCE).estimate.values, rtol=1e-9)


def test_segments_are_never_joined():
    """A jump between two segments does not reach the rows of either."""
    log = log_of_model(REFERENCE, TABLE_1, seed=6)
    cut = len(log.t) // 2
    parts = replace(log, segments=(slice(0, cut), slice(cut, len(log.t))))
    shifted = replace(parts, tau=np.concatenate((log.tau[:cut], log.tau[cut:] + 1000.0)))
    first = runs_of_log(parts, REFERENCE)[0]
    np.testing.assert_array_equal(first.tau, runs_of_log(shifted, REFERENCE)[0].tau)
    assert len(runs_of_log(parts, REFERENCE)) == 2


def test_slow_logs_get_lower_filters_and_too_slow_ones_are_refused():
    log = log_of_model(REFERENCE, TABLE_1, seed=7)
    slower = replace(log, period=4e-3, t=log.t[::4], q=log.q[::4], tau=log.tau[::4],
                     segments=(slice(0, len(log.t[::4])),))
    values = identify([slower], REFERENCE).estimate.values
    np.testing.assert_allclose(values, [TABLE_1.values[name][0] for name in TABLE_1.values],
                               rtol=0.02)
    crawling = replace(log, period=0.03, segments=(slice(0, len(log.t)),))
    with pytest.raises(InputError, match='at least 50 Hz'):
        identify([crawling], REFERENCE)


def test_validation_measures_the_error_of_a_wrong_model():
    log = log_of_model(REFERENCE, TABLE_1, seed=9)
    good = validate(log, REFERENCE, TABLE_1)
    wrong = replace(TABLE_1, values={**TABLE_1.values, 'viscous_friction': np.full(4, 2.54)})
    bad = validate(log, REFERENCE, wrong)
    assert good.without_standstill.overall_relative_error < 0.01
    assert np.all(good.without_standstill.r2 > 0.999)
    # half a N m s/rad too much friction: the residual is that times the joint speed
    run, = runs_of_log(log, REFERENCE)
    speed = np.sqrt(np.sum(np.where(good.moving, run.speed, 0.0) ** 2, axis=0)
                    / good.moving.sum(axis=0))
    np.testing.assert_allclose(bad.without_standstill.rms, 0.5 * speed, rtol=0.02)


def test_identified_model_is_a_model():
    log = log_of_model(REFERENCE, TABLE_1, seed=11)
    model_file = identify([log], REFERENCE).model_file({'bags': ['x']})
    model = build_model(REFERENCE, model_file)
    assert model.values['platform_mass_1'][0] == pytest.approx(0.8043, rel=0.01)
    mirrored = replace(log, tau=-log.tau)
    with pytest.raises(InputError, match='which is impossible; check the sign'):
        identify([mirrored], REFERENCE).model_file({})
