"""What is left is noise only where it is as loud whatever the machine does."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from experiments import entry, model_of
from measured import log_of_model
from scipy.signal import lfilter

from par4_identification.diagnosis.diagnosis import LIBRARY, diagnose
from par4_identification.diagnosis.verdict.loudness import follows_in_size
from par4_identification.reports.outcome.diagnosis import outcome_of_diagnosis
from robots import REFERENCE

ROWS = 2000


def rows(random: np.random.Generator, louder=lambda **_: 1.0, wrong: float = 0.0):
    """Return the rows of one joint that moves, with noise that wanders, louder in places.

    By `wrong` N m causes may be wrong where the joint is fast.
    """
    t = 0.01 * np.arange(ROWS)
    phase = random.uniform(0.0, 6.0, 3)
    speed, acceleration, torque = (
        np.sin(rate * t + own) + 0.5 * np.sin(1.7 * rate * t + 2.0 * own)
        for rate, own in zip((1.1, 2.3, 3.1), phase))
    noise = lfilter([1.0], [1.0, -0.9], random.normal(size=ROWS))
    left = noise * louder(speed=speed, acceleration=acceleration, torque=torque)
    run = SimpleNamespace(valid=np.ones((ROWS, 1), bool), speed=speed[:, None],
                          tau=(torque + left)[:, None],
                          state=SimpleNamespace(qdd=acceleration[:, None]),
                          at_rows=lambda values: values)
    return [(run, left[:, None], wrong * (np.abs(speed) > 1.0)[:, None])]


def follows(seed: int, louder=lambda **_: 1.0, wrong: float = 0.0) -> bool:
    """Return the answer on rows to fit and rows held out."""
    random = np.random.default_rng(seed)
    return follows_in_size(rows(random, louder, wrong), rows(random, louder, wrong))


def test_noise_that_wanders_follows_nothing():
    assert [follows(seed) for seed in range(50)] == [False] * 50


@pytest.mark.parametrize('louder', [
    lambda speed, **_: 1.0 + 4.0 * (np.abs(speed) > 1.0),
    lambda acceleration, **_: 1.0 + 3.0 * np.abs(acceleration),
    lambda torque, **_: 1.0 + 4.0 * (np.abs(torque) < 0.3)])
def test_what_is_louder_where_the_joint_moves_in_some_way_follows_the_motion(louder):
    assert [follows(seed, louder) for seed in range(10)] == [True] * 10


def test_what_the_causes_may_get_wrong_is_no_motion_of_its_own():
    def louder(speed, **_):
        return 1.0 + 4.0 * (np.abs(speed) > 1.0)

    assert not any(follows(seed, louder, wrong=16.0) for seed in range(10))


def test_what_one_half_alone_shows_is_chance():
    random = np.random.default_rng(0)
    loud = rows(random, lambda speed, **_: 1.0 + 4.0 * (np.abs(speed) > 1.0))
    assert not follows_in_size(loud, rows(random))
    assert not follows_in_size(rows(random)[:1], [])


def test_a_machine_with_play_that_no_library_has_is_not_clean():
    """No function of the motion follows loads that bounce, but they bounce where torques turn."""
    loose = model_of(entry('backlash', gap=2e-3))
    fit, heldout = (log_of_model(REFERENCE, loose, duration=duration, seed=seed, noise=0.05)
                    for duration, seed in ((12.0, 1), (8.0, 2)))
    found = diagnose([fit], REFERENCE, holdout_logs=[heldout],
                     library={'torque_offset': LIBRARY['torque_offset']})
    assert (found.verdict, found.causes, found.unnamed) == ('unknown', (), ())
    assert found.remaining.no_noise
    assert 'too much for noise' in ' '.join(
        remark.text for remark in outcome_of_diagnosis(found, REFERENCE).remarks)


@pytest.mark.parametrize('share', [0.0, 0.05, 0.3])
def test_what_is_left_of_a_large_part_of_the_torque_is_no_noise(share):
    """It wanders as noise does, but a model that leaves so much does not describe the machine."""
    random = np.random.default_rng(3)
    log = log_of_model(REFERENCE, model_of(), duration=12.0, seed=3, noise=0.05)
    wander = lfilter([1.0], [1.0, -0.97], random.normal(size=log.tau.shape), axis=0)
    wander *= share * np.sqrt(np.mean(log.tau ** 2)) / np.sqrt(np.mean(wander ** 2))
    found = diagnose([replace(log, tau=log.tau + wander)], REFERENCE, library={})
    assert found.causes == ()
    assert (found.verdict == 'clean') == (share < 0.1)
