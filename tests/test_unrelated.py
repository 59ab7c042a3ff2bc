"""What follows nothing in the motion: lines of steady frequencies, and noise that is none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from measured import excitation
from planned import log_of

from par4_identification.changes.joint_values import whitened
from par4_identification.diagnosis.evidence.fit import solve
from par4_identification.diagnosis.evidence.observations import observe
from par4_identification.diagnosis.search.rules import Rules
from par4_identification.diagnosis.verdict.sure import is_most_of_it
from par4_identification.diagnosis.verdict.unrelated import left_of, lines_of, unrelated
from par4_identification.signals.filtering import low_pass
from par4_identification.signals.rows import runs_of_log
from robots import REFERENCE

LINE = 12.3
"""Hz."""


@pytest.fixture(scope='module')
def parts():
    """Return runs to fit and held out, with gaps such as the standstills of slow motions leave."""
    made = []
    for seed, duration in ((70, 12.0), (80, 8.0)):
        motion = excitation('reference', duration, seed)
        run, = runs_of_log(log_of(REFERENCE, motion.t, motion.q, np.zeros_like(motion.q), 1),
                           REFERENCE)
        moving = np.random.default_rng(seed).random((len(run.t) // 20 + 1, 4)) > 0.3
        made.append([replace(run, valid=run.valid & np.repeat(moving, 20, axis=0)[:len(run.t)])])
    return made


def left(runs, random: np.random.Generator, frequency: float = LINE, amplitude: float = 0.0):
    """Return residuals: white noise, noise that wanders, and a line on joint 2."""
    found = []
    for run in runs:
        t = run.state.t
        noise = random.normal(0.0, 0.05, run.state.q.shape)
        noise += low_pass(random.normal(0.0, 1.0, noise.shape), 10.0, float(t[1] - t[0]))
        noise[:, 2] += amplitude * np.sin(2.0 * np.pi * frequency * t + random.uniform(0.0, 6.0))
        rows = run.rows(noise)
        found.append((run, rows, np.zeros_like(rows)))
    return found


def test_a_share_of_the_torque_may_be_left_by_any_model():
    """Where a log is smooth its noise is far below what the law of the machine may be wrong by."""
    motion = excitation('reference', 8.0, 71)
    log = log_of(REFERENCE, motion.t, motion.q, motion.qdd, 1)
    observations = observe(runs_of_log(log, REFERENCE), REFERENCE, 'paper', None)
    fit = solve(whitened(observations), ())
    rules = Rules()
    for (run, _, error), torque in zip(
            left_of(observations, (), fit, fit, rules), observations.varying):
        np.testing.assert_allclose(
            error, np.hypot(rules.base_error * torque, run.timing_error))
        assert np.all(error[run.valid] > 0.0)


def test_noise_makes_no_line(parts):
    told = [lines_of(*(left(part, np.random.default_rng((seed, number)))
                       for number, part in enumerate(parts))) for seed in range(20)]
    assert sum(map(bool, told)) == 0, told


def test_the_end_of_the_spectrum_makes_no_line(parts):
    """The last value of a spectrum may be near zero, which says nothing of those before it."""
    told = []
    for seed in range(500):
        random = np.random.default_rng(seed)
        told += lines_of(*([(run, random.normal(size=(len(run.t), 4)), np.zeros((len(run.t), 4)))
                            for run in part] for part in parts))
    assert told == []


@pytest.mark.parametrize('seed', range(3))
def test_a_line_is_told_with_its_frequency_and_its_joint(parts, seed):
    random = np.random.default_rng(seed)
    line, = lines_of(*(left(part, random, LINE, 0.3) for part in parts))
    assert line.frequency_hz == pytest.approx(LINE, abs=0.1)
    assert np.flatnonzero(line.amplitude).tolist() == [2]
    assert line.amplitude[2] == pytest.approx(0.3, rel=0.3)


@pytest.mark.parametrize(('torque', 'is_line'), [(0.0, True), (30.0, False)])
def test_a_line_where_the_model_has_far_more_torque_is_its_error(parts, torque, is_line):
    """A motion may be a sum of sines; a percent of its torque is no disturbance."""
    random = np.random.default_rng(1)
    found = [[(replace(run, tau=rows + torque * np.sin(2.0 * np.pi * LINE * run.t)[:, None]),
               rows, after) for run, rows, after in left(part, random, LINE, 0.3)]
             for part in parts]
    assert bool(lines_of(*found)) == is_line


CYCLE = 2.0
"""s; 12.5 Hz is a multiple of its frequency, 12.3 Hz is none."""


def of_cycles(random: np.random.Generator, frequency: float, amplitude: float):
    """Return the residuals of a motion in cycles, in each of which the model errs alike.

    It errs in two bands of frequency, by more than the noise; a line is added on joint 2.
    """
    found = []
    for seconds in (60.0, 40.0):
        t = np.arange(0.0, seconds, 0.01)
        orders = np.concatenate((np.arange(20, 34), np.arange(56, 72)))
        again = np.sin(2.0 * np.pi * (orders * t[:, None] / CYCLE + random.random(len(orders))))
        error = 0.04 * again @ random.exponential(1.0, (len(orders), 4))
        rows = random.normal(0.0, 0.05, (len(t), 4)) + error
        rows[:, 2] += amplitude * np.sin(2.0 * np.pi * frequency * t)
        q = np.sin(2.0 * np.pi * t[:, None] / CYCLE + np.arange(4.0))
        run = SimpleNamespace(t=t, q=q, tau=rows, valid=np.ones(rows.shape, bool))
        found.append([(run, rows, np.zeros_like(rows))])
    return found


@pytest.mark.parametrize('seed', range(5))
def test_what_comes_again_with_each_cycle_is_the_error_of_the_model(seed):
    assert lines_of(*of_cycles(np.random.default_rng(seed), LINE, 0.0)) == ()


@pytest.mark.parametrize(('frequency', 'amplitude'), [(12.3, 0.1), (12.5, 1.0), (25.0, 0.3)])
def test_a_line_beside_or_far_above_what_comes_again_is_told(frequency, amplitude):
    line, = lines_of(*of_cycles(np.random.default_rng(1), frequency, amplitude))
    assert line.frequency_hz == pytest.approx(frequency, abs=0.02)
    assert np.flatnonzero(line.amplitude).tolist() == [2]


def with_a_burst(parts):
    """Return noise of 0.01 N m that is four times as large for half a second."""
    random = np.random.default_rng(1)
    found = []
    for part in parts:
        found.append([])
        for run in part:
            rows = random.normal(0.0, 0.01, run.tau.shape)
            rows[300:350] *= 4.0
            found[-1].append((run, rows, np.zeros_like(rows)))
    return found


@pytest.mark.parametrize(('floor', 'is_burst'), [(0.01, True), (0.05, False)])
def test_what_is_below_the_noise_floor_is_no_burst(parts, floor, is_burst):
    """Noise that follows the motion is less than its mean in most places, and more in some."""
    told = unrelated(*with_a_burst(parts), np.full(4, floor), Rules())
    assert bool(told.bursts) == is_burst


@pytest.mark.parametrize(('named', 'floor', 'is_burst'), [
    (True, 0.01, True), (False, 0.01, True), (True, 0.003, True), (False, 0.003, False)])
def test_what_a_cause_without_a_name_leaves_is_no_burst_of_noise(parts, named, floor, is_burst):
    """It is larger in places than elsewhere, too, but most of the time it is more than noise."""
    told = unrelated(*with_a_burst(parts), np.full(4, floor), Rules(), named)
    assert bool(told.bursts) == is_burst


@pytest.mark.parametrize(('share', 'floor', 'expected'), [
    (0.3, 0.01, True), (0.1, 0.01, False), (0.3, 0.3, False)])
def test_a_large_part_of_the_torque_is_no_noise_however_it_wanders(share, floor, expected):
    """Shares of the torque, rms; a loud torque sensor has a floor that is as high."""
    motion = excitation('reference', 8.0, 90)
    torque = np.random.default_rng(3).normal(0.0, 5.0, motion.q.shape)
    run, = runs_of_log(log_of(REFERENCE, motion.t, motion.q, torque, 1), REFERENCE)
    heldout = observe([run], REFERENCE, 'paper', None)
    size = np.sqrt(np.mean(run.tau[run.valid] ** 2))
    left = np.random.default_rng(4).normal(0.0, share * size, run.tau.shape)
    assert is_most_of_it(heldout, [left], np.full(4, floor * size), Rules()) == expected
