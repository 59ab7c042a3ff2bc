"""A machine's life from what its bags say: courses of all series, and what happened when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from par4_dynamics.base_terms import TERMS
from par4_identification.changes.explanation import Read, explained
from par4_identification.changes.readings import SCALE, Parameters, readings_of
from par4_identification.trend.bag_values import BagValues
from par4_identification.trend.channels import Channel, channels_of
from par4_identification.trend.course import Break, Course, course_of

FALSE_ALARMS = 2e-4
"""Expected number of false alarms a bag, of all series together."""
TOGETHER = 2
"""Bags within which breaks of several series are one event."""
BESIDE = 5
"""Bags on either side of an event that are compared to read it, fewer where another one is near."""
BETWEEN = 3.0
"""Spacings of bags within which a drift may have begun: so much of it looks like a step."""
DAY = 86_400e9
"""ns."""


@dataclass(frozen=True)
class Happening:
    """What one series did at an event.

    Attributes:
        channel: number of the series.
        item: the break.
        until: the last bag before the series changes again, or the last one.
        is_step: whether the level changed at once, by more than a drift that begins between two
            bags makes of it.
    """

    channel: int
    item: Break
    until: int
    is_step: bool


@dataclass(frozen=True)
class Event:
    """Something that happened to the machine.

    Attributes:
        index: of the first bag after it.
        happenings: what the series did, strongest first.
        read: what a mechanic would say, where the level changed at once; empty for a drift or
            where no reading explains all of it.
    """

    index: int
    happenings: tuple[Happening, ...]
    read: tuple[Read, ...]

    @property
    def is_drift(self) -> bool:
        """Whether nothing changed at once."""
        return not any(part.is_step for part in self.happenings)


@dataclass(frozen=True)
class Life:
    """All that bags of a machine say together.

    Attributes:
        bags: in order of time.
        t: days since the first, (n,).
        channels: the series.
        courses: of each.
        events: in order of time.
        odd: numbers of bags with a value that does not belong, with the series.
    """

    bags: tuple[BagValues, ...]
    t: np.ndarray
    channels: tuple[Channel, ...]
    courses: tuple[Course, ...]
    events: tuple[Event, ...]
    odd: tuple[tuple[int, int], ...]


def life_of(bags: Sequence[BagValues]) -> Life:
    """Return the life that bags, at least one, tell of one machine."""
    bags = tuple(sorted(bags, key=lambda bag: bag.stamp))
    t = np.array([(bag.stamp - bags[0].stamp) / DAY for bag in bags])
    channels = channels_of(bags)
    courses = tuple(_course(t, channel, FALSE_ALARMS / len(channels)) for channel in channels)
    odd = tuple((item.index, number) for number, course in enumerate(courses)
                for item in course.breaks if item.kind == 'odd')
    return Life(bags, t, channels, courses, _events(bags, t, channels, courses), odd)


def _course(t: np.ndarray, channel: Channel, chance: float) -> Course:
    told = np.isfinite(channel.values)
    if told.all():
        return course_of(t, channel.values, channel.std, chance, channel.yearly)
    # the size of an effect that some bags do not tell: the course of those that do
    places = np.flatnonzero(told)
    course = course_of(t[told], channel.values[told], channel.std[told], chance, channel.yearly)
    fitted, wave = np.full(len(t), np.nan), np.full(len(t), np.nan)
    fitted[told], wave[told] = course.fitted, course.wave
    breaks = tuple(Break(int(places[item.index]), item.kind, item.step, item.slope, item.std)
                   for item in course.breaks)
    return Course(breaks, fitted, wave, course.scatter)


def _events(bags: Sequence[BagValues], t: np.ndarray, channels: Sequence[Channel],
            courses: Sequence[Course]) -> tuple[Event, ...]:
    """Return breaks that are near each other in time as events."""
    found = sorted(((item.index, number, item) for number, course in enumerate(courses)
                    for item in course.changes), key=lambda part: part[0])
    groups: list[list[tuple[int, int, Break]]] = []
    for part in found:
        if groups and part[0] - groups[-1][0][0] <= TOGETHER:
            groups[-1].append(part)
        else:
            groups.append([part])
    starts = [_index(group) for group in groups]
    events = []
    for place, group in enumerate(groups):
        first = starts[place - 1] if place else 0
        last = starts[place + 1] if place + 1 < len(groups) else len(bags)
        happenings = sorted((Happening(
            number, item, _until(courses[number], item, len(bags)), _is_step(t, item))
            for _, number, item in group), key=lambda part: -_certainty(part.item))
        stepped = [channels[part.channel].name for part in happenings if part.is_step]
        read: tuple[Read, ...] = ()
        if stepped:
            before = range(max(first, starts[place] - BESIDE), starts[place])
            after = range(starts[place], min(last, starts[place] + BESIDE))
            read = _read(bags, before, after, stepped, _weather(
                bags, channels, courses, before, after))
        events.append(Event(starts[place], tuple(happenings), read))
    return tuple(events)


def _index(group: Sequence[tuple[int, int, Break]]) -> int:
    """Return the bag of the break that is most certain."""
    return max(group, key=lambda part: _certainty(part[2]))[0]


def _certainty(item: Break) -> float:
    """Return the size of a break in standard deviations; steps before slopes."""
    step, slope = (abs(size) / std if std else 0.0
                   for size, std in zip((item.step, item.slope), item.std))
    return max(step, slope)


def _until(course: Course, item: Break, count: int) -> int:
    later = [other.index for other in course.changes if other.index > item.index]
    return min(later) - 1 if later else count - 1


def _is_step(t: np.ndarray, item: Break) -> bool:
    """Return whether a break is more than a drift that began between two bags."""
    spacing = float(np.median(np.diff(t)))
    return abs(item.step) > max(BETWEEN * spacing * abs(item.slope), 3.0 * item.std[0])


def _weather(bags: Sequence[BagValues], channels: Sequence[Channel], courses: Sequence[Course],
             before: range, after: range) -> np.ndarray:
    """Return the covariance (J p, J p) that the seasons and the weather give the difference."""
    size = bags[0].values.size
    covariance = np.zeros((size, size))
    for channel, course in zip(channels, courses):
        if not (channel.yearly and channel.is_factor and before and after):
            continue
        direction = np.zeros_like(bags[0].values)
        index = bags[0].terms.index(channel.name)
        direction[:, index] = bags[before[-1]].values[:, index]
        wave = course.wave[list(after)].mean() - course.wave[list(before)].mean()
        variance = wave ** 2 + course.scatter ** 2 * (1.0 / len(before) + 1.0 / len(after))
        covariance += variance * np.outer(direction.ravel(), direction.ravel())
    return covariance


def _read(bags: Sequence[BagValues], before: range, after: range, stepped: Sequence[str],
          weather: np.ndarray) -> tuple[Read, ...]:
    """Return the readings of what bags after an event have beyond those before.

    Only what moves a series that stepped is told: what drifts meanwhile is told as a drift.
    """
    if not before or not after:
        return ()
    means, covariances = zip(*(mean_of([bags[index] for index in part])
                               for part in (before, after)))
    terms = tuple(TERMS[name] for name in bags[0].terms)
    parameters = Parameters(bags[0].terms, means[0], np.zeros_like(means[0]))
    explanation = explained(readings_of(terms, len(means[0])), parameters, means[1],
                            covariances[0] + covariances[1] + weather)
    if not explanation.is_complete:
        return ()
    return tuple(item for item in explanation.read if any(
        moved.parameter.partition('[')[0] in (SCALE, name.partition('[')[0])
        for moved in item.reading.moved(parameters, terms) for name in stepped))


def mean_of(bags: Sequence[BagValues]) -> tuple[np.ndarray, np.ndarray]:
    """Return the mean values (J, p) of bags and its covariance (J p, J p).

    To the covariance of the bags comes what they scatter beyond it, temperature above all: of each
    value the variance that is more, with the correlations of the scatter. Few bags tell more of
    neither, and the sum has no negative eigenvalue.
    """
    values = np.array([bag.values.ravel() for bag in bags])
    mean = values.mean(axis=0)
    covariance = np.mean([bag.covariance for bag in bags], axis=0)
    scatter = (values - mean).T @ (values - mean) / max(len(bags) - 1, 1)
    variance = np.diag(scatter)
    beyond = np.maximum(variance - np.diag(covariance), 0.0)
    share = np.sqrt(np.divide(beyond, variance, out=np.zeros_like(variance), where=variance > 0.0))
    covariance += scatter * np.outer(share, share)
    return mean.reshape(bags[0].values.shape), covariance / len(bags)
