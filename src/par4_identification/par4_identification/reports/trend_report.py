"""The report of a machine's life."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from par4_identification.reports.outcome.trend import date_of, day, sentence_of_event
from par4_identification.reports.trend_plots import Panel, PlottedSeries
from par4_identification.reports.trend_plots import life as drawn_life
from par4_identification.trend.channels import Channel
from par4_identification.trend.course import Course
from par4_identification.trend.life import Life
from par4_kinematics.machine_units import unit_on
from par4_kinematics.robot import Axis, Robot
from par4_sim.report.outcome import Outcome
from par4_sim.report.page import rendered
from par4_sim.report.words import capital, in_words, number, typeset


def report_of_life(life: Life, outcome: Outcome, refused: Mapping[str, str],
                   machine: Robot | Axis, provenance: dict[str, Any]) -> str:
    """Return the report.

    Args:
        life: of the bags that could be used.
        outcome: in words.
        refused: bags that could not be used, with the reasons.
        machine: whose life it is.
        provenance: of the results.
    """
    dates = np.array([date_of(life, index).replace(tzinfo=None)
                      for index in range(len(life.bags))], dtype='datetime64[s]')
    return rendered(
        'par4_identification.reports', 'trend.html', outcome, f'The life of {machine.name}',
        'What it rests on', provenance, refused=list(refused.items()),
        life_picture=drawn_life(dates, panels_of(life, machine),
                                [dates[event.index] for event in life.events]),
        events=[(str(place), day(life, event.index), 'drift' if event.is_drift else 'step',
                 sentence_of_event(life, event, machine))
                for place, event in enumerate(life.events, start=1)],
        table=[_cells(channel, course, machine)
               for channel, course in zip(life.channels, life.courses)],
        dates=(day(life, 0), day(life, -1)))


def panels_of(life: Life, machine: Robot | Axis) -> list[Panel]:
    """Return a panel for each parameter or effect, those in which something happens first."""
    groups: dict[tuple[str, bool], list[int]] = {}
    for index, channel in enumerate(life.channels):
        name, _, joint = channel.name.partition('[')
        if name.startswith('platform_mass'):
            name = 'platform_mass'
        groups.setdefault((name, bool(joint)), []).append(index)
    panels = [_panel(life, name, own, members, machine)
              for (name, own), members in groups.items()]
    return sorted(panels, key=lambda panel: min(panel.events, default=len(life.events) + 1))


def _panel(life: Life, name: str, own: bool, members: Sequence[int], machine: Robot | Axis
           ) -> Panel:
    words = ' '.join(in_words(part) for part in name.split('.'))
    # a phase has no size that it could be a share of
    lines, percent = [], name != 'platform_mass' and '.phase' not in name
    for index in members:
        level = life.courses[index].fitted
        percent &= bool(np.nanmin(np.abs(level)) > 0.2 * np.nanmax(np.abs(level)) > 0.0)
    for index in members:
        channel, course = life.channels[index], life.courses[index]
        told = channel.values - course.wave
        first = course.fitted[np.isfinite(course.fitted)][0]
        scale, shift = (100.0 / first, 100.0) if percent else (1.0, 0.0)
        label = (f'joint {channel.name.partition("[")[2].rstrip("]")}' if own else
                 in_words(channel.name))
        lines.append(PlottedSeries(label, scale * told - shift, abs(scale) * channel.std,
                                   scale * course.fitted - shift,
                                   tuple(item.index for item in course.changes if item.step)))
    yearly = any(np.nanmax(np.abs(life.courses[index].wave)) > 0.0 for index in members)
    factor = life.channels[members[0]].is_factor
    title = 'platform masses' if name == 'platform_mass' else words
    if own and len(members) == 1:
        title += f', {lines[0].label}'
    elif own:
        title += ', each joint against all' if factor else ', each joint'
    elif factor:
        title += ', all joints' + (', without the wave of the seasons' if yearly else '')
    unit = 'change, %' if percent else typeset(unit_on(machine, life.channels[members[0]].unit))
    events: dict[int, int] = {}
    for place, event in enumerate(life.events, start=1):
        for part in event.happenings:  # strongest first
            if part.channel in members:
                events.setdefault(place, part.item.index)
    return Panel(capital(title), unit, tuple(lines), events)


def _cells(channel: Channel, course: Course, machine: Robot | Axis) -> dict[str, str]:
    told = course.fitted[np.isfinite(course.fitted)]
    return {
        'name': ' '.join(in_words(part) for part in channel.name.replace(
            '[', ', joint ').rstrip(']').split('.')),
        'first': number(float(told[0]), 4), 'last': number(float(told[-1]), 4),
        'change': f'{number(100.0 * float(told[-1] / told[0] - 1.0), 2)} %' if told[0] else '',
        'std': number(float(np.nanmedian(channel.std)), 2), 'scatter': number(course.scatter, 2),
        'breaks': str(len(course.changes)),
        'unit': '' if channel.unit in ('', '1') else typeset(unit_on(machine, channel.unit))}
