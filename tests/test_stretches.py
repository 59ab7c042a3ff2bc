"""Stretches of long logs."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from measured import log_of_model

from par4_dynamics.model_from_file import read_model
from par4_identification.diagnosis.nominal.gate import too_few
from par4_identification.diagnosis.split import MOST, manageable, split_runs
from par4_identification.fitting.identification import identify
from par4_identification.logs import stretches
from par4_identification.logs.log import Log
from par4_identification.logs.stretches import (
    STRETCH,
    in_pieces,
    parted,
    seconds_of,
    spread_over,
)
from par4_identification.signals.conditioning import Conditioning
from par4_kinematics.robot import Axis
from robots import REFERENCE


def log_of(seconds: float, gap: bool = False) -> Log:
    """Return a log at 100 Hz whose positions count the samples."""
    count = round(100 * seconds)
    q = np.arange(count, dtype=float)[:, None] * np.ones(2)
    segments = (slice(0, count),) if not gap else (slice(0, count // 4), slice(count // 4, count))
    return Log(name='counted', joint_names=('a', 'b'), start_stamp=0, period=0.01, q=q, tau=-q,
               t=np.arange(count) * 0.01, segments=segments, reference=None, accounts=None)


@pytest.mark.parametrize('gap', [False, True])
def test_stretches_are_spread_over_all_of_a_log(gap):
    log = log_of(600.0, gap)
    thin, = spread_over([log], 120.0)
    assert seconds_of([thin]) == pytest.approx(120.0, rel=0.02)
    assert len(thin.segments) == round(120.0 / STRETCH)
    assert thin.t[0] == 0.0
    assert thin.t[-1] == log.t[-1]
    assert np.diff(thin.t).max() < 2.0 * 600.0 / len(thin.segments)
    # each sample is still itself, and a segment has no gap
    np.testing.assert_array_equal(thin.q[:, 0], np.round(thin.t / 0.01))
    for part in thin.segments:
        np.testing.assert_allclose(np.diff(thin.t[part]), 0.01)
    assert thin.segments[-1].stop == len(thin.t)


def test_short_logs_stay_as_they_are():
    logs = [log_of(20.0), log_of(30.0, gap=True)]
    assert spread_over(logs, 60.0) == tuple(logs)


def test_doubtful_samples_stay_doubtful():
    log = log_of(100.0)
    doubtful = log.q % 7 == 0
    thin, = spread_over([replace(log, doubtful=doubtful)], 30.0)
    np.testing.assert_array_equal(thin.doubtful, thin.q % 7 == 0)


@pytest.mark.parametrize('gap', [False, True])
@pytest.mark.parametrize('share', [0.1, 0.25, 2.0 / 3.0])
def test_the_parts_of_a_log_are_the_log(gap, share):
    log = log_of(60.0, gap)
    first, last = parted(log, share)
    assert seconds_of([first]) == pytest.approx(60.0 * share, abs=0.02)
    np.testing.assert_array_equal(np.concatenate((first.q, last.q)), log.q)
    for part in (first, last):
        assert part.segments[0].start == 0
        assert part.segments[-1].stop == len(part.t)


def test_of_long_logs_stretches_are_diagnosed_and_of_others_everything():
    short, long = log_of(100.0), log_of(5000.0)
    assert manageable([short], [], REFERENCE, Conditioning()) == ([short], [], 1.0)
    fit, held, share = manageable([long], [], REFERENCE, Conditioning())
    assert sum(log.tau.size for log in fit) == pytest.approx(MOST, rel=0.02)
    assert sum(log.tau.size for log in held) <= MOST // 2 + 10
    assert share == pytest.approx((sum(log.tau.size for log in (*fit, *held))) / long.tau.size)
    # of one log the last third is held out; of several the last
    assert fit[0].t[-1] < held[0].t[0]
    assert manageable([short, long], [], REFERENCE, Conditioning())[1][0].t[0] == 0.0
    assert len(manageable([short], [long], REFERENCE, Conditioning())[0]) == 1


def test_steady_speeds_are_not_thinned_before_every_third_is_held_out():
    long = log_of(5000.0)
    steady = Conditioning(steady=True)
    assert manageable([long], [], REFERENCE, steady) == ([long], [], 1.0)


def test_of_a_slow_axis_the_samples_count_that_are_put_between_its_own():
    """At 100 Hz ten stand for one, and an hour is more than time and memory allow."""
    axis = Axis(schema='par4/axis/1', name='valve', joint='a', kind='revolute', gain=1.0)
    long = log_of(3600.0)
    long = replace(long, q=long.q[:, :1], tau=long.tau[:, :1])
    fit, held, _ = manageable([long], [], axis, Conditioning())
    assert seconds_of(fit) == pytest.approx(480.0, rel=0.02)
    assert seconds_of(held) == pytest.approx(240.0, rel=0.02)


def test_no_stretch_is_too_short_for_the_filters_in_a_log_of_many_gaps():
    """A sample is lost every 9 s."""
    log = log_of(1200.0)
    gaps = replace(log, segments=tuple(
        slice(start, start + 899) for start in range(0, 119_700, 900)))
    thin, = spread_over([gaps], 120.0)
    assert seconds_of([thin]) == pytest.approx(120.0, rel=0.1)
    assert min(part.stop - part.start for part in thin.segments) == 899
    assert thin.t[-1] == gaps.t[gaps.segments[-1].stop - 1]


def test_of_many_short_logs_some_are_taken_whole():
    logs = [replace(log_of(9.0), name=f'log {number}') for number in range(100)]
    taken = spread_over(logs, 90.0)
    assert len(taken) == 10
    assert {seconds_of([log]) for log in taken} == {9.0}
    assert (taken[0].name, taken[-1].name) == ('log 0', 'log 99')


def test_a_log_of_two_samples_a_minute_is_cut_between_them():
    log = replace(log_of(60.0), period=30.0, t=30.0 * np.arange(6000))
    thin, = spread_over([log], 6000.0)
    assert seconds_of([thin]) == pytest.approx(6000.0)


def test_of_logs_without_a_stretch_for_the_filters_something_is_returned():
    log = log_of(60.0)
    torn = replace(log, segments=tuple(slice(start, start + 20) for start in range(0, 6000, 50)))
    thin, = spread_over([torn], 6.0)
    assert 0.0 < seconds_of([thin]) < 6.1


@pytest.mark.parametrize(('gap', 'share'), [(None, 2.0 / 3.0), (0.2, 2.0 / 3.0), (0.95, 2.0 / 3.0),
                                            (0.7, 0.7)])
def test_the_last_third_of_a_log_is_held_out_wherever_its_gaps_are(gap, share):
    """A gap within a sixth of its rows is where it is cut."""
    log = log_of_model(REFERENCE, read_model('table1', REFERENCE), duration=24.0)
    if gap is not None:
        at = round(gap * len(log.t))
        log = replace(log, segments=(slice(0, at), slice(at + 100, len(log.t))))
    fit, held = split_runs([log], [], REFERENCE, Conditioning())
    fitted, kept = (sum(int(run.valid.any(axis=1).sum()) for run in runs) for runs in (fit, held))
    assert fitted / (fitted + kept) == pytest.approx(share, abs=0.04)
    times = [np.concatenate([run.t[run.valid.any(axis=1)] for run in runs]) for runs in (fit, held)]
    assert times[0].max() < times[1].min()


def test_what_is_held_out_of_a_log_that_ends_at_rest_moves():
    """It is the last third of the motion, not of the time."""
    log = log_of_model(REFERENCE, read_model('table1', REFERENCE), duration=12.0)
    rest = np.full((2 * len(log.t), 4), log.q[-1])
    q = np.concatenate((log.q, rest))
    resting = replace(log, t=log.period * np.arange(len(q)), q=q, tau=np.concatenate(
        (log.tau, np.zeros_like(rest))), segments=(slice(0, len(q)),), reference=None)
    fitted, kept = (sum(int(run.valid.any(axis=1).sum()) for run in runs)
                    for runs in split_runs([resting], [], REFERENCE, Conditioning()))
    assert fitted / (fitted + kept) == pytest.approx(2 / 3, abs=0.04)


@pytest.mark.parametrize(('stretches', 'told'), [(2, False), (40, True)])
def test_gaps_that_leave_too_few_rows_are_named(stretches, told):
    reason, = too_few(_moving(np.ones(8), stretches))
    assert f'moves in only {stretches} rows' in reason
    assert ('without the gaps' in reason) == told
    assert 'stands still' not in reason


def test_a_joint_that_slips_now_and_then_is_said_to_stand_still():
    reason, = too_few(_moving(np.where(np.arange(100) % 10 < 3, 0.6, 0.01)))
    assert '(it stands still in 70% of the time: a pause, or does it stick?)' in reason


@pytest.mark.parametrize('alone', [True, False])
def test_only_of_several_joints_all_are_to_move_longer(alone):
    assert ('of all joints' in too_few(_moving(np.ones(8), alone=alone))[0]) == (not alone)


def _moving(speed, stretches=1, alone=True):
    run = SimpleNamespace(valid=np.ones((1, 1), dtype=bool), period=1e-3,
                          state=SimpleNamespace(qd=speed[:, None]))
    return SimpleNamespace(runs=[run] * stretches, steady=False, of_axis=alone)


@pytest.mark.parametrize('gap', [False, True])
def test_pieces_are_all_of_a_log_and_none_is_long(gap, monkeypatch):
    log = log_of(60.0, gap)
    assert in_pieces(log).segments == log.segments
    monkeypatch.setattr(stretches, 'PIECE', 7.0)
    cut = in_pieces(log).segments
    assert cut[0].start == 0
    assert cut[-1].stop == len(log.t)
    assert all(one.stop == other.start for one, other in pairwise(cut))
    assert max(part.stop - part.start for part in cut) <= 700
    assert {part.start for part in log.segments} <= {part.start for part in cut}


def test_pieces_of_a_log_tell_the_same_parameters(monkeypatch):
    log = log_of_model(REFERENCE, read_model('table1', REFERENCE), duration=12.0)
    whole = identify([log], REFERENCE).estimate
    monkeypatch.setattr(stretches, 'PIECE', 3.0)
    parts = identify([log], REFERENCE)
    assert len(parts.runs) > 3
    assert 0 < whole.rows - parts.estimate.rows < 0.04 * whole.rows
    assert (np.abs(parts.estimate.values - whole.values) < whole.std).all()
