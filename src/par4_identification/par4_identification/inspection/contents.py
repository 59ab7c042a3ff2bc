"""What a bag holds, before anything is made of it: topics with rates and gaps, and joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from par4_identification.logs.bag import RecordedTopic
from par4_identification.logs.raw_bag import JointSamples, RawBag
from par4_identification.logs.stamps import spacing_counts
from par4_kinematics.interface import JOINT_STATES

FEWEST_SPACED = 3
"""Messages from which on a rate means something."""


@dataclass(frozen=True)
class TopicContent:
    """The messages of one topic.

    Attributes:
        name, type: of the topic.
        messages: their number.
        rate: 1 / median spacing, Hz; None of fewer than three messages.
        gaps: spacings of more than 1.5 medians; None likewise.
        longest_gap: s; None likewise.
        by: whether spacings are those of the header stamps or of the times of receipt.
    """

    name: str
    type: str
    messages: int
    rate: float | None
    gaps: int | None
    longest_gap: float | None
    by: str


@dataclass(frozen=True)
class JointContent:
    """The samples of one joint on `joint_states`.

    Attributes:
        name: of the joint.
        samples: with a finite position.
        lowest, highest: position, rad, of a linear axis m; None without samples.
        velocity, effort: whether any sample carries one.
    """

    name: str
    samples: int
    lowest: float | None
    highest: float | None
    velocity: bool
    effort: bool


def topic_contents(topics: Sequence[RecordedTopic], bag: RawBag | None, joints: Sequence[str]
                   ) -> tuple[TopicContent, ...]:
    """Return what the topics of a bag hold; spacings by header stamps where `bag` was decoded.

    Then they are those of the messages with `joints`, if there are any: others on the topic, as of
    a gripper, have a rate and maybe a clock of their own.
    """
    decoded: Mapping[str, JointSamples] = {} if bag is None else {
        samples.topic: samples for samples in bag.joints.values()}
    found = []
    for topic in topics:
        by_stamp = topic.name in decoded
        times = _stamps(decoded[topic.name], joints) if by_stamp else topic.received
        times = np.unique(times)
        spacing = spacing_counts(times) if len(times) >= FEWEST_SPACED else None
        found.append(TopicContent(
            topic.name, topic.type, len(topic.received),
            None if spacing is None else 1.0 / spacing.period,
            None if spacing is None else spacing.gaps,
            None if spacing is None else spacing.longest_gap,
            'stamp' if by_stamp else 'receipt'))
    return tuple(found)


def _stamps(samples: JointSamples, joints: Sequence[str]) -> np.ndarray:
    """Return the stamps of the messages with these joints, of all messages where none has them."""
    own = samples.names_count(joints) > 0
    return samples.stamp[own] if own.any() else samples.stamp


def joint_contents(bag: RawBag) -> tuple[JointContent, ...]:
    """Return what `joint_states` tells of every joint, in order of their names."""
    samples = bag.joints[JOINT_STATES.name]
    names = sorted({name for layout in samples.layouts for name in layout})
    columns = {part: samples.select(getattr(samples, part), names)
               for part in ('position', 'velocity', 'effort')}
    found = []
    for column, name in enumerate(names):
        position = columns['position'][:, column]
        known = position[np.isfinite(position)]
        told: dict[str, Any] = {part: bool(np.isfinite(columns[part][:, column]).any())
                                for part in ('velocity', 'effort')}
        found.append(JointContent(
            name, len(known), float(known.min()) if len(known) else None,
            float(known.max()) if len(known) else None, **told))
    return tuple(found)
