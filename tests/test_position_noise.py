"""White noise of positions: its size, and that a sound axis is not accused of what it makes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy
from planned import log_of
from test_swing import AXIS, MODEL

from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.verdict.floor import encoder_noise
from par4_identification.signals.position_noise import mean_spectrum, position_noise
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import conditioning_for, resolved_hz

PERIOD = 1e-3
T = np.arange(0.0, 30.0, PERIOD)
RATES = 2.0 * np.pi * np.array((0.31, 0.83, 1.7, 2.9, 4.3))
SIZES = 1.2 / (1.0 + (RATES / 6.0) ** 2)
INERTIA, COULOMB, VISCOUS = 0.12, 0.9, 0.35


def motion(seed, t=T):
    """Return position, speed and acceleration (n, 1) of a smooth motion."""
    waves = SIZES * np.exp(1j * (RATES * t[:, None] + np.random.default_rng(seed).uniform(
        0.0, 2.0 * np.pi, len(RATES))))
    return [(part * waves).sum(axis=1, keepdims=True).real
            for part in (1.0, 1j * RATES, -RATES ** 2)]


def sound_log(seed, counts=None, tremble=0.0):
    """Return the log of a rigid axis with friction, told in counts or at stamps that tremble."""
    random = np.random.default_rng(seed)
    _, qd, qdd = motion(seed)
    tau = INERTIA * qdd + COULOMB * np.sign(qd) + VISCOUS * qd
    told, _, _ = motion(seed, T + tremble * PERIOD * random.standard_normal(len(T)))
    if counts:
        step = 2.0 * np.pi / counts
        told = step * np.round(told / step)
    return log_of(AXIS, T, told, tau, seed, 0.05)


def test_the_noise_of_positions_is_that_above_the_motion():
    q, _, _ = motion(4)
    noisy = q + np.random.default_rng(4).normal(0.0, 3e-5, q.shape)
    counted = 1e-4 * np.round(q / 1e-4)
    assert position_noise([noisy], PERIOD) == pytest.approx(3e-5, rel=0.1)
    assert position_noise([counted], PERIOD) == pytest.approx(1e-4 / np.sqrt(12.0), rel=0.1)
    assert position_noise([q], PERIOD) < 3e-7


@pytest.mark.parametrize('centred', [True, False])
def test_the_mean_spectrum_is_that_of_welch_over_all_stretches(centred):
    window, signal = np.hanning(201)[:-1], np.random.default_rng(7).normal(1.0, 2.0, (2000, 2))
    detrend = 'constant' if centred else False
    _, density = scipy.signal.welch(signal, 1.0 / PERIOD, window, detrend=detrend,
                                    return_onesided=False, axis=0)
    spectrum = mean_spectrum([signal[:1100], signal[1000:], signal[:199]], PERIOD, window, centred)
    assert spectrum.windows == 10 + 9
    np.testing.assert_allclose(spectrum.power, density[:101] / PERIOD, rtol=1e-12)


@pytest.mark.parametrize('seconds', [1.2, 2.0, 4.0, 12.0])
def test_white_noise_has_its_variance_in_logs_of_any_length(seconds):
    """A median of the power of few windows is less than its mean."""
    random = np.random.default_rng(6)
    noises = [position_noise([random.standard_normal((round(seconds / PERIOD), 1))], PERIOD)
              for _ in range(20)]
    assert np.mean(np.square(noises)) == pytest.approx(1.0, abs=0.03)


def test_the_noise_of_positions_is_in_the_floor_of_an_axis():
    """White noise of a position gives the inertia's torque that of its second difference."""
    log = sound_log(5, counts=16384)
    conditioning = conditioning_for([log], AXIS, CONDITIONING)
    floors = [encoder_noise(runs_of_log(own, AXIS, conditioning), MODEL)[0]
              for own in (log, sound_log(5))]
    assert floors[0] > 20.0 * floors[1]


def found_in(seed, **told):
    """Return the diagnosis of two sound logs."""
    fit, heldout = sound_log(seed, **told), sound_log(seed + 100, **told)
    return diagnose([fit], AXIS, holdout_logs=[heldout], conditioning=conditioning_for(
        [fit, heldout], AXIS, CONDITIONING))


@pytest.mark.parametrize('seed', [11, 12])
@pytest.mark.parametrize('counts', [16384, 65536])
def test_a_sound_axis_is_clean_however_coarse_its_counts(counts, seed):
    assert found_in(seed, counts=counts).verdict == 'clean'


@pytest.mark.parametrize('seed', [11, 12])
def test_stamps_that_tremble_are_no_cause(seed):
    """Noise that grows with the speed may look like bursts, but not like anything in the machine.
    """
    found = found_in(seed, tremble=0.1)
    assert found.causes == ()
    assert found.unnamed == ()
    assert found.remaining.unrelated.lines == ()  # the motion has lines of its own


def driven_log(seed, counts, damping=30.0, passed=0.1):
    """Return the log of a rigid axis whose drive answers the counts of its encoder.

    The drive takes a share `passed` of each new difference for the speed. There are friction and a
    constant torque of 0.2 N m.
    """
    step = 2.0 * np.pi / counts
    wanted, speed, rate = (part[:, 0] for part in motion(seed))
    stiffness = 0.25 * damping ** 2 / INERTIA
    known = INERTIA * rate + COULOMB * np.sign(speed) + VISCOUS * speed + 0.2
    told, tau = np.empty(len(T)), np.empty(len(T))
    q, qd, slow, before = wanted[0], speed[0], speed[0], wanted[0] - speed[0] * PERIOD
    for row in range(len(T)):
        told[row] = step * np.round(q / step)
        slow += passed * ((told[row] - before) / PERIOD - slow)
        before = told[row]
        tau[row] = known[row] + stiffness * (wanted[row] - before) + damping * (speed[row] - slow)
        qd += PERIOD * (tau[row] - COULOMB * np.sign(qd) - VISCOUS * qd - 0.2) / INERTIA
        q += PERIOD * qd
    return log_of(AXIS, T, told[:, None], tau[:, None], seed, 0.05)


@pytest.mark.parametrize('seed', [11, 12])
def test_a_name_beside_what_counts_make_of_the_torque_is_told(seed):
    """The noise of positions leaves most of the error, and is known."""
    log = sound_log(seed, 8192)
    log = replace(log, tau=log.tau + 0.2)
    found = diagnose([log], AXIS)
    assert found.verdict == 'explained'
    assert [cause.effect.name for cause in found.causes] == ['torque_offset']


@pytest.mark.parametrize(('counts', 'passed'), [(2000, 1.0), (4000, 0.1)])
def test_rows_end_where_a_drive_answers_the_counts_of_its_encoder(counts, passed):
    """Above, the torque follows the counts, which the rows do not know."""
    log = driven_log(12, counts, passed=passed)
    conditioning = conditioning_for([log], AXIS, CONDITIONING)
    assert conditioning.position_cutoff_hz == pytest.approx(resolved_hz([log]))
    assert conditioning.torque_cutoff_hz == pytest.approx(0.5 * resolved_hz([log]))
    found = diagnose([log], AXIS, conditioning=conditioning)
    assert found.verdict == 'explained'
    assert [cause.effect.name for cause in found.causes] == ['torque_offset']
    openly = conditioning_for([sound_log(12, counts)], AXIS, CONDITIONING)
    assert openly.torque_cutoff_hz == 40.0


@pytest.mark.parametrize('mains', [50.0, 60.0])
def test_hum_of_the_mains_on_a_reading_is_no_motion(mains):
    """It was taken for acceleration, let through, and made an inertia of a hundredth."""
    log = sound_log(6)
    log = replace(log, q=log.q + 8e-4 * np.random.default_rng(6).standard_normal(log.q.shape))
    hum = 1e-2 * np.sin(2.0 * np.pi * mains * T[:, None] + 0.4)
    plain = resolved_hz([log])
    assert plain < 0.9 * mains
    assert resolved_hz([replace(log, q=log.q + hum)]) == pytest.approx(plain, abs=3.0)
    # a joint that shakes at that frequency takes a torque
    shaking = log.tau - INERTIA * (2.0 * np.pi * mains) ** 2 * hum
    assert resolved_hz([replace(log, q=log.q + hum, tau=shaking)]) > mains
