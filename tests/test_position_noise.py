"""White noise of positions: its size, and that a sound axis is not accused of what it makes."""

from __future__ import annotations

import numpy as np
import pytest
from planned import log_of
from test_swing import AXIS, MODEL

from par4_identification.diagnosis.diagnosis import CONDITIONING, diagnose
from par4_identification.diagnosis.verdict.floor import encoder_noise
from par4_identification.signals.position_noise import position_noise
from par4_identification.signals.rows import runs_of_log
from par4_identification.signals.scales import conditioning_for

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
