"""Positions freed from the noise of encoder counts: what a fit finds with them is unbiased."""

from __future__ import annotations

import numpy as np
import pytest
from measured import excitation
from planned import log_of

from par4_identification.diagnosis.diagnosis import CONDITIONING
from par4_identification.signals.filtering import low_pass, second_difference
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import conditioning_for
from par4_identification.signals.smoothing import WINDOW, smoother_of
from robots import REFERENCE

PERIOD = 1e-3
COUNTS = 8192
T = np.arange(20_000) * PERIOD
CUTOFF = 40.0


def motion(seed, joints=2):
    """Return positions (n, joints), rad, whose spectrum falls with the frequency."""
    random = np.random.default_rng(seed)
    frequency = np.geomspace(0.3, 60.0, 120)
    size = 0.4 * random.standard_normal((joints, len(frequency))) / (1.0 + frequency ** 3.0)
    phase = random.uniform(0.0, 2.0 * np.pi, (joints, len(frequency)))
    return np.stack([np.sin(2.0 * np.pi * np.outer(T, frequency) + shift) @ sizes
                     for sizes, shift in zip(size, phase)], axis=1)


def told(q, counts=COUNTS):
    step = 2.0 * np.pi / counts
    return np.round(q / step) * step


def jerks(q):
    """Return the fourth derivative of positions (n, J) in the band of rows, (n, J)."""
    return low_pass(second_difference(second_difference(q, PERIOD), PERIOD), CUTOFF, PERIOD)


@pytest.mark.parametrize('seed', range(3))
def test_a_torque_of_a_high_derivative_is_found_with_its_size(seed):
    """Errors in variables: rows with count noise make it smaller, the best estimate does not."""
    q = motion(seed)
    torque = jerks(q)
    inner = slice(1000, -1000)
    sizes = {}
    for name, positions in (('raw', told(q)),
                            ('smooth', smoother_of([told(q)], COUNTS, PERIOD)(told(q)))):
        column = jerks(positions)[inner]
        sizes[name] = np.sum(column * torque[inner], axis=0) / np.sum(column ** 2, axis=0)
    assert np.all(sizes['raw'] < 0.5)
    np.testing.assert_allclose(sizes['smooth'], 1.0, atol=0.15)


def test_a_smoothed_motion_is_nearer_to_the_true_one():
    q = motion(5)
    smooth = smoother_of([told(q)], COUNTS, PERIOD)(told(q))
    inner = slice(1000, -1000)
    before, after = (np.std((jerks(other) - jerks(q))[inner], axis=0)
                     for other in (told(q), smooth))
    assert np.all(after < 0.5 * before)
    assert np.all(after < np.std(jerks(q)[inner], axis=0))  # better than to know nothing
    assert np.abs((smooth - q)[inner]).max() < 2.0 * np.pi / COUNTS


def test_what_is_above_the_noise_passes_as_it_is():
    q = motion(6)
    fine = told(q, 2 ** 26)
    smooth = smoother_of([fine], 2 ** 26, PERIOD)(fine)
    np.testing.assert_allclose(smooth[200:-200], fine[200:-200], atol=1e-7)


def test_the_filter_is_symmetric_and_keeps_straight_lines():
    q = motion(7)
    smoother = smoother_of([told(q)], COUNTS, PERIOD)
    assert len(smoother.taps) == 2 * round(0.5 * WINDOW / PERIOD) + 1
    np.testing.assert_allclose(smoother.taps, smoother.taps[::-1], atol=1e-15)
    line = np.stack((0.3 + 0.2 * T, -0.1 * T), axis=1)
    np.testing.assert_allclose(smoother(line), line, atol=1e-9)


@pytest.mark.parametrize(('counts', 'samples'), [(0, len(T)), (COUNTS, 400)],
                         ids=['counts not known', 'log too short'])
def test_without_what_it_needs_nothing_is_filtered(counts, samples):
    q = told(motion(8))[:samples]
    np.testing.assert_array_equal(smoother_of([q], counts, PERIOD)(q), q)


def test_a_joint_at_rest_stays_where_it_is():
    q = told(motion(9))
    q[5000:7000] = q[5000]
    smooth = smoother_of([q], COUNTS, PERIOD)(q)
    assert np.all(np.diff(smooth[5200:6800], axis=0) == 0.0)


def test_positions_between_counts_are_left_alone():
    """They tell that the encoders are finer than they are said to be, or that a filter was here."""
    q = motion(10)
    np.testing.assert_array_equal(smoother_of([q], COUNTS, PERIOD)(q), q)
    finer = told(q, 16 * COUNTS)
    np.testing.assert_array_equal(smoother_of([finer], COUNTS, PERIOD)(finer), finer)
    shifted = told(q) + 0.123  # the zero of an encoder
    assert np.any(smoother_of([shifted], COUNTS, PERIOD)(shifted) != shifted)


def test_the_motion_is_known_up_to_where_the_noise_begins():
    """Less of a motion that fades sooner, all of one that finer encoders tell."""
    q = motion(11)
    coarse, fine = (smoother_of([told(q, counts)], counts, PERIOD).known_hz(PERIOD)
                    for counts in (COUNTS, 32 * COUNTS))
    assert 5.0 < coarse < 0.7 * fine
    spectra = [np.abs(np.fft.rfft(np.hanning(len(T))[:, None] * np.diff(values, 2, axis=0, append=0,
                                                                      prepend=0), axis=0)) ** 2
               for values in (q, told(q) - q)]
    frequency = np.fft.rfftfreq(len(T), PERIOD)

    def ratio(low, high):
        band = (frequency > low) & (frequency < high)
        return np.median(spectra[0][band].sum(axis=0) / spectra[1][band].sum(axis=0))

    assert ratio(0.5 * coarse, 0.9 * coarse) > 2.0
    assert ratio(1.1 * coarse, 2.0 * coarse) < 5.0
    assert smoother_of([q], 0, PERIOD).known_hz(PERIOD) == np.inf


def test_motors_that_move_with_what_is_misread_are_noticed():
    """A motion that only fades swings loads as it is told; what rises beyond it does not."""
    q = motion(12)
    assert smoother_of([told(q)], COUNTS, PERIOD).told_hz(PERIOD, 160.0) == np.inf
    noise = np.random.default_rng(1).normal(size=q.shape) * 2.0 * np.pi / COUNTS
    shaken = q + low_pass(noise, 120.0, PERIOD) - low_pass(noise, 80.0, PERIOD)
    smoother = smoother_of([told(shaken)], COUNTS, PERIOD)
    assert 5.0 < smoother.told_hz(PERIOD, 160.0) < smoother.known_hz(PERIOD)
    assert smoother.told_hz(PERIOD, 40.0) == np.inf  # which nothing beyond can swing


@pytest.mark.parametrize(('counts', 'lower'), [(COUNTS, True), (131072, False)])
def test_rows_end_where_coarse_encoders_do_not_tell_the_motion(counts, lower):
    robot = REFERENCE.model_copy(update={
        'drives': REFERENCE.drives.model_copy(update={'encoder_counts': counts})})
    planned = excitation('reference', 10.0, 70)
    log = log_of(robot, planned.t, told(planned.q, counts), np.zeros_like(planned.q), seed=1)
    chosen = conditioning_for([log], robot, CONDITIONING)
    assert (chosen.torque_cutoff_hz < 0.9 * CONDITIONING.torque_cutoff_hz) == lower
    assert chosen.torque_cutoff_hz / CONDITIONING.torque_cutoff_hz == pytest.approx(
        chosen.row_rate_hz / CONDITIONING.row_rate_hz)
    (run,) = runs_of_log(log, robot, chosen)
    assert run.coarse == lower


def test_short_stretches_of_a_log_are_filtered_as_the_whole_of_it_is():
    """Eight windows tell no spectrum: a stretch of one second lost all but its mean."""
    q = told(motion(11))
    parts = [q[start:start + round(1.08 / PERIOD)]
             for start in range(0, len(q) - round(1.08 / PERIOD), round(1.2 / PERIOD))]
    whole, pooled = smoother_of([q], COUNTS, PERIOD), smoother_of(parts, COUNTS, PERIOD)
    assert pooled.known_hz(PERIOD) == pytest.approx(whole.known_hz(PERIOD), rel=0.4)
    for part in parts:
        np.testing.assert_allclose(pooled(part), whole(part), atol=2.0 * np.pi / COUNTS)
    alone = smoother_of(parts[:1], COUNTS, PERIOD)
    np.testing.assert_array_equal(alone(parts[0]), parts[0])
