"""A machine's life in words, and `trend.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from par4_dynamics.base_terms import PLATFORM_MASSES
from par4_identification.reports.outcome.changes import phrase_of_reading
from par4_identification.trend.channels import Channel
from par4_identification.trend.course import FEWEST
from par4_identification.trend.life import FALSE_ALARMS, Event, Happening, Life
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome, Remark, note
from par4_sim.report.results import plain
from par4_sim.report.words import capital, in_words, joint_labels, listed, number, percent

TOLD = 4
"""Events in the one sentence; more are counted there and told below."""
WEEK = 7.0
"""Days."""
SLIGHT = 0.01
"""Share of a level below which a drift beside a step is not told."""


def date_of(life: Life, index: int) -> datetime:
    """Return when a bag was recorded."""
    return datetime.fromtimestamp(life.bags[index].stamp / 1e9, UTC)


def day(life: Life, index: int) -> str:
    """Return the date of a bag as people say it, with its year where the data have several."""
    date = date_of(life, index)
    years = {date_of(life, place).year for place in (0, -1)}
    return f'{date.day} {date:%B}' + (f' {date.year}' if len(years) > 1 else '')


def name_of_channel(channel: Channel, machine: Robot | Axis) -> str:
    """Return a series in words, as 'viscous friction of joint 1'."""
    name, _, joint = channel.name.partition('[')
    words = ' '.join(in_words(part) for part in name.split('.'))
    if joint:
        return f'{words} of joint {joint.rstrip("]")}'
    if channel.is_factor and len(joint_labels(machine)) > 1:
        return f'{words} of all joints'
    return words


def sentence_of_event(life: Life, event: Event, machine: Robot | Axis) -> str:
    """Return what happened when, a clause."""
    when = day(life, event.index)
    parts: list[tuple[int, str]] = []
    if event.read:
        phrases = listed([phrase_of_reading(item.reading, item.size, machine)
                          for item in event.read])
        parts.append((event.index, f'on {when} {phrases}'))
    elif not event.is_drift:
        steps = [part for part in event.happenings if part.is_step]
        parts.append((event.index, f'on {when} ' + listed([_step_phrase(life, part, machine)
                                                           for part in steps[:3]])))
    for part in event.happenings:
        drift = _drift_phrase(life, part, machine)
        if drift and (event.is_drift or not parts or not _is_slight(life, part)):
            parts.append((part.item.index, drift))
    return '; '.join(phrase for _, phrase in sorted(parts, key=lambda part: part[0]))


def _level(life: Life, part: Happening, index: int) -> float:
    return float(life.courses[part.channel].fitted[index])


def _step_phrase(life: Life, part: Happening, machine: Robot | Axis) -> str:
    channel, size = life.channels[part.channel], part.item.step
    name = name_of_channel(channel, machine)
    before = _level(life, part, max(part.item.index - 1, 0))
    way = 'up' if size > 0.0 else 'down'
    if channel.is_factor:
        return f'{name} {way} by {percent(abs(size / before))}'
    unit = unit_on(machine, channel.unit)
    return f'{name} {way} by {number(abs(size), 2)} {unit}'.rstrip()


def _drift_phrase(life: Life, part: Happening, machine: Robot | Axis) -> str:
    """Return how a series began or ceased to drift; empty where its slope did not change."""
    if part.item.kind not in ('slope', 'both'):
        return ''
    channel, course = life.channels[part.channel], life.courses[part.channel]
    before = sum(item.slope for item in course.changes if item.index < part.item.index)
    after = before + part.item.slope
    name, when = name_of_channel(channel, machine), day(life, part.item.index)
    std = part.item.std[1]
    if abs(after) < max(4.0 * std, 0.05 * abs(before)):
        return '' if part.is_step else (
            f'{name} ceased to {"rise" if before > 0.0 else "fall"} on {when}')
    began = abs(before) < max(4.0 * std, 0.05 * abs(after))
    verb = 'rise' if after > 0.0 else 'fall'
    # a drift that began between two bags is as large as it is against the bag before
    between = part.item.kind == 'both' and not part.is_step
    start = _level(life, part, max(part.item.index - between, 0))
    end = _level(life, part, part.until)
    if abs(end - start) <= 3.0 * std * (life.t[part.until] - life.t[part.item.index]):
        return ''
    last = part.until == len(life.t) - 1
    until = 'by now' if last else f'by {day(life, part.until)}'
    if channel.is_factor or (channel.name not in PLATFORM_MASSES and start > 0.0):
        speed, total = percent(abs(after) * WEEK / start), percent(abs(end / start - 1.0))
    else:
        unit = unit_on(machine, channel.unit)
        speed, total = (f'{number(abs(value), 2)} {unit}'.rstrip()
                        for value in (after * WEEK, end - start))
    began_at = (f'{name} was {verb[:-1] if verb == "rise" else verb}ing from the first bag on'
                if part.item.index == 0 else f'{name} '
                f'{"began to " + verb if began else "went on to " + verb} on {when}')
    return f'{began_at}, {speed} a week; {total} {until}'


def _is_slight(life: Life, part: Happening) -> bool:
    """Return whether the drift beside a step is little of the level."""
    course = life.courses[part.channel]
    before = sum(item.slope for item in course.changes if item.index < part.item.index)
    span = life.t[part.until] - life.t[part.item.index]
    return abs((before + part.item.slope) * span) < SLIGHT * abs(
        _level(life, part, part.item.index))


def outcome_of_life(life: Life, refused: Mapping[str, str], machine: Robot | Axis) -> Outcome:
    """Return what changed when, in one sentence, and all of it below."""
    count = len(life.bags)
    first, last = day(life, 0), day(life, -1)
    dates = f'of {first}' if first == last else f'from {first} to {last}'
    span = f'{count} bag{"s" if count > 1 else ""} {dates}'
    clauses = [sentence_of_event(life, event, machine) for event in life.events]
    clauses = [clause for clause in clauses if clause]
    if not clauses:
        odd = len({index for index, _ in life.odd})
        alone = f', but {odd} of them {"differs" if odd == 1 else "differ"} from the others' if (
            odd) else ''
        sentence = (f'Nothing changed for good over {span} beyond what chance and the seasons '
                    f'do{alone}.' if len(life.bags) >= FEWEST else
                    f'{capital(span)} {"say" if count > 1 else "says"} nothing of a change; '
                    f'give at least {FEWEST}.')
    elif len(clauses) <= TOLD:
        sentence = f'{capital("; ".join(clauses))}.'
    else:
        sentence = (f'{len(clauses)} changes over {span}; the last ones: '
                    f'{"; ".join(clauses[-2:])}.')
    remarks = [note(f'Read from {span}. Where nothing changes, one false alarm in '
                    f'{1.0 / FALSE_ALARMS:.0f} bags is to be expected at most.')]
    for index in sorted({index for index, _ in life.odd}):
        names = listed([name_of_channel(life.channels[channel], machine)
                        for own, channel in life.odd if own == index][:3])
        remarks.append(Remark(False, f'{life.bags[index].bag} of {day(life, index)} does not '
                                     f'belong to the others: {names}.',
                              'Look at what was different in that recording.'))
    if refused:
        remarks.append(Remark(
            False, f'{len(refused)} bag{"s" if len(refused) > 1 else ""} could not be used; the '
                   f'reasons stand below.', 'Mend or leave out the bags that are listed.'))
    return Outcome(sentence, 'good' if not clauses and not refused else 'fair', tuple(remarks))


def trend_json(life: Life, refused: Mapping[str, str], machine: Robot | Axis,
               sentence: str) -> dict[str, Any]:
    """Return `trend.json`."""
    dates = [date_of(life, index).isoformat(timespec='seconds') for index in range(len(life.bags))]
    return plain({
        'schema': 'par4/trend/1', 'sentence': sentence,
        'bags': [{'bag': bag.bag, 'date': date, 'duration': bag.duration,
                  'values': {name: bag.values[:, index] for index, name in enumerate(bag.terms)},
                  'findings': bag.findings} for bag, date in zip(life.bags, dates)],
        'series': [{'name': channel.name, 'unit': unit_on(machine, channel.unit),
                    'value': channel.values, 'std': channel.std, 'course': course.fitted,
                    'seasonal': course.wave, 'scatter': course.scatter}
                   for channel, course in zip(life.channels, life.courses)],
        'changes': [{'date': dates[event.index], 'bag': life.bags[event.index].bag,
                     'kind': 'drift' if event.is_drift else 'step',
                     'sentence': sentence_of_event(life, event, machine),
                     'readings': [phrase_of_reading(item.reading, item.size, machine)
                                  for item in event.read],
                     'series': [_happening_json(life, part) for part in event.happenings]}
                    for event in life.events],
        'odd': [{'bag': life.bags[index].bag, 'series': life.channels[number].name}
                for index, number in life.odd],
        'refused': [{'bag': bag, 'reason': reason} for bag, reason in refused.items()],
        'false_alarms_per_bag': FALSE_ALARMS})


def _happening_json(life: Life, part: Happening) -> dict[str, Any]:
    item = part.item
    return {'name': life.channels[part.channel].name, 'kind': item.kind, 'step': item.step,
            'step_std': item.std[0], 'slope_per_day': item.slope, 'slope_std': item.std[1],
            'until': life.bags[part.until].bag}


def lines_of_refused(refused: Mapping[str, str]) -> Sequence[str]:
    """Return a line for each bag that could not be used; the reason names the bag."""
    return [f'not used: {reason}' for reason in refused.values()]
