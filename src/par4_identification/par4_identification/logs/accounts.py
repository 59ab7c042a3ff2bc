"""What a bag's samples needed on the way to a log: counted, and said in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from par4_kinematics.interface import REFERENCE

SHORTEST_SEGMENT = 20
"""Samples; shorter segments are dropped."""
DISAGREEMENT = 0.01
"""Relative difference of effort and G V above which it is reported."""
OPPOSITE = 1.9
"""Relative difference from which they are the same but for the sign."""


@dataclass(frozen=True)
class SampleCounts:
    """What one topic's samples needed.

    Attributes:
        topic: name with its namespace.
        read: samples.
        other_joints: without any of the machine's joints, ignored.
        incomplete: with some of the joints only, dropped.
        named_twice: with two values of a joint, dropped.
        not_stamped: stamp zero while the clock runs elsewhere, dropped.
        repeated: sent again with the same stamp and values, dropped.
        conflicting: with the stamp of another sample but other values, dropped.
        crowded: closer than a quarter of a period behind another, dropped.
        not_finite: NaN, infinite or beyond what any sensor tells, dropped.
        out_of_order: received after a later one, sorted in.
        gaps: spacings of more than 1.5 periods.
        longest_gap: s.
        lost: samples that the gaps would have held.
        period: median spacing, s.
        jitter_rms: of the spacing about the period, gaps left out, s.
    """

    topic: str
    read: int
    other_joints: int
    incomplete: int
    named_twice: int
    not_stamped: int
    repeated: int
    conflicting: int
    crowded: int
    not_finite: int
    out_of_order: int
    gaps: int
    longest_gap: float
    lost: int
    period: float
    jitter_rms: float

    def findings(self) -> tuple[str, ...]:
        """Return what was repaired or dropped, in words; nothing for good samples."""
        found = [f'{count} of {self.read} samples {words}' for count, words in (
            (self.incomplete, 'lack some of the joints, dropped'),
            (self.named_twice, 'name a joint more than once, dropped'),
            (self.not_stamped, 'without stamp, dropped'),
            (self.repeated, 'repeated, dropped'),
            (self.conflicting, 'with the stamp of another but other values, dropped'),
            (self.crowded, 'closer than a quarter of a period to another, dropped'),
            (self.not_finite, 'not finite, dropped'),
            (self.out_of_order, 'out of order, sorted in')) if count]
        if self.gaps:
            found.append(f'{self.gaps} gaps, the longest {self.longest_gap:.4g} s, about '
                         f'{self.lost} samples lost')
        return tuple(found)


@dataclass(frozen=True)
class Accounts:
    """What was read, repaired and dropped on the way from a bag to a `Log`.

    Attributes:
        bag: path.
        namespace: under which the topics were found.
        duration: from the first sample to the last, segments and the gaps between, s.
        samples, segments: of the log.
        period: of its grid, s.
        resampled: whether the stamps were uneven, so that every value is interpolated.
        filled: samples interpolated in short gaps.
        clock_resets: times the clock was set back.
        short_segments: samples dropped with segments of fewer than 20.
        without_torque: samples dropped because no torque was measured there.
        torque_source: 'amplifier_voltage' or 'effort'.
        torque_disagreement: |G V - effort| over the larger of |G V| and |effort|, 2-norms over the
            log, of each joint where both are there; else None.
        position, torque: what the samples needed.
        reordered: messages with the joints in another order than the machine's.
        ignored_joints: names.
        ignored_topics: type by name.
        unreadable: messages that could not be decoded, by topic.
        reference: 'absent', 'read', or why it was ignored.
        clock_offset: by which the stamps of the torque were moved because its topic has another
            clock, s.
        other_source: messages with positions from a second source with another clock, dropped.
        mixed: start and end, s, of stretches that were left out because two sources talk there.
        wraps: how often the reading of a joint jumps by a whole turn; put together.
        restarts: how often the counter of a single joint starts again after another way, and after
            which one, with its unit; put together.
        jumps: times, s, at which several positions jump from one sample to the next.
        jitter: of stamps whose readings were taken evenly, rms, s; they are put back evenly.
        interpolated: samples that whoever wrote the log put on a line between others, left out.
        clipped: share of the samples in which the position of a joint stands at an end of its range
            in motion, left out, and at which, with its unit.
        held: for how long each reading of 'position' or 'torque' repeats, s, where it does.
    """

    bag: str
    namespace: str
    duration: float
    samples: int
    segments: int
    period: float
    resampled: bool
    filled: int
    clock_resets: int
    short_segments: int
    without_torque: int
    torque_source: str
    torque_disagreement: tuple[float, ...] | None
    position: SampleCounts
    torque: SampleCounts
    reordered: int
    ignored_joints: tuple[str, ...]
    ignored_topics: dict[str, str]
    unreadable: dict[str, int]
    reference: str
    clock_offset: float = 0.0
    other_source: int = 0
    mixed: tuple[tuple[float, float], ...] = ()
    wraps: Mapping[str, int] = field(default_factory=dict)
    restarts: Mapping[str, tuple[int, float, str]] = field(default_factory=dict)
    jumps: tuple[float, ...] = ()
    jitter: float = 0.0
    interpolated: int = 0
    clipped: Mapping[str, tuple[float, tuple[float, ...], str]] = field(default_factory=dict)
    held: Mapping[str, float] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Return the accounts as plain dicts, lists, numbers and strings."""
        return asdict(self)

    def of_clocks(self) -> tuple[str, ...]:
        """Return what was wrong with clocks and sources, in words; nothing for a good bag."""
        found = []
        if self.clock_resets:
            often = 'once' if self.clock_resets == 1 else f'{self.clock_resets} times'
            found.append(f'the clock was set back {often}, as when a simulation is started again; '
                         f'the log is cut there')
        if self.clock_offset:
            found.append(f'{self.torque.topic} has another clock than {self.position.topic}; moved '
                         f'by {self.clock_offset:.6g} s, as its receipt tells')
        if self.other_source:
            found.append(f'two machines or simulations with clocks of their own talk on '
                         f'{self.position.topic}; {self.other_source} messages of the one with '
                         'fewer are left out')
        found += [f'two machines or simulations talk on {self.position.topic} from {start:.4g} to '
                  f'{end:.4g} s; that stretch is left out' for start, end in self.mixed]
        found += [f'the position of {joint} jumps by a whole turn '
                  f'{count} time{"s" if count > 1 else ""}, as a reading that wraps round; put '
                  'together' for joint, count in self.wraps.items()]
        found += [f'the position of {joint} jumps {count} times by '
                  f'{way:.5g} {unit}, as a counter that starts again; put together'
                  for joint, (count, way, unit) in self.restarts.items()]
        found += [f'the position of {joint} {clipped_words(levels, share, unit)}; these samples '
                  f'are left out, and the log is cut there; widen the range of what carries it, or '
                  f'move less far'
                  for joint, (share, levels, unit) in self.clipped.items()]
        if self.jumps:
            more = f' and {len(self.jumps) - 1} times more' if len(self.jumps) > 1 else ''
            found.append(f'positions jump within a sample at {self.jumps[0]:.4g} s{more}, as where '
                         f'two recordings are joined or samples are missing without a gap in the '
                         f'stamps; the log is cut there')
        found += [f'the {name} {held_words(self.held[name], counts.period)}; '
                  f'only its changes are used, at {1.0 / self.period:.3g} Hz; have the {name} sent '
                  f'as often as the log is written'
                  for name, counts in (('position', self.position), ('torque', self.torque))
                  if name in self.held]
        return tuple(found)

    def of_torques(self) -> tuple[str, ...]:
        """Return how far the two sources of torque disagree, in words; nothing for a good bag."""
        if not self.torque_disagreement or max(self.torque_disagreement) <= DISAGREEMENT:
            return ()
        parts = ', '.join(f'{100 * part:.3g} %' for part in self.torque_disagreement)
        sign = max(self.torque_disagreement) > OPPOSITE
        return (f'effort and gain x amplifier voltage disagree by {parts}'
                f'{", as torques of opposite sign do" if sign else ""}; the voltage rules; check '
                f'{"their signs" if sign else "drives.gain of the robot file"}',)

    def findings(self) -> tuple[str, ...]:
        """Return what was repaired, dropped or suspicious, in words; nothing for a good bag."""
        said: dict[str, list[str]] = {}
        for name, samples in (('positions', self.position), ('torques', self.torque)):
            for words in samples.findings():
                said.setdefault(words, []).append(name)
        found = [f'{" and ".join(names)}: {words}' for words, names in said.items()]
        found += [f'{topic}: {count} messages cannot be decoded, ignored'
                  for topic, count in self.unreadable.items()]
        # at either end one topic may begin or end a sample before the other: nothing is missing
        unmeasured = (self.without_torque
                      if self.without_torque * self.period > 2.0 * self.torque.period else 0)
        found += self.of_clocks()
        found += [f'{count} {words}' for count, words in (
            (self.filled, 'samples filled by interpolation'),
            (self.short_segments, f'samples dropped in segments shorter than {SHORTEST_SEGMENT}'),
            (unmeasured, 'samples dropped where no torque was measured')) if count]
        if self.segments > 1:
            found.append(f'gaps cut the log into {self.segments} segments')
        if self.resampled:
            found.append(f'uneven stamps (spacing +- {self.position.jitter_rms:.3g} s rms), '
                         f'resampled every {self.period:.6g} s')
        if self.interpolated:
            found.append(f'{self.interpolated} of {self.position.read} positions lie to the last '
                         f'digit on the line between their neighbours, torques too: whoever wrote '
                         f'the log filled them in; left out; record what was measured')
        if self.jitter:
            found.append(f'the stamps of the positions jitter by '
                         f'{1e3 * self.jitter:.2g} ms rms though the readings were taken evenly; '
                         f'put back every {1e3 * self.period:.4g} ms; stamp a reading when it is '
                         f'taken')
        found += self.of_torques()
        if self.reference not in ('absent', 'read'):
            found.append(f'{REFERENCE.name} ignored: {self.reference}')
        return tuple(found)


def clipped_words(levels: Sequence[float], share: float, unit: str) -> str:
    """Return what to know of readings that stand at some levels for a share of a log."""
    return (f'stands at exactly {" and ".join(f"{level:.4g}" for level in levels)} {unit} for '
            f'{100.0 * share:.2g} % of the samples while the joint goes on: it is clipped')


def held_words(held: float, period: float) -> str:
    """Return what to know of a signal that is held for so long in a log of this period, s."""
    return (f'changes every {1e3 * held:.3g} ms in a log of {1e3 * period:.3g} ms, being held in '
            f'between')


def accounts_of_motion(name: str, samples: int, period: float) -> Accounts:
    """Return the accounts of a log that no bag gave: of a motion, every `period` s."""
    counts = SampleCounts(topic=name, read=samples, other_joints=0, incomplete=0, named_twice=0,
                          not_stamped=0, repeated=0, conflicting=0, crowded=0, not_finite=0,
                          out_of_order=0, gaps=0, longest_gap=0.0, lost=0, period=period,
                          jitter_rms=0.0)
    return Accounts(
        bag=name, namespace='', duration=(samples - 1) * period, samples=samples, segments=1,
        period=period, resampled=False, filled=0, clock_resets=0, short_segments=0,
        without_torque=0, torque_source='effort', torque_disagreement=None, position=counts,
        torque=counts, reordered=0, ignored_joints=(), ignored_topics={}, unreadable={},
        reference='absent')
