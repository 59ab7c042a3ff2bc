"""Differences of recordings and causes are looked for in turn."""

from __future__ import annotations

from unittest import mock

import pytest

from par4_identification.changes import apart
from par4_identification.changes.apart import ROUNDS, diagnosed_apart
from par4_identification.diagnosis.verdict.answer import Diagnosis, Unusable


class Told:
    """Differences of a share and size; alike if their sizes are."""

    def __init__(self, size: float, share: float = 0.9) -> None:
        self.size, self.share, self.apart = size, share, {'log': {'platform_mass_1': size}}

    def is_like(self, other: Told) -> bool:
        return abs(self.size - other.size) < 0.1


class Recordings:
    """Diagnoses that are counted; each knows what was taken out of the recordings."""

    def __init__(self, useless: bool = False) -> None:
        self.asked: list[tuple[float | None, bool]] = []
        self.useless = useless

    def __call__(self, taken_out, *, bodies_alone=False):
        size = taken_out['log']['platform_mass_1'] if taken_out else None
        self.asked.append((size, bodies_alone))
        if taken_out and self.useless:
            return Unusable((), ())
        found = mock.Mock(spec=Diagnosis)
        found.size = size
        return found


def told(monkeypatch, *answers):
    """Let comparisons give these answers in turn, and return the least shares asked for."""
    shares, left = [], list(answers)

    def compared(_whole, _machine, _baseline, least, _alike=None, _before=None):
        shares.append(least)
        found = left.pop(0)
        return found if found is not None and found.share > least else None

    monkeypatch.setattr(apart, 'differences_between_logs', compared)
    return shares


def run(recordings, logs=2):
    return diagnosed_apart(recordings, logs, None, None, lambda _step: None)


def test_a_single_recording_is_compared_with_none(monkeypatch):
    shares = told(monkeypatch, None)
    recordings = Recordings()
    found, between = run(recordings, logs=1)
    assert (found.size, between) == (None, None)
    assert recordings.asked == [(None, False)]
    assert shares == [apart.WORTH_A_TRY]


def test_what_bodies_alone_tell_needs_no_search(monkeypatch):
    shares = told(monkeypatch, Told(0.6, 0.99), Told(0.6))
    recordings = Recordings()
    found, between = run(recordings)
    assert (found.size, between.size) == (0.6, 0.6)
    assert recordings.asked == [(None, True), (0.6, False)]
    assert shares == [apart.NEARLY_ALL, apart.MOST]


def test_a_difference_is_read_again_beside_causes_until_it_stays(monkeypatch):
    told(monkeypatch, None, Told(1.3), Told(1.1), Told(1.0), Told(1.02))
    recordings = Recordings()
    found, between = run(recordings)
    assert (found.size, between.size) == (1.0, 1.0)
    assert recordings.asked == [(None, True), (None, False), *(
        (size, False) for size in (1.3, 1.1, 1.0))]


def test_what_never_stays_ends(monkeypatch):
    told(monkeypatch, None, *(Told(float(size)) for size in range(1, 20)))
    recordings = Recordings()
    found, between = run(recordings)
    assert found.size == between.size == 1.0 + ROUNDS


@pytest.mark.parametrize('mended', [False, True])
def test_a_difference_that_makes_little_must_mend_much(monkeypatch, mended):
    told(monkeypatch, None, Told(1.0, 0.5), Told(1.0, 0.5))
    monkeypatch.setattr(apart, 'mends', lambda alike, whole: mended and (
        alike.size, whole.size) == (1.0, None))
    found, between = run(Recordings())
    assert (found.size, None if between is None else between.size) == (
        (1.0, 1.0) if mended else (None, None))


def test_without_what_differs_recordings_may_be_useless(monkeypatch):
    told(monkeypatch, Told(0.6, 0.99), Told(0.6))
    recordings = Recordings(useless=True)
    found, between = run(recordings)
    assert (found.size, between) == (None, None)
    assert recordings.asked[:2] == [(None, True), (0.6, False)]
