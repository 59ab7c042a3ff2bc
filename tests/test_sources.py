"""Two simulations on one topic: whose each message is, also where one stalls or starts again."""

from __future__ import annotations

import numpy as np
import pytest

from par4_identification.logs.sources import source_of
from par4_identification.logs.stamped_rows import StampedRows

SECOND = 1_000_000_000


def talk(zero: float, duration: float, begin: float = 0.0,
         stalls: tuple[tuple[float, float], ...] = (), back: float = 0.0, rate: float = 1.0,
         period: float = 2e-3) -> tuple[np.ndarray, np.ndarray]:
    """Return when a simulation is heard, and its stamps, ns.

    Args:
        zero: its first stamp, s.
        duration: s of simulated time.
        begin: time of receipt of its first message, s.
        stalls: after how many simulated seconds it stalls, and how long, s.
        back: s by which its clock is set back in the middle.
        rate: simulated seconds a second.
        period: s.
    """
    elapsed = period * np.arange(round(duration / period))
    received = begin + elapsed / rate + sum(long * (elapsed >= at) for at, long in stalls)
    stamp = zero + elapsed - back * (elapsed >= 0.5 * duration)
    return tuple(np.rint(SECOND * part).astype(np.int64) for part in (received, stamp))


def cut_off(heard: tuple[np.ndarray, np.ndarray], until: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what is heard of a simulation until a stamp, s."""
    kept = heard[1] < until * SECOND
    return tuple(part[kept] for part in heard)


def topic(*talks: tuple[np.ndarray, np.ndarray]) -> StampedRows:
    """Return what is heard of simulations together; the only value is the number of each."""
    received, stamp = (np.concatenate(parts) for parts in zip(*talks, strict=True))
    values = np.repeat(np.arange(float(len(talks))), [len(heard) for heard, _ in talks])[:, None]
    order = np.argsort(received, kind='stable')
    return StampedRows('/joint_states', received, stamp, values, {}).part(order)


TWO = {
    'neither stalls': (talk(0.0, 20.0), talk(500.0, 12.0, 3.0003)),
    'the other stalls': (talk(0.0, 20.0), talk(500.0, 12.0, 3.0003, ((6.0, 3.0),))),
    'the own stalls': (talk(0.0, 20.0, 0.0, ((6.0, 3.0),)), talk(500.0, 12.0, 3.0003)),
    'both stall': (talk(0.0, 20.0, 0.0, ((6.0, 3.0), (12.0, 1.0))),
                   talk(500.0, 12.0, 3.0003, ((3.0, 2.0), (9.0, 0.5)))),
    'one stalls past the other': (talk(0.0, 20.0, 0.0, ((6.0, 3.0),)), talk(-2.0, 12.0, 3.0003)),
    'the own starts again': (talk(0.0, 20.0, back=9.0), talk(500.0, 18.0, 1.0003)),
    'the other starts again': (talk(0.0, 20.0), talk(500.0, 18.0, 1.0003, back=9.0)),
    'the other is slow': (talk(0.0, 20.0), talk(500.0, 12.0, 3.0003, rate=0.7)),
    'both stall at once': (talk(0.0, 20.0, 0.0, ((6.0, 0.75),)),
                           talk(500.0, 18.0, 1.5003, ((4.5, 0.75),))),
    'both stall at once, then the other says more': (
        cut_off(talk(0.0, 20.0, 0.0, ((12.0, 0.75),)), 17.0),
        talk(500.0, 16.0, 4.0003, ((8.0, 0.75),))),
    'both start again together': (talk(0.0, 20.0, back=9.0), talk(500.0, 19.0, 0.5003, back=9.0)),
}


@pytest.mark.parametrize('case', TWO)
def test_the_source_with_more_messages_is_kept_whole_and_alone(case):
    more, fewer = TWO[case]
    rows = topic(more, fewer)
    source = source_of(rows)
    kept = source.of_its_clock(rows)
    np.testing.assert_array_equal(kept.stamp, more[1])
    assert not kept.values.any()
    # of another topic it is the same one that is kept, also where the other says more there
    received, stamp = (part[len(part) // 3::3] for part in more)
    np.testing.assert_array_equal(source.of_its_clock(topic((received, stamp), fewer)).stamp, stamp)


@pytest.mark.parametrize('alone', [
    talk(0.0, 20.0), talk(0.0, 20.0, 0.0, ((6.0, 3.0), (12.0, 1.0))), talk(0.0, 20.0, back=9.0),
    talk(0.0, 20.0, rate=0.5)], ids=['even', 'stalls', 'starts again', 'slow'])
def test_a_source_alone_is_kept_whole(alone):
    rows = topic(alone)
    assert source_of(rows).of_its_clock(rows) is rows
