"""What the simulation says of its pace."""

from __future__ import annotations

import math

import pytest

from par4_kinematics.stamps import SECOND
from par4_sim.ros.pace import Pace


def paced(monkeypatch, factor: float, share: float, asked: float = 1.0, seconds: int = 8) -> Pace:
    """Return the pace of a simulation at `factor` x real time, `share` of it in the physics."""
    pace = Pace(asked, 'fast', 0.25e-3)
    for second in range(seconds):
        monkeypatch.setattr('time.monotonic', lambda second=second: 50.0 + second)
        pace.physics = share * second
        pace.measure(round(second * factor * SECOND), False)
    return pace


def test_a_pace_that_is_kept_is_told_without_complaint(monkeypatch):
    pace = paced(monkeypatch, 0.99, 0.9)
    assert pace.factor == pytest.approx(0.99)
    assert pace.complaint == ''


def test_a_pace_that_is_not_kept_names_the_smallest_step_that_would_do(monkeypatch):
    assert 'physics_step:=0.0005 would do' in paced(monkeypatch, 0.7, 0.9).complaint
    assert 'physics_step:=0.001 would do' in paced(monkeypatch, 0.4, 0.9).complaint
    assert '0.13 %' in paced(monkeypatch, 0.4, 0.9).complaint
    # where the time goes elsewhere no step helps
    assert 'physics_step' not in paced(monkeypatch, 0.7, 0.1).complaint
    assert 'real_time_factor:=0.63' in paced(monkeypatch, 0.7, 0.1).complaint


def test_a_clock_that_stands_still_is_told():
    pace = Pace(1.0, 'fast', 0.25e-3)
    with pytest.MonkeyPatch.context() as patch:
        for second in range(8):
            patch.setattr('time.monotonic', lambda second=second: 50.0 + second)
            pace.physics = 0.5 * second
            pace.measure(0, False)
    assert 'stands still' in pace.complaint


def test_nothing_is_complained_of_before_it_is_known_or_where_no_pace_is_asked(monkeypatch):
    assert paced(monkeypatch, 0.5, 0.9, seconds=3).complaint == ''
    assert paced(monkeypatch, 0.5, 0.9, asked=0.0).complaint == ''
    pace = paced(monkeypatch, 0.5, 0.9)
    pace.measure(0, True)
    assert math.isnan(pace.factor)
    assert pace.complaint == ''


def told(monkeypatch, *factors: float) -> list[bool]:
    """Return whether there is a complaint after each second at so many x real time."""
    pace, now, complaints = Pace(1.0, 'fast', 0.25e-3), 0.0, []
    for second, factor in enumerate(factors):
        monkeypatch.setattr('time.monotonic', lambda second=second: 50.0 + second)
        now += factor * SECOND
        pace.measure(round(now), False)
        complaints.append(bool(pace.complaint))
    return complaints


def test_a_pace_about_the_one_that_counts_as_kept_is_told_once(monkeypatch):
    """A busy machine: too slow for some seconds, then nearly kept, again and again."""
    complaints = told(monkeypatch, *[0.9] * 6, *([0.99] * 6 + [0.9] * 6) * 10)
    assert complaints[:5] == [False] * 5
    assert complaints[5:] == [True] * len(complaints[5:])


def test_a_complaint_ends_once_the_pace_was_regained_for_a_whole_window(monkeypatch):
    slow = told(monkeypatch, *[0.9] * 10, *[0.97] * 30)
    assert slow[-1], 'kept, but not well'
    complaints = told(monkeypatch, *[0.9] * 10, *[1.0] * 20)
    ended = complaints.index(False, 10) - 10
    assert 5 <= ended <= 11
    assert not any(complaints[10 + ended:])
    assert not any(told(monkeypatch, *[0.96] * 30)), 'nor does one begin that is kept'
